// SPDX-License-Identifier: Apache-2.0
// An OpenCL layer that writes launches as cases which stand alone: source, options, arguments, buffers before,
// checksums of those that are written. OPENCL_LAYERS loads it; egosgm_cases_into says where to, and when.
#define CL_TARGET_OPENCL_VERSION 300
#include <CL/cl.h>
#include <CL/cl_icd.h>
#include <CL/cl_layer.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "host/ocl/sha256.h"

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using Bytes = std::vector<unsigned char>;

const cl_icd_dispatch* next = nullptr;
cl_icd_dispatch layer{};
fs::path into;       // empty: nothing is written
std::string prefix;  // of the cases' names

struct Argument {
  size_t bytes = 0;
  Bytes value;  // empty: local memory
};
std::map<cl_kernel, std::map<cl_uint, Argument>> arguments;

cl_int CL_API_CALL set_argument(cl_kernel kernel, cl_uint index, size_t size, const void* value) {
  const auto* bytes = static_cast<const unsigned char*>(value);
  arguments[kernel][index] = {size, bytes ? Bytes(bytes, bytes + size) : Bytes()};
  return next->clSetKernelArg(kernel, index, size, value);
}

/// Asks for a text by a call with (bytes, where to, where to write how many are needed).
template <typename Call>
std::string text_of(Call&& call) {
  size_t size = 0;
  call(0, nullptr, &size);
  std::string text(size, '\0');
  call(size, text.data(), nullptr);
  while (!text.empty() && text.back() == '\0') text.pop_back();
  return text;
}

Bytes read(cl_command_queue queue, cl_mem buffer) {
  size_t size = 0;
  next->clGetMemObjectInfo(buffer, CL_MEM_SIZE, sizeof size, &size, nullptr);
  Bytes bytes(size);
  if (next->clEnqueueReadBuffer(queue, buffer, CL_TRUE, 0, size, bytes.data(), 0, nullptr, nullptr) != CL_SUCCESS)
    throw std::runtime_error("cases: a buffer cannot be read");
  return bytes;
}

std::string_view view(const Bytes& bytes) { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }

void write(const fs::path& file, std::string_view bytes) {
  std::ofstream stream(file, std::ios::binary);
  stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!stream.flush()) throw std::runtime_error("cases: " + file.string() + " cannot be written");
}

std::string hex(const Bytes& bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (const unsigned char byte : bytes) text += {kDigits[byte >> 4], kDigits[byte & 15]};
  return text;
}

/// A case while it is made: what comes before the launch, and what after.
class Case {
 public:
  Case(const fs::path& folder, cl_command_queue queue, cl_kernel kernel) : folder_(folder), queue_(queue) {
    cl_program program = nullptr;
    cl_device_id device = nullptr;
    next->clGetKernelInfo(kernel, CL_KERNEL_PROGRAM, sizeof program, &program, nullptr);
    next->clGetCommandQueueInfo(queue, CL_QUEUE_DEVICE, sizeof device, &device, nullptr);
    const std::string source = text_of([&](auto... a) { next->clGetProgramInfo(program, CL_PROGRAM_SOURCE, a...); });
    json_["kernel"] = text_of([&](auto... a) { next->clGetKernelInfo(kernel, CL_KERNEL_FUNCTION_NAME, a...); });
    json_["options"] =
        text_of([&](auto... a) { next->clGetProgramBuildInfo(program, device, CL_PROGRAM_BUILD_OPTIONS, a...); });
    json_["source"] = "kernel.cl";
    fs::create_directories(folder_);
    write(folder_ / "kernel.cl", source);
    for (const auto& [index, argument] : arguments[kernel]) add(kernel, index, argument);
  }

  void set_range(const char* name, cl_uint dimensions, const size_t* sizes) {
    json_[name] = sizes ? Json(std::vector<size_t>(sizes, sizes + dimensions)) : Json();
  }

  /// After the launch.
  void finish() {
    for (const auto& [name, buffer] : buffers_) {
      if (!json_["buffers"][name]["is_result"]) continue;
      json_["buffers"][name]["sha256"] = egosgm::ocl::hex(egosgm::ocl::sha256(view(read(queue_, buffer))));
    }
    write(folder_ / "case.json", json_.dump(2) + "\n");
  }

 private:
  void add(cl_kernel kernel, cl_uint index, const Argument& argument) {
    const auto text = [&](cl_kernel_arg_info what) {
      return text_of([&](auto... a) { next->clGetKernelArgInfo(kernel, index, what, a...); });
    };
    Json json{{"name", text(CL_KERNEL_ARG_NAME)}, {"type", text(CL_KERNEL_ARG_TYPE_NAME)}};
    cl_kernel_arg_address_qualifier place = 0;
    cl_kernel_arg_type_qualifier kind = 0;
    next->clGetKernelArgInfo(kernel, index, CL_KERNEL_ARG_ADDRESS_QUALIFIER, sizeof place, &place, nullptr);
    next->clGetKernelArgInfo(kernel, index, CL_KERNEL_ARG_TYPE_QUALIFIER, sizeof kind, &kind, nullptr);
    if (argument.value.empty()) {
      json["local_bytes"] = argument.bytes;
    } else if (place == CL_KERNEL_ARG_ADDRESS_PRIVATE) {
      json["value"] = hex(argument.value);
    } else {
      cl_mem buffer = nullptr;
      std::copy(argument.value.begin(), argument.value.end(), reinterpret_cast<unsigned char*>(&buffer));
      json["buffer"] = name_of(buffer, json["name"], !(kind & CL_KERNEL_ARG_TYPE_CONST));
    }
    json_["arguments"].push_back(json);
  }

  /// Two arguments may be one buffer.
  std::string name_of(cl_mem buffer, const std::string& argument, bool is_result) {
    const auto found =
        std::find_if(buffers_.begin(), buffers_.end(), [&](const auto& of) { return of.second == buffer; });
    const std::string name = found == buffers_.end() ? argument : found->first;
    Json& json = json_["buffers"][name];
    if (found == buffers_.end()) {
      const Bytes bytes = read(queue_, buffer);
      write(folder_ / (name + ".bin"), view(bytes));
      buffers_[name] = buffer;
      json = {{"file", name + ".bin"}, {"bytes", bytes.size()}, {"is_result", is_result}};
    }
    if (is_result) json["is_result"] = true;
    return name;
  }

  const fs::path folder_;
  const cl_command_queue queue_;
  std::map<std::string, cl_mem> buffers_;
  Json json_;
};

cl_int CL_API_CALL launch(cl_command_queue queue, cl_kernel kernel, cl_uint dimensions, const size_t* offset,
                          const size_t* global, const size_t* local, cl_uint count, const cl_event* waits,
                          cl_event* done) {
  const auto enqueue = [&] {
    return next->clEnqueueNDRangeKernel(queue, kernel, dimensions, offset, global, local, count, waits, done);
  };
  if (into.empty()) return enqueue();
  const fs::path folder =
      into / (prefix + text_of([&](auto... a) { next->clGetKernelInfo(kernel, CL_KERNEL_FUNCTION_NAME, a...); }));
  if (fs::exists(folder)) return enqueue();  // the first of its kind is the case
  Case written(folder, queue, kernel);
  written.set_range("global", dimensions, global);
  written.set_range("local", dimensions, local);
  const cl_int status = enqueue();
  next->clFinish(queue);
  if (status == CL_SUCCESS) written.finish();
  return status;
}

}  // namespace

/// From now on the first launch of each kernel is written to FOLDER/FRAME.KERNEL.
extern "C" void egosgm_cases_into(const char* folder, const char* frame) {
  into = folder;
  prefix = std::string(frame) + '.';
}

extern "C" cl_int CL_API_CALL clInitLayer(cl_uint, const cl_icd_dispatch* target, cl_uint* count,
                                          const cl_icd_dispatch** out) {
  next = target;
  layer = *target;
  layer.clSetKernelArg = set_argument;
  layer.clEnqueueNDRangeKernel = launch;
  *count = sizeof(layer) / sizeof(void*);
  *out = &layer;
  return CL_SUCCESS;
}
