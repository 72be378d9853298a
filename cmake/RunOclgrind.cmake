# SPDX-License-Identifier: Apache-2.0
# Runs a test program under oclgrind and fails on anything it reports.
# cmake -DOCLGRIND=... -DPROGRAM=... -DFILTER=... -P RunOclgrind.cmake
# - Its exit status is the program's own, and --log is truncated by every new cl_context: only stderr tells.
# - --uninitialized is left out: oclgrind 21.10 does not see clEnqueueFillBuffer as a write.
# - It runs unoptimised code: 21.10 widens a vector of true by its compiler's zext to 255 instead of 1.
execute_process(COMMAND ${OCLGRIND} --build-options -cl-opt-disable --data-races --check-api ${PROGRAM} --gtest_filter=${FILTER} --gtest_brief=1
                RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE report)
if(NOT output MATCHES "\\[  PASSED  \\] [1-9]")
  message(FATAL_ERROR "no test passed\n${output}\n${report}")
endif()
if(NOT status EQUAL 0 OR report MATCHES "data race|Invalid |divergence|OpenCL runtime error|Unaligned")
  message(FATAL_ERROR "${output}\n${report}")
endif()
