// SPDX-License-Identifier: Apache-2.0
#include "host/ocl/signature.h"

#include <cxxabi.h>

#include <cstdlib>
#include <memory>
#include <stdexcept>

namespace egosgm::ocl {
namespace {

// Drivers end their strings with a zero, and some append to a type's name.
std::string plain(const std::string& text) { return text.substr(0, text.find_first_of(std::string("\0;", 2))); }

// Drivers may spell a scalar their own way; only what they surely mean otherwise is an error.
bool is_known(std::string type) {
  if (type.starts_with("const ")) type.erase(0, 6);
  if (type.ends_with('*')) type.pop_back();
  if (type.starts_with('u')) type.erase(0, 1);
  return type == "char" || type == "short" || type == "int" || type == "long" || type == "float" ||
         (!type.empty() && type.front() >= 'A' && type.front() <= 'Z');
}

bool has_source(const cl::Kernel& kernel) {
  return !plain(kernel.getInfo<CL_KERNEL_PROGRAM>().getInfo<CL_PROGRAM_SOURCE>()).empty();
}

}  // namespace

std::string struct_name(const std::type_info& type) {
  int status = 0;
  const std::unique_ptr<char, void (*)(void*)> text(abi::__cxa_demangle(type.name(), nullptr, nullptr, &status),
                                                    std::free);
  const std::string name = text ? text.get() : type.name();
  return name.substr(name.rfind(':') + 1);
}

std::string integer_name(std::size_t bytes, bool is_unsigned) {
  const std::string name = bytes == 1 ? "char" : bytes == 2 ? "short" : bytes == 4 ? "int" : "long";
  return is_unsigned ? 'u' + name : name;
}

std::vector<std::string> compiled_signature(const cl::Kernel& kernel) {
  std::vector<std::string> types;
  for (cl_uint i = 0; i < kernel.getInfo<CL_KERNEL_NUM_ARGS>(); ++i) {
    try {
      const std::string type = plain(kernel.getArgInfo<CL_KERNEL_ARG_TYPE_NAME>(i));
      const bool is_const = kernel.getArgInfo<CL_KERNEL_ARG_TYPE_QUALIFIER>(i) & CL_KERNEL_ARG_TYPE_CONST;
      types.push_back((is_const && type.ends_with('*') ? "const " : "") + type);
    } catch (const cl::Error& error) {
      if (error.err() == CL_KERNEL_ARG_INFO_NOT_AVAILABLE) return {};
      throw;
    }
  }
  return types;
}

void expect_signature(const cl::Kernel& kernel, const std::vector<std::string>& declared) {
  const std::vector<std::string> compiled = compiled_signature(kernel);
  const std::string name = plain(kernel.getInfo<CL_KERNEL_FUNCTION_NAME>());
  if (compiled.empty()) return;
  if (compiled.size() != declared.size()) {
    throw std::logic_error("kernel " + name + " has " + std::to_string(compiled.size()) + " parameters, declared are " +
                           std::to_string(declared.size()));
  }
  // Drivers tell a SPIR-V kernel's types without `const` and sign, and by what is read through a pointer. That it
  // belongs to its source says the manifest.
  if (!has_source(kernel)) return;
  for (std::size_t i = 0; i < compiled.size(); ++i) {
    if (compiled[i] == declared[i] || !is_known(compiled[i])) continue;
    throw std::logic_error("kernel " + name + ": parameter " + std::to_string(i) + " is " + compiled[i] +
                           ", declared is " + declared[i]);
  }
}

}  // namespace egosgm::ocl
