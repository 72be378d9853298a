# SPDX-License-Identifier: Apache-2.0
# Where scripts/build-wheel put libraries, for find_package: CMAKE_PROJECT_INCLUDE of its build. Debian's libraries of headers alone lie in
# /usr/include, which must come after the compiler's own headers.
list(APPEND CMAKE_C_IMPLICIT_INCLUDE_DIRECTORIES /usr/include)
list(APPEND CMAKE_CXX_IMPLICIT_INCLUDE_DIRECTORIES /usr/include)
set(fmt_DIR /usr/lib/${CMAKE_HOST_SYSTEM_PROCESSOR}-linux-gnu/cmake/fmt)
add_compile_options(-isystem ${EGOSGM_WHEEL_PREFIX}/include -idirafter /usr/include -ffunction-sections -fdata-sections)
add_link_options(LINKER:--gc-sections)
set(CMAKE_BUILD_WITH_INSTALL_RPATH ON)  # a path of this machine may have a comma, at which the compiler would part it
set(CMAKE_CXX_STANDARD_LIBRARIES "-ldl -lpthread")

foreach(library ZLIB:libz.a PNG:libpng16.a JPEG:libjpeg.a ISAL:libisal.so OpenCL:libOpenCL.so.1)
  string(REPLACE : ";" parts ${library})
  list(GET parts 0 name)
  list(GET parts 1 file)
  set(${name}_INCLUDE_DIR ${EGOSGM_WHEEL_PREFIX}/include)
  set(${name}_LIBRARY ${EGOSGM_WHEEL_PREFIX}/lib/${file})
endforeach()
set(PNG_PNG_INCLUDE_DIR ${EGOSGM_WHEEL_PREFIX}/include)
link_directories(${EGOSGM_WHEEL_PREFIX}/lib)
set(EGOSGM_FMT fmt::fmt-header-only)
