# The few rules by which every target of the house is built.

add_library(tbm_options INTERFACE)
target_include_directories(tbm_options INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_options(tbm_options INTERFACE
  -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror)
# clang counts int to size_t as a conversion, GCC does not.
target_compile_options(tbm_options INTERFACE $<$<CXX_COMPILER_ID:Clang>:-Wno-sign-conversion>)
# GCC 12 sees overlapping copies inside std::string where there are none (GCC bug 105651).
target_compile_options(tbm_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
# Fused multiply-add changes the last bit from machine to machine; a recording must replay bit for bit.
target_compile_options(tbm_options INTERFACE -ffp-contract=off)
if(TBM_SANITIZE)
  target_compile_options(tbm_options INTERFACE -fsanitize=${TBM_SANITIZE} -fno-omit-frame-pointer)
  if(TBM_SANITIZE MATCHES "undefined")
    # What the address sanitizer sees anyway, at half of the compiler's time; vptr wants Fast DDS' own types.
    target_compile_options(tbm_options INTERFACE -fno-sanitize=null,object-size,pointer-overflow,vptr)
  endif()
  target_link_options(tbm_options INTERFACE -fsanitize=${TBM_SANITIZE})
endif()
# Aravis asks for it; what is precompiled must have been asked the same.
target_compile_options(tbm_options INTERFACE -pthread)

# A test spends its time in what it tests; its own code compiles faster with less optimisation
# (at which GCC 12 sees copies beyond the end of a std::string where there are none).
set(tbm_test_optimisation -O1
    $<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds> $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overflow>)
# The fuzzer follows what the product does, not what a test does.
if(TBM_SANITIZE MATCHES "address")
  set(tbm_test_optimisation -O0 $<$<CXX_COMPILER_ID:Clang>:-fno-sanitize=fuzzer-no-link>)
endif()

# The edges (command lines, files, DDS, the console) wait for people, disks and networks: what they
# gain from -O3 nobody sees, and what they cost the compiler everybody waits for. A folder of them sets
# TBM_EDGE in its CMakeLists.txt. The camera box is slow enough for its edges to count.
if(TBM_SANITIZE)
  set(tbm_edge_optimisation -O0)
elseif(NOT CMAKE_CROSSCOMPILING)
  set(tbm_edge_optimisation ${tbm_test_optimisation} $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
endif()

# What computes once a day, because a person asks (calibrations, set-ups, studies), is a folder that sets
# TBM_RARE: one of its files takes the compiler two minutes at -O3 and ten seconds at -O1.

# What nearly every file includes, compiled once for each tree: a third less time for a test or an edge.
# What computes gets it in the instrumented trees only; in the others an include that it lacks is noticed.
set(tbm_common_headers
  <algorithm> <array> <atomic> <chrono> <cmath> <cstdint> <filesystem> <functional> <map> <memory> <mutex>
  <optional> <span> <string> <string_view> <thread> <vector> <Eigen/Core> <Eigen/Geometry> <Eigen/LU>)
function(tbm_precompile name)
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/${name}.cc CONTENT "// holds ${name}\n")
  add_library(${name} OBJECT ${CMAKE_BINARY_DIR}/${name}.cc)
  target_link_libraries(${name} PRIVATE tbm_options Eigen3::Eigen)
  target_precompile_headers(${name} PRIVATE ${tbm_common_headers} ${ARGN})
endfunction()
# Where the compiler refuses to take it for another set of flags, it says so and the build fails.
function(tbm_use_precompiled target name)
  if(NOT TARGET ${name})
    return()
  endif()
  target_precompile_headers(${target} REUSE_FROM ${name})
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
endfunction()

function(tbm_optimise target)
  if(TBM_EDGE)
    target_compile_options(${target} PRIVATE ${tbm_edge_optimisation})
    tbm_use_precompiled(${target} tbm_precompiled_for_edges)
    target_link_libraries(${target} PRIVATE fmt::fmt)
  elseif(TBM_SANITIZE)
    tbm_use_precompiled(${target} tbm_precompiled)
  elseif(TBM_RARE)
    target_compile_options(${target} PRIVATE ${tbm_edge_optimisation})
  endif()
endfunction()

# Edges, and in trees that nobody edits in all libraries, are compiled in groups of files: what they
# all include is read once. What computes is taken file by file in the optimised tree, which notices an
# include that is lacking. A library whose files use one name for different things is ALONE everywhere.
function(tbm_group target is_alone)
  if((TBM_SANITIZE MATCHES "address" OR CMAKE_CROSSCOMPILING OR TBM_EDGE) AND NOT is_alone)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 6)
    # A group is a file for GCC, and what is local to one of its members is then local to an include.
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  endif()
endfunction()

# Tests that also run under the sanitizers carry the label asan or tsan and are built by one target.
add_custom_target(sanitized_tests)

# tbm_library(pose_geometry [ALONE] SOURCES a.cc DEPS Eigen3::Eigen)   makes the static library tbm_pose_geometry
function(tbm_library name)
  cmake_parse_arguments(ARG "ALONE" "" "SOURCES;DEPS" ${ARGN})
  add_library(tbm_${name} STATIC ${ARG_SOURCES})
  target_link_libraries(tbm_${name} PUBLIC tbm_options ${ARG_DEPS})
  tbm_optimise(tbm_${name})
  tbm_group(tbm_${name} ${ARG_ALONE})
endfunction()

# tbm_program(camera_box SOURCES main.cc DEPS ...)   makes the executable of that name in <build>/bin
function(tbm_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE tbm_options ${ARG_DEPS})
  tbm_optimise(${name})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
endfunction()

# tbm_test(pose/geometry/tilt LABELS fast DEPS tbm_pose_geometry [TIMEOUT s] [SOURCES extra.cc] [UNSANITIZED cases])
# builds tests/pose/geometry/tilt_test.cc. Labels: fast dds device slow root; serial (not beside
# others); asan, tsan (also in that sanitizer's tree). Tests labelled fast run under asan as well, but
# for UNSANITIZED cases: those that draw the same thing thousands of times, and touch no other memory then.
function(tbm_test path)
  cmake_parse_arguments(ARG "" "TIMEOUT" "LABELS;DEPS;SOURCES;UNSANITIZED" ${ARGN})
  string(REPLACE "/" "_" target "${path}_test")
  add_executable(${target} ${PROJECT_SOURCE_DIR}/tests/${path}_test.cc ${ARG_SOURCES})
  target_link_libraries(${target} PRIVATE tbm_options ${ARG_DEPS} GTest::gmock GTest::gtest_main)
  target_compile_definitions(${target} PRIVATE TBM_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_compile_options(${target} PRIVATE ${tbm_test_optimisation})
  tbm_use_precompiled(${target} tbm_precompiled_for_tests)
  set(cases)
  if(TBM_SANITIZE AND ARG_UNSANITIZED)
    list(JOIN ARG_UNSANITIZED ":" cases)
    set(cases --gtest_filter=-${cases})
  endif()
  add_test(NAME ${path} COMMAND ${target} ${cases})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  if("fast" IN_LIST ARG_LABELS)
    list(APPEND ARG_LABELS asan)
  endif()
  if(("asan" IN_LIST ARG_LABELS AND TBM_SANITIZE MATCHES "address") OR
     ("tsan" IN_LIST ARG_LABELS AND TBM_SANITIZE MATCHES "thread"))
    add_dependencies(sanitized_tests ${target})
  endif()
  set_tests_properties(${path} PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT ${ARG_TIMEOUT})
endfunction()

option(TBM_FUZZ "build the fuzz targets (clang with libFuzzer)" OFF)
add_custom_target(fuzz_targets)
if(TBM_FUZZ)
  target_compile_options(tbm_options INTERFACE -fsanitize=fuzzer-no-link -fno-sanitize-recover=undefined)
endif()

# tbm_fuzz(csv DEPS tbm_devices_replay)   builds tests/fuzz/csv_fuzz.cc in the asan tree; nothing elsewhere.
function(tbm_fuzz name)
  if(NOT TBM_FUZZ)
    return()
  endif()
  cmake_parse_arguments(ARG "" "" "DEPS" ${ARGN})
  add_executable(${name}_fuzz ${PROJECT_SOURCE_DIR}/tests/fuzz/${name}_fuzz.cc)
  target_link_libraries(${name}_fuzz PRIVATE tbm_options ${ARG_DEPS})
  tbm_use_precompiled(${name}_fuzz tbm_precompiled)
  target_link_options(${name}_fuzz PRIVATE -fsanitize=fuzzer,address,undefined)
  set_target_properties(${name}_fuzz PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
  add_dependencies(fuzz_targets ${name}_fuzz)
endfunction()

# tbm_bench(solve DEPS ...)   builds tests/bench/solve_bench.cc into <build>/bin/bench.
add_custom_target(benchmarks)
function(tbm_bench name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS" ${ARGN})
  add_executable(${name}_bench ${PROJECT_SOURCE_DIR}/tests/bench/${name}_bench.cc ${ARG_SOURCES})
  target_link_libraries(${name}_bench PRIVATE tbm_options ${ARG_DEPS})
  target_compile_definitions(${name}_bench PRIVATE TBM_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  set_target_properties(${name}_bench PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin/bench)
  add_dependencies(benchmarks ${name}_bench)
endfunction()
