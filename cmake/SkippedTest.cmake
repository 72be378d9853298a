# SPDX-License-Identifier: Apache-2.0
# A test that cannot be run here stays in ctest's list, and is reported as skipped.
# egosgm_skipped_tests(REASON NAMES...)
function(egosgm_skipped_tests reason)
  foreach(name IN LISTS ARGN)
    add_test(NAME ${name} COMMAND ${CMAKE_COMMAND} -E echo "skipped: ${reason}")
    set_tests_properties(${name} PROPERTIES SKIP_REGULAR_EXPRESSION "^skipped: ")
  endforeach()
endfunction()
