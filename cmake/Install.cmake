# SPDX-License-Identifier: Apache-2.0
# What `cmake --install` puts beside the libraries and the program: headers, find_package's files, pkg-config's files.
include(CMakePackageConfigHelpers)
set(egosgm_cmake_folder ${CMAKE_INSTALL_LIBDIR}/cmake/egosgm)

install(DIRECTORY include/egosgm DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT libegosgm-dev
        FILES_MATCHING PATTERN "*.h" PATTERN vision EXCLUDE)
if(EGOSGM_VISION)
  install(DIRECTORY include/egosgm/vision DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/egosgm COMPONENT libegosgm-dev)
endif()

configure_package_config_file(cmake/egosgm-config.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/egosgm-config.cmake
                              INSTALL_DESTINATION ${egosgm_cmake_folder} NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/egosgm-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/egosgm-config.cmake ${CMAKE_CURRENT_BINARY_DIR}/egosgm-config-version.cmake
        DESTINATION ${egosgm_cmake_folder} COMPONENT libegosgm-dev)

# The prefix is where the file lies, so that a tree can be moved.
file(RELATIVE_PATH EGOSGM_PC_PREFIX ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX})
foreach(module IN ITEMS egosgm egosgm-vision)
  if(module STREQUAL egosgm OR EGOSGM_VISION)
    configure_file(cmake/${module}.pc.in ${CMAKE_CURRENT_BINARY_DIR}/${module}.pc @ONLY)
    install(FILES ${CMAKE_CURRENT_BINARY_DIR}/${module}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT libegosgm-dev)
  endif()
endforeach()
