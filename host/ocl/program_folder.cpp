// SPDX-License-Identifier: Apache-2.0
#include "host/ocl/program_folder.h"

#include <dlfcn.h>

#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "egosgm/error.h"
#include "host/json_text.h"
#include "host/ocl/strings.h"

namespace egosgm::ocl {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kManifest = "manifest.json";
constexpr int kFormat = 1;
constexpr const char* kRemedy =
    "; compile them again: egosgm compile --device NAME --out DIR, with the options of the run";

/// The properties of a device that binaries depend on.
std::vector<std::pair<std::string, std::string>> identity(const cl::Device& device) {
  const cl::Platform platform(device.getInfo<CL_DEVICE_PLATFORM>());
  return {{"device", trimmed(device.getInfo<CL_DEVICE_NAME>())},
          {"device_version", trimmed(device.getInfo<CL_DEVICE_VERSION>())},
          {"driver", trimmed(device.getInfo<CL_DRIVER_VERSION>())},
          {"platform", trimmed(platform.getInfo<CL_PLATFORM_NAME>())},
          {"platform_version", trimmed(platform.getInfo<CL_PLATFORM_VERSION>())}};
}

// CL_DEVICE_IL_VERSION and its call, which the headers have from OpenCL 2.1 on only; the extension's name for it.
constexpr cl_device_info kIlVersion = 0x105b;
using CreateWithIl = cl_program(CL_API_CALL*)(cl_context, const void*, size_t, cl_int*);

bool takes_spirv(const cl::Device& device) {
  std::size_t bytes = 0;
  if (::clGetDeviceInfo(device(), kIlVersion, 0, nullptr, &bytes) != CL_SUCCESS || bytes == 0) return false;
  std::string versions(bytes, '\0');
  return ::clGetDeviceInfo(device(), kIlVersion, bytes, versions.data(), nullptr) == CL_SUCCESS &&
         versions.find("SPIR-V") != std::string::npos;
}

cl::Program program_of_spirv(const cl::Context& context, const cl::Device& device,
                             const std::vector<unsigned char>& module) {
  const cl::Platform platform(device.getInfo<CL_DEVICE_PLATFORM>());
  void* call = ::clGetExtensionFunctionAddressForPlatform(platform(), "clCreateProgramWithILKHR");
  if (!call) call = ::clGetExtensionFunctionAddressForPlatform(platform(), "clCreateProgramWithIL");
  if (!call) call = ::dlsym(RTLD_DEFAULT, "clCreateProgramWithIL");  // of the loader, since OpenCL 2.1
  if (!call) throw DeviceError(CL_INVALID_OPERATION, "programs: the driver has no clCreateProgramWithIL");
  cl_int status = CL_SUCCESS;
  cl_program program = reinterpret_cast<CreateWithIl>(call)(context(), module.data(), module.size(), &status);
  if (status != CL_SUCCESS) throw cl::Error(status, "clCreateProgramWithIL");
  return cl::Program(program);
}

std::string file_name(const std::string& kernel_file, const std::string& options, const char* ending) {
  return kernel_file.substr(0, kernel_file.rfind('.')) + "-" + hash_of(options) + ending;
}

Json entry_of(const std::string& kernel_file, const std::string& options, const std::string& text,
              const ProgramFile& file) {
  return {{"kernel", kernel_file},
          {"options", options},
          {"source_hash", hash_of(text)},
          {"file", file.name},
          {"binary_hash", hash_of(file.bytes)}};
}

std::string read(const std::filesystem::path& file) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(file, none)) {  // a pipe would be waited for
    throw InvalidArgument(file.string() + ": is no file that can be read" + kRemedy);
  }
  std::ifstream stream(file, std::ios::binary);
  std::string bytes;
  for (std::istreambuf_iterator<char> next(stream), end; next != end; ++next) {
    if (bytes.size() == kMaxJsonBytes) throw InvalidArgument(file.string() + ": is longer than 256 MiB" + kRemedy);
    bytes += *next;
  }
  if (!stream.good() && !stream.eof()) throw InvalidArgument(file.string() + ": cannot be read" + kRemedy);
  return bytes;
}

Json read_manifest(const std::filesystem::path& file) {
  Json manifest = parse_json(read(file), file);
  if (manifest.is_discarded() || !manifest.is_object()) {
    throw InvalidArgument(file.string() + ": is no manifest of programs" + kRemedy);
  }
  if (manifest.value("format", 0) != kFormat) {
    throw InvalidArgument(file.string() + ": has another format than this version's " + std::to_string(kFormat) +
                          kRemedy);
  }
  return manifest;
}

std::vector<unsigned char> binary_of(const cl::Program& program) {
  const auto binaries = program.getInfo<CL_PROGRAM_BINARIES>();
  if (binaries.empty() || binaries.front().empty()) {
    throw DeviceError(CL_INVALID_BINARY, "compile: the driver gives no program binaries: use it without --programs");
  }
  return binaries.front();
}

}  // namespace

std::string hash_of(std::string_view bytes) {
  std::uint64_t hash = 14695981039346656037u;
  for (const unsigned char byte : bytes) hash = (hash ^ byte) * 1099511628211u;
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

ProgramFolder::ProgramFolder(const std::filesystem::path& folder, const cl::Device& device) : folder_(folder) {
  const std::filesystem::path file = folder / kManifest;
  try {
    const Json manifest = read_manifest(file);
    is_spirv_ = manifest.contains("spirv");
    if (is_spirv_ && !takes_spirv(device)) {
      throw InvalidArgument(file.string() + ": holds SPIR-V, which " + trimmed(device.getInfo<CL_DEVICE_NAME>()) +
                            " does not take" + kRemedy);
    }
    for (const auto& [name, value] : identity(device)) {
      if (is_spirv_ || manifest.at(name) == value) continue;
      throw InvalidArgument(file.string() + ": made for " + name + " \"" + manifest.at(name).get<std::string>() +
                            "\", here it is \"" + value + '"' + kRemedy);
    }
    for (const Json& program : manifest.at("programs")) {
      entries_[{program.at("kernel").get<std::string>(), program.at("options").get<std::string>()}] = {
          program.at("file"), program.at("source_hash"), program.at("binary_hash")};
    }
  } catch (const Json::exception& error) {
    throw InvalidArgument(file.string() + ": is no manifest of programs: " + error.what() + kRemedy);
  }
}

std::vector<unsigned char> ProgramFolder::binary(const ProgramSource& source) const {
  const std::string manifest = (folder_ / kManifest).string();
  const std::string options = is_spirv_ ? portable(source).options : source.options;
  const auto found = entries_.find({source.kernel_file, options});
  if (found == entries_.end()) {
    throw InvalidArgument(manifest + ": has no " + source.kernel_file + " built with " + options + kRemedy);
  }
  const Entry& entry = found->second;
  if (entry.source_hash != hash_of(source.text)) {
    throw InvalidArgument(manifest + ": its " + source.kernel_file +
                          " was compiled from another version of the source than this program's" + kRemedy);
  }
  const std::filesystem::path file = folder_ / entry.file;
  const std::string bytes = read(file);
  if (entry.binary_hash != hash_of(bytes)) {
    throw InvalidArgument(file.string() + ": is not the file that its manifest speaks of" + kRemedy);
  }
  return {bytes.begin(), bytes.end()};
}

cl::Program ProgramFolder::program(const cl::Context& context, const cl::Device& device,
                                   const ProgramSource& source) const {
  if (is_spirv_) return program_of_spirv(context, device, binary(source));
  return {context, {device}, {binary(source)}};
}

ProgramText portable(const ProgramSource& source) {
  std::string defines = source.options.substr(source.device_options.size());
  const std::string of_this_machine = " -DCOUNTS_BITS=1";
  if (const auto at = defines.find(of_this_machine); at != std::string::npos) defines.erase(at, of_this_machine.size());
  return {source.kernel_file, source.text, defines};
}

std::vector<ProgramFile> files_of(const cl::Device& device,
                                  const std::vector<std::pair<ProgramSource, cl::Program>>& programs) {
  Json manifest{{"format", kFormat}};
  for (const auto& [name, value] : identity(device)) manifest[name] = value;
  manifest["programs"] = Json::array();
  std::vector<ProgramFile> files;
  for (const auto& [source, program] : programs) {
    const std::vector<unsigned char> binary = binary_of(program);
    files.push_back({file_name(source.kernel_file, source.options, ".bin"), {binary.begin(), binary.end()}});
    manifest["programs"].push_back(entry_of(source.kernel_file, source.options, source.text, files.back()));
  }
  files.push_back({kManifest, manifest.dump(2) + '\n'});
  return files;
}

}  // namespace egosgm::ocl

namespace egosgm {

std::vector<ProgramFile> spirv_programs(const std::vector<ProgramText>& programs,
                                        const std::vector<std::string>& modules) {
  if (programs.size() != modules.size()) {
    throw InvalidArgument("spirv_programs: " + std::to_string(programs.size()) + " programs and " +
                          std::to_string(modules.size()) + " modules: give one for each");
  }
  ocl::Json manifest{{"format", ocl::kFormat}, {"spirv", "1.0"}, {"programs", ocl::Json::array()}};
  std::vector<ProgramFile> files;
  for (std::size_t i = 0; i < programs.size(); ++i) {
    const auto& [kernel_file, text, options] = programs[i];
    files.push_back({ocl::file_name(kernel_file, options, ".spv"), modules[i]});
    manifest["programs"].push_back(ocl::entry_of(kernel_file, options, text, files.back()));
  }
  files.push_back({ocl::kManifest, manifest.dump(2) + '\n'});
  return files;
}

}  // namespace egosgm
