# SPDX-License-Identifier: Apache-2.0
# Turns kernels/*.cl and *.h into one C++ table, so that the library needs no files at run time.
# cmake -DOUTPUT=kernels.cpp -DINPUTS=a.cl,b.cl -P EmbedKernels.cmake
string(REPLACE "," ";" INPUTS "${INPUTS}")
set(rows "")
foreach(input IN LISTS INPUTS)
  cmake_path(GET input FILENAME name)
  file(READ "${input}" text)
  string(APPEND rows "    {\"${name}\", R\"__KERNEL__(${text})__KERNEL__\"},\n")
endforeach()
file(WRITE "${OUTPUT}" "// Generated from kernels/. Do not edit.
#include \"host/ocl/sources.h\"

namespace egosgm::ocl {
const std::map<std::string_view, std::string_view>& sources() {
  static const std::map<std::string_view, std::string_view> table{
${rows}  };
  return table;
}
}  // namespace egosgm::ocl
")
