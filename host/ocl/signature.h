// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <typeinfo>
#include <vector>

#include "host/ocl/opencl.h"

namespace egosgm::ocl {

template <typename T>
class Buffer;

/// A C++ type's name without its namespaces.
std::string struct_name(const std::type_info& type);

/// OpenCL's name of an integer.
std::string integer_name(std::size_t bytes, bool is_unsigned);

/// A kernel source's type of the parameter that `T` stands for: "uint", "const float*", "ImageSize".
template <typename T>
struct KernelParameter {
  static std::string text() {
    if constexpr (std::is_same_v<T, float>) return "float";
    if constexpr (std::is_integral_v<T>) return integer_name(sizeof(T), std::is_unsigned_v<T>);
    if constexpr (std::is_class_v<T>) return struct_name(typeid(T));
  }
};
template <typename T>
struct KernelParameter<const T> : KernelParameter<T> {};
template <typename T>
struct KernelParameter<Buffer<T>> {
  static std::string text() { return KernelParameter<T>::text() + "*"; }
};
template <typename T>
struct KernelParameter<const Buffer<T>> {
  static std::string text() { return "const " + KernelParameter<T>::text() + "*"; }
};

/// The types that the kernel's compiler saw, written the same way; empty where the driver does not tell.
std::vector<std::string> compiled_signature(const cl::Kernel& kernel);

/// Throws std::logic_error, naming the kernel and the parameter, if its source was not written for the C++ types. An
/// int buffer passed for a float one shows nowhere else.
void expect_signature(const cl::Kernel& kernel, const std::vector<std::string>& declared);

}  // namespace egosgm::ocl
