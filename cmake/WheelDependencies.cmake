# SPDX-License-Identifier: Apache-2.0
# Where scripts/build-wheel put static libraries, for find_package: CMAKE_PROJECT_INCLUDE of its build. Debian's libraries of headers alone
# lie in /usr/include, which must come after the compiler's own headers.
list(APPEND CMAKE_C_IMPLICIT_INCLUDE_DIRECTORIES /usr/include)
list(APPEND CMAKE_CXX_IMPLICIT_INCLUDE_DIRECTORIES /usr/include)
set(fmt_DIR /usr/lib/${CMAKE_HOST_SYSTEM_PROCESSOR}-linux-gnu/cmake/fmt)
add_compile_options(-isystem ${EGOSGM_WHEEL_PREFIX}/include -idirafter /usr/include -ffunction-sections -fdata-sections)
add_link_options(LINKER:--gc-sections)
set(CMAKE_CXX_STANDARD_LIBRARIES "-ldl -lpthread")

set(third_party ${EGOSGM_WHEEL_PREFIX}/lib/opencv4/3rdparty)
set(OpenCV_DIR ${EGOSGM_WHEEL_PREFIX}/lib/cmake/opencv4)
set(OpenCL_INCLUDE_DIR ${EGOSGM_WHEEL_PREFIX}/include)
set(OpenCL_LIBRARY ${EGOSGM_WHEEL_PREFIX}/lib/libOpenCL.a)
set(ZLIB_INCLUDE_DIR ${EGOSGM_WHEEL_PREFIX}/include)
set(ZLIB_LIBRARY ${third_party}/libzlib.a)
set(PNG_PNG_INCLUDE_DIR ${EGOSGM_WHEEL_PREFIX}/include)
set(PNG_LIBRARY ${third_party}/liblibpng.a)
set(JPEG_INCLUDE_DIR ${EGOSGM_WHEEL_PREFIX}/include)
set(JPEG_LIBRARY ${third_party}/liblibjpeg-turbo.a)
set(ISAL_INCLUDE_DIR /usr/include)
set(ISAL_LIBRARY ${EGOSGM_WHEEL_PREFIX}/lib/libisal.so)  # which auditwheel takes along
link_directories(${EGOSGM_WHEEL_PREFIX}/lib)
set(EGOSGM_FMT fmt::fmt-header-only)
