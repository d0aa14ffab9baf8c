# Debian packages, made by tools/package/build:
#   tbm-camera-box   what runs on the box: the program, its unit, its configuration (any architecture)
#   tbm-tools        the PC's side: guidance, rail_line, total_station, hmi_bridge with its page, tbm, the simulators
# Included at the end of the root CMakeLists.txt.

set(package_dir ${CMAKE_CURRENT_LIST_DIR})

# Only what is used becomes a dependency.
foreach(program camera_box guidance rail_line total_station hmi_bridge tbm tbm_sim camera_sim total_station_sim)
  if(TARGET ${program})
    target_link_options(${program} PRIVATE -Wl,--as-needed)
  endif()
endforeach()

install(TARGETS camera_box RUNTIME DESTINATION bin COMPONENT camera_box)
install(FILES ${package_dir}/box/tbm-camera-box.service
  DESTINATION lib/systemd/system COMPONENT camera_box)
install(FILES ${package_dir}/box/sysusers.conf
  DESTINATION lib/sysusers.d RENAME tbm-camera-box.conf COMPONENT camera_box)
install(FILES ${package_dir}/box/sysctl.conf
  DESTINATION lib/sysctl.d RENAME 90-tbm-camera-box.conf COMPONENT camera_box)
install(FILES ${package_dir}/box/journald.conf
  DESTINATION lib/systemd/journald.conf.d RENAME tbm-camera-box.conf COMPONENT camera_box)
install(FILES ${package_dir}/box/system.conf
  DESTINATION lib/systemd/system.conf.d RENAME tbm-camera-box.conf COMPONENT camera_box)
install(FILES ${package_dir}/README.box.md
  DESTINATION share/doc/tbm-camera-box RENAME README.md COMPONENT camera_box)
# Absolute: these are the owner's to edit.
install(FILES ${package_dir}/box/camera_box.yaml ${package_dir}/box/rig.yaml
  DESTINATION /etc/tbm COMPONENT camera_box)
install(FILES ${package_dir}/box/serial.rules
  DESTINATION /etc/udev/rules.d RENAME 70-tbm-camera-box.rules COMPONENT camera_box)

set(package_components camera_box)
if(NOT CMAKE_CROSSCOMPILING)
  list(APPEND package_components tools)
  install(TARGETS guidance rail_line total_station hmi_bridge tbm tbm_sim camera_sim total_station_sim
    RUNTIME DESTINATION bin COMPONENT tools)
  install(DIRECTORY ${PROJECT_BINARY_DIR}/web/ DESTINATION share/tbm/console COMPONENT tools)
  install(FILES ${PROJECT_SOURCE_DIR}/README.md DESTINATION share/doc/tbm-tools COMPONENT tools)
  foreach(part pose devices guidance hmi_bridge)
    install(DIRECTORY ${PROJECT_SOURCE_DIR}/${part}/app/example
      DESTINATION share/doc/tbm-tools COMPONENT tools)
  endforeach()
  foreach(shell_and_file "bash;bash-completion/completions/tbm" "zsh;vendor-completions/_tbm")
    list(GET shell_and_file 0 shell)
    list(GET shell_and_file 1 file)
    if(shell STREQUAL zsh)
      string(PREPEND file "zsh/")
    endif()
    install(CODE "
      set(script \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/share/${file}\")
      file(WRITE \"\${script}\" \"\")
      execute_process(COMMAND $<TARGET_FILE:tbm> completion ${shell}
        OUTPUT_FILE \"\${script}\" COMMAND_ERROR_IS_FATAL ANY)" COMPONENT tools)
  endforeach()
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_CONTACT "TBM guidance <root@localhost>")
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_COMPONENTS_ALL ${package_components})
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
if(CMAKE_CROSSCOMPILING)
  set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE armhf)
endif()

# Written by hand, for dpkg knows nothing of a sysroot; tests/arm/package*_test.py compare with what the programs
# really load. Versions are those of Debian 12 where a symbol needs them.
set(camera_box_libraries
  "libaravis-0.8-0 (>= 0.8.26)"
  "libc6 (>= 2.36)"
  "libfastcdr1 (>= 1.0.16)"
  "libfastrtps2.9 (>= 2.9.1+ds)"
  "libfmt9 (>= 9.1.0+ds1)"
  "libgcc-s1 (>= 12)"
  "libglib2.0-0 (>= 2.74)"
  "libmodbus5 (>= 3.1.6)"
  "libpng16-16 (>= 1.6.39)"
  "libssl3 (>= 3.0.0)"
  "libstdc++6 (>= 12)"
  "libsystemd0 (>= 246)"
  "libtiff6 (>= 4.5.0)"
  "libyaml-cpp0.7 (>= 0.7.0)")
# The unit, the user and the bounds of the journal are systemd's.
set(camera_box_depends ${camera_box_libraries} "init-system-helpers (>= 1.60)" "passwd" "systemd (>= 252)")
set(tools_depends
  "libaravis-0.8-0 (>= 0.8.26)"
  "libatlas3-base"
  "libc6 (>= 2.36)"
  "libcholmod3 (>= 1:5.12)"
  "libcxsparse3 (>= 1:5.12)"
  "libfastcdr1 (>= 1.0.16)"
  "libfastrtps2.9 (>= 2.9.1+ds)"
  "libfmt9 (>= 9.1.0+ds1)"
  "libgcc-s1 (>= 12)"
  "libglib2.0-0 (>= 2.74)"
  "libgoogle-glog0v6 (>= 0.6.0)"
  "liblapack3 | liblapack.so.3"
  "libmodbus5 (>= 3.1.6)"
  "libopencv-calib3d406 (>= 4.6.0+dfsg)"
  "libopencv-core406 (>= 4.6.0+dfsg)"
  "libopencv-features2d406 (>= 4.6.0+dfsg)"
  "libopencv-flann406 (>= 4.6.0+dfsg)"
  "libopencv-imgproc406 (>= 4.6.0+dfsg)"
  "libpng16-16 (>= 1.6.39)"
  "libpugixml1v5 (>= 1.13)"
  "libssl3 (>= 3.0.0)"
  "libstdc++6 (>= 12)"
  "libsystemd0 (>= 246)"
  "libtiff6 (>= 4.5.0)"
  "libyaml-cpp0.7 (>= 0.7.0)"
  "zlib1g (>= 1:1.2.13)")
list(JOIN camera_box_depends ", " camera_box_depends)
list(JOIN tools_depends ", " tools_depends)

set(CPACK_DEBIAN_CAMERA_BOX_PACKAGE_NAME tbm-camera-box)
set(CPACK_DEBIAN_CAMERA_BOX_PACKAGE_SECTION misc)
set(CPACK_DEBIAN_CAMERA_BOX_PACKAGE_DEPENDS "${camera_box_depends}")
# The names of the serial ports; the time of day.
set(CPACK_DEBIAN_CAMERA_BOX_PACKAGE_RECOMMENDS "udev, systemd-timesyncd | time-daemon")
set(CPACK_DEBIAN_CAMERA_BOX_PACKAGE_CONTROL_EXTRA
  ${package_dir}/control/conffiles ${package_dir}/control/postinst
  ${package_dir}/control/postrm ${package_dir}/control/prerm)
set(CPACK_COMPONENT_CAMERA_BOX_DESCRIPTION
"pose of the front shield of a tunnel boring machine
Grabs the images of a GigE Vision camera that looks at the LED target on the
front shield, reads two inclinometers, and publishes on DDS where the front
shield is, with sigma, bound and reason. Runs as a watched systemd service.")

set(CPACK_DEBIAN_TOOLS_PACKAGE_NAME tbm-tools)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SECTION misc)
set(CPACK_DEBIAN_TOOLS_PACKAGE_DEPENDS "${tools_depends}")
set(CPACK_DEBIAN_TOOLS_PACKAGE_SUGGESTS "gnuplot-nox")
set(CPACK_COMPONENT_TOOLS_DESCRIPTION
"guidance of a tunnel boring machine, and the surveyor's tools
guidance and total_station say on DDS where both shields are against the
design axis, and keep a journal; rail_line follows a trolley on its rails and
makes the line of them; hmi_bridge is the operator's console for
browsers; tbm solves recorded runs, checks against a
total station, shows the live system and works on journals; the simulators
stand in for camera, inclinometers and total station.")

include(CPack)
