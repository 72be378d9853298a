# SPDX-License-Identifier: Apache-2.0
# egosgm_libraries(NAME COMPONENT EXPORTED PUBLIC ... PRIVATE ...)
# Makes NAME_static and NAME_shared of the objects of NAME_objects, and installs both for find_package's COMPONENT as egosgm::EXPORTED.
# Only the static one gives access to what is hidden, such as the stages: tests and bench link NAME, which is the static one. All else
# links egosgm::EXPORTED, which is the one that BUILD_SHARED_LIBS chooses. In an item, LINKAGE stands for `static` or `shared`.
include(GNUInstallDirs)

function(egosgm_libraries name component exported)
  cmake_parse_arguments(PARSE_ARGV 3 library "" "" "PUBLIC;PRIVATE")
  foreach(linkage IN ITEMS static shared)
    set(target ${name}_${linkage})
    string(TOUPPER ${linkage} type)
    add_library(${target} ${type} $<TARGET_OBJECTS:${name}_objects>)
    set_target_properties(${target} PROPERTIES
      OUTPUT_NAME ${name} EXPORT_NAME ${exported} LINKER_LANGUAGE CXX
      # Before 1.0 a minor version may change the interface.
      VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
    target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include>
                                                $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
    target_compile_features(${target} PUBLIC cxx_std_17)  # of the headers
    list(TRANSFORM library_PUBLIC REPLACE LINKAGE ${linkage} OUTPUT_VARIABLE public)
    target_link_libraries(${target} PUBLIC ${public} PRIVATE ${library_PRIVATE})
    if(linkage STREQUAL shared AND NOT CMAKE_CXX_FLAGS MATCHES "-fsanitize")
      target_link_options(${target} PRIVATE LINKER:--no-undefined)
    endif()
    set_target_properties(${target} PROPERTIES INSTALL_RPATH $ORIGIN)
    if(PROJECT_IS_TOP_LEVEL)
      install(TARGETS ${target} EXPORT egosgm-${component}-${linkage}
              LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT libegosgm NAMELINK_COMPONENT libegosgm-dev
              ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT libegosgm-dev)
      install(EXPORT egosgm-${component}-${linkage} NAMESPACE egosgm:: COMPONENT libegosgm-dev
              DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/egosgm)
    else()
      set_target_properties(${target} PROPERTIES EXCLUDE_FROM_ALL ON)
    endif()
  endforeach()
  add_library(${name} ALIAS ${name}_static)
  if(BUILD_SHARED_LIBS)
    add_library(egosgm::${exported} ALIAS ${name}_shared)
  else()
    add_library(egosgm::${exported} ALIAS ${name}_static)
  endif()
endfunction()
