# SPDX-License-Identifier: Apache-2.0
# `cpack -G DEB` in a build of the preset "packages" (scripts/build-packages): libegosgm, libegosgm-dev, egosgm, python3-egosgm.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME egosgm)
set(CPACK_PACKAGE_VENDOR "The EgoSGM authors")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL libegosgm libegosgm-dev)
if(EGOSGM_VISION)
  list(APPEND CPACK_COMPONENTS_ALL egosgm)
endif()
if(EGOSGM_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python3-egosgm)
endif()

foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE RENAME copyright DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${component}
          COMPONENT ${component})
endforeach()

set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_MAINTAINER "The EgoSGM authors <egosgm@example.invalid>")
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY "=")
# Where dpkg-shlibdeps finds the libraries that are not installed yet.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR}/host ${PROJECT_BINARY_DIR}/vision)

set(same_version "libegosgm (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_LIBEGOSGM_PACKAGE_NAME libegosgm)
set(CPACK_DEBIAN_LIBEGOSGM_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBEGOSGM_PACKAGE_RECOMMENDS "pocl-opencl-icd | opencl-icd")  # without any device nothing runs
set(CPACK_COMPONENT_LIBEGOSGM_DESCRIPTION "Shared libraries.")

set(CPACK_DEBIAN_LIBEGOSGM-DEV_PACKAGE_NAME libegosgm-dev)
set(CPACK_DEBIAN_LIBEGOSGM-DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_LIBEGOSGM-DEV_PACKAGE_DEPENDS
    "${same_version}, libeigen3-dev, libpng-dev, libjpeg-dev, libisal-dev, ocl-icd-opencl-dev, opencl-headers")
set(CPACK_COMPONENT_LIBEGOSGM-DEV_DESCRIPTION "Headers, static libraries, and files for CMake and pkg-config.")

set(CPACK_DEBIAN_EGOSGM_PACKAGE_NAME egosgm)
set(CPACK_DEBIAN_EGOSGM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_EGOSGM_PACKAGE_DEPENDS "${same_version}")
set(CPACK_DEBIAN_EGOSGM_PACKAGE_SUGGESTS python3-egosgm)  # has the tools that are written in Python
set(CPACK_COMPONENT_EGOSGM_DESCRIPTION "The command-line program.")

set(CPACK_DEBIAN_PYTHON3-EGOSGM_PACKAGE_NAME python3-egosgm)
set(CPACK_DEBIAN_PYTHON3-EGOSGM_PACKAGE_SECTION python)
math(EXPR next_python "0${Python_VERSION_MINOR} + 1")
set(CPACK_DEBIAN_PYTHON3-EGOSGM_PACKAGE_DEPENDS
    "${same_version}, python3 (>= 3.${Python_VERSION_MINOR}), python3 (<< 3.${next_python}), python3-numpy, python3-yaml")
set(CPACK_DEBIAN_PYTHON3-EGOSGM_PACKAGE_RECOMMENDS "python3-matplotlib, python3-opencv")  # of the tools
set(CPACK_DEBIAN_PYTHON3-EGOSGM_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/cmake/python3-egosgm/prerm)
set(CPACK_DEBIAN_PYTHON3-EGOSGM_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_COMPONENT_PYTHON3-EGOSGM_DESCRIPTION "The Python module.")
include(CPack)
