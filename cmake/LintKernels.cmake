# SPDX-License-Identifier: Apache-2.0
# A test for every kernel and every set of defines that its file names in a line `// lint: NAME=value ...`: clang must accept it as
# OpenCL C 1.2, all warnings being errors (a variant may leave a parameter unused). Needs no device.
find_program(EGOSGM_CLANG NAMES clang clang-19 clang-18 clang-17 clang-16 clang-15 clang-14)
if(NOT EGOSGM_CLANG)
  egosgm_skipped_tests("no clang: scripts/install-dependencies" kernels.lint)
  return()
endif()

# What host/ocl/context.cpp puts before every kernel.
set(preamble ${CMAKE_CURRENT_BINARY_DIR}/kernel_preamble.h)
file(WRITE ${preamble} "#pragma OPENCL FP_CONTRACT OFF\n")

# A block that SPIR-V has no vector for is refused by name, before a translator ends the process for it.
add_test(NAME kernels.block.refuses_32_lanes_in_spirv
         COMMAND ${EGOSGM_CLANG} -x cl -cl-std=CL1.2 -target spir64-unknown-unknown -Xclang -finclude-default-header -DBLOCK=32
                 -I ${PROJECT_SOURCE_DIR}/kernels -fsyntax-only ${PROJECT_SOURCE_DIR}/kernels/sgm/block.h)
set_tests_properties(kernels.block.refuses_32_lanes_in_spirv PROPERTIES PASS_REGULAR_EXPRESSION "BLOCK: 16")

file(GLOB kernels CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/kernels/*/*.cl)
foreach(kernel IN LISTS kernels)
  cmake_path(GET kernel STEM name)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${kernel})
  file(STRINGS ${kernel} variants REGEX "^// lint: ")
  if(NOT variants)
    set(variants "// lint: EGOSGM_LINT")
  endif()
  foreach(variant IN LISTS variants)
    string(REPLACE "// lint: " "" defines "${variant}")
    string(REGEX MATCHALL "[^ ]+" defines "${defines}")
    list(JOIN defines "," test)
    string(REPLACE "EGOSGM_LINT" "lint" test "kernels.${name}.lint.${test}")
    string(REPLACE "lint.lint" "lint" test "${test}")
    list(TRANSFORM defines PREPEND -D)
    add_test(NAME ${test}
             COMMAND ${EGOSGM_CLANG} -x cl -cl-std=CL1.2 -target spir64-unknown-unknown -Xclang -finclude-default-header
                     -include ${preamble} -I ${PROJECT_SOURCE_DIR}/kernels -I ${PROJECT_SOURCE_DIR}/kernels/sgm -Wall -Wextra -Wno-unused-parameter -Werror ${defines} -fsyntax-only ${kernel})
  endforeach()
endforeach()
