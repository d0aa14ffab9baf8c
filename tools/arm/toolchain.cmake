# The camera box: ARM Cortex-A8 (ARMv7-A, NEON, hard float), Debian 12 armhf. Sysroot: tools/arm/sysroot.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR armv7l)
set(CMAKE_SYSROOT ${CMAKE_CURRENT_LIST_DIR}/../../build/arm/sysroot)
cmake_path(NORMAL_PATH CMAKE_SYSROOT)
set(CMAKE_LIBRARY_ARCHITECTURE arm-linux-gnueabihf)

set(CMAKE_C_COMPILER arm-linux-gnueabihf-gcc)
set(CMAKE_CXX_COMPILER arm-linux-gnueabihf-g++)
# Files beyond 2 GB need to be asked for on 32 bit.
set(cpu "-mcpu=cortex-a8 -mfpu=neon -mfloat-abi=hard -D_FILE_OFFSET_BITS=64")
set(CMAKE_C_FLAGS_INIT "${cpu}")
# psabi: GCC tells at every call that passing std::pair<double, double> changed in GCC 10; all here is of one compiler.
# maybe-uninitialized: seen in Eigen's vectors of bounded length on this target only; the PC's build has it on.
set(CMAKE_CXX_FLAGS_INIT "${cpu} -Wno-psabi -Wno-maybe-uninitialized")

# Generators (java, python3) are the PC's own; everything that is compiled against or linked is the box's.
set(CMAKE_FIND_ROOT_PATH ${CMAKE_SYSROOT})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${CMAKE_SYSROOT})
set(ENV{PKG_CONFIG_LIBDIR}
    ${CMAKE_SYSROOT}/usr/lib/arm-linux-gnueabihf/pkgconfig:${CMAKE_SYSROOT}/usr/share/pkgconfig)

# What a build step or a test runs of the box's programs runs on this processor and no better one.
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-arm -cpu cortex-a8 -L ${CMAKE_SYSROOT})
