# SPDX-License-Identifier: Apache-2.0
# egosgm_discover_suites(TARGET FILTER PROPERTIES...)
# A ctest for each suite of a GoogleTest program, where gtest_discover_tests has one for each test: what takes long to make is made once a
# suite, and starting the program hundreds of times takes longer than most tests. The output names the tests that fail. FILTER: GoogleTest's.
# REQUIRES: none of its tests is ever skipped, since a suite would not say so. This file is also the script that lists the suites after a build.
if(CMAKE_SCRIPT_MODE_FILE STREQUAL CMAKE_CURRENT_LIST_FILE)
  execute_process(COMMAND ${EMULATOR} ${PROGRAM} --gtest_list_tests --gtest_filter=${FILTER} OUTPUT_VARIABLE list RESULT_VARIABLE status)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "${PROGRAM} --gtest_list_tests: ${status}")
  endif()
  string(REGEX MATCHALL "(^|\n)[A-Za-z0-9_/]+\\." suites "${list}")
  set(tests "")
  foreach(suite IN LISTS suites)
    string(STRIP "${suite}" suite)
    string(REGEX REPLACE "\\.$" "" name "${suite}")
    string(APPEND tests "add_test([==[${name}]==] [==[${PROGRAM}]==] [==[--gtest_filter=${name}.*]==])\n")
    if(PROPERTIES)
      string(APPEND tests "set_tests_properties([==[${name}]==] PROPERTIES ${PROPERTIES})\n")
    endif()
  endforeach()
  file(WRITE ${OUTPUT} "${tests}")
  return()
endif()

set(EGOSGM_DISCOVER_SUITES ${CMAKE_CURRENT_LIST_FILE})
function(egosgm_discover_suites target filter)
  set(tests ${CMAKE_CURRENT_BINARY_DIR}/${target}_suites.cmake)
  string(JOIN " " properties ${ARGN})
  add_custom_command(TARGET ${target} POST_BUILD BYPRODUCTS ${tests} VERBATIM
    COMMAND ${CMAKE_COMMAND} "-DEMULATOR=${CMAKE_CROSSCOMPILING_EMULATOR}" -DPROGRAM=$<TARGET_FILE:${target}> -DOUTPUT=${tests} "-DFILTER=${filter}" "-DPROPERTIES=${properties}" -P ${EGOSGM_DISCOVER_SUITES})
  set(include ${CMAKE_CURRENT_BINARY_DIR}/${target}_include.cmake)
  file(WRITE ${include} "if(EXISTS \"${tests}\")\n  include(\"${tests}\")\nelse()\n  add_test(${target}_NOT_BUILT ${target}_NOT_BUILT)\nendif()\n")
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${include})
endfunction()
