// SPDX-License-Identifier: Apache-2.0
#include "host/ocl/program_folder.h"

#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string_view>

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

/// FNV-1a, 64 bits: tells versions of a text apart, and whole files from broken ones. No protection from intent.
std::string hash_of(std::string_view bytes) {
  std::uint64_t hash = 14695981039346656037u;
  for (const unsigned char byte : bytes) hash = (hash ^ byte) * 1099511628211u;
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

/// What binaries depend on.
std::vector<std::pair<std::string, std::string>> identity(const cl::Device& device) {
  const cl::Platform platform(device.getInfo<CL_DEVICE_PLATFORM>());
  return {{"device", trimmed(device.getInfo<CL_DEVICE_NAME>())},
          {"device_version", trimmed(device.getInfo<CL_DEVICE_VERSION>())},
          {"driver", trimmed(device.getInfo<CL_DRIVER_VERSION>())},
          {"platform", trimmed(platform.getInfo<CL_PLATFORM_NAME>())},
          {"platform_version", trimmed(platform.getInfo<CL_PLATFORM_VERSION>())}};
}

std::string read(const std::filesystem::path& file) {
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

ProgramFolder::ProgramFolder(const std::filesystem::path& folder, const cl::Device& device) : folder_(folder) {
  const std::filesystem::path file = folder / kManifest;
  try {
    const Json manifest = read_manifest(file);
    for (const auto& [name, value] : identity(device)) {
      if (manifest.at(name) == value) continue;
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
  const auto found = entries_.find({source.kernel_file, source.options});
  if (found == entries_.end()) {
    throw InvalidArgument(manifest + ": has no " + source.kernel_file + " built with" + source.options + kRemedy);
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

std::vector<ProgramFile> files_of(const cl::Device& device,
                                  const std::vector<std::pair<ProgramSource, cl::Program>>& programs) {
  Json manifest{{"format", kFormat}};
  for (const auto& [name, value] : identity(device)) manifest[name] = value;
  manifest["programs"] = Json::array();
  std::vector<ProgramFile> files;
  for (const auto& [source, program] : programs) {
    const std::vector<unsigned char> binary = binary_of(program);
    const std::string stem = source.kernel_file.substr(0, source.kernel_file.rfind('.'));
    files.push_back({stem + "-" + hash_of(source.options) + ".bin", {binary.begin(), binary.end()}});
    manifest["programs"].push_back({{"kernel", source.kernel_file},
                                    {"options", source.options},
                                    {"source_hash", hash_of(source.text)},
                                    {"file", files.back().name},
                                    {"binary_hash", hash_of(files.back().bytes)}});
  }
  files.push_back({kManifest, manifest.dump(2) + '\n'});
  return files;
}

}  // namespace egosgm::ocl
