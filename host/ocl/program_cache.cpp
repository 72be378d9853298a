// SPDX-License-Identifier: Apache-2.0
#include "host/ocl/program_cache.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "host/ocl/strings.h"

namespace egosgm::ocl {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMagic = "EgoSGM program 3";
constexpr std::size_t kDigits = 16;  // of a file's name, before its end, which no file of others has
constexpr std::string_view kEnd = ".egosgm";

/// Platforms whose drivers keep what they compiled on the disk: a second copy would bring nothing.
bool keeps_programs(const std::string& platform) {
  static const std::set<std::string> keeping = {
      "Portable Computing Language",  // PoCL: POCL_CACHE_DIR
      "NVIDIA CUDA",                  // CUDA_CACHE_PATH
      "Intel(R) OpenCL Graphics",     // NEO: NEO_CACHE_DIR
      "Intel(R) OpenCL HD Graphics",  // its earlier name
      "rusticl",
      "Clover",  // Mesa: MESA_SHADER_CACHE_DIR
  };
  return keeping.contains(platform);
}

/// A part of a text of many, told apart from its neighbours.
std::string part(std::string_view text) { return std::to_string(text.size()) + ':' + std::string(text); }

/// Intel's variables for the CPU it compiles for and how.
std::string compiler_variables() {
  std::set<std::string> all;
  for (char** variable = environ; *variable; ++variable) {
    if (std::string_view(*variable).starts_with("CL_CONFIG_")) all.insert(*variable);
  }
  std::string text;
  for (const std::string& variable : all) text += part(variable);
  return text;
}

std::string identity_of(const cl::Device& device) {
  const cl::Platform platform(device.getInfo<CL_DEVICE_PLATFORM>());
  std::string text = part(EGOSGM_VERSION);
  for (const std::string& name :
       {device.getInfo<CL_DEVICE_NAME>(), device.getInfo<CL_DEVICE_VERSION>(), device.getInfo<CL_DRIVER_VERSION>(),
        platform.getInfo<CL_PLATFORM_NAME>(), platform.getInfo<CL_PLATFORM_VERSION>()}) {
    text += part(trimmed(name));
  }
  return text + part(compiler_variables());
}

/// A file that is open.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int operator*() const { return number_; }

 private:
  int number_;
};

/// All of a regular file that is this user's or root's and no longer than `max_bytes`; else nothing.
std::string read(const fs::path& path, std::uintmax_t max_bytes) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  struct stat status;
  if (*file < 0 || ::fstat(*file, &status) != 0 || !S_ISREG(status.st_mode)) return {};
  if (status.st_uid != ::geteuid() && status.st_uid != 0) return {};
  if (static_cast<std::uintmax_t>(status.st_size) > max_bytes) return {};
  std::string bytes(static_cast<std::size_t>(status.st_size), '\0');
  for (std::size_t at = 0; at < bytes.size();) {
    const ssize_t taken = ::read(*file, bytes.data() + at, bytes.size() - at);
    if (taken <= 0) return {};
    at += static_cast<std::size_t>(taken);
  }
  ::futimens(*file, nullptr);  // it was used now
  return bytes;
}

/// Under its name whole or not at all.
void write(const fs::path& path, std::string_view bytes) {
  std::string name = path.string() + ".XXXXXX";
  const Descriptor file(::mkostemp(name.data(), O_CLOEXEC));
  if (*file < 0) return;
  while (!bytes.empty()) {
    const ssize_t given = ::write(*file, bytes.data(), bytes.size());
    if (given <= 0) break;
    bytes.remove_prefix(static_cast<std::size_t>(given));
  }
  if (!bytes.empty() || ::rename(name.c_str(), path.c_str()) != 0) ::unlink(name.c_str());
}

bool is_ours(const std::string& name) {
  return name.find_first_not_of("0123456789abcdef") == kDigits &&
         std::string_view(name).substr(kDigits).starts_with(kEnd);
}

/// The header of a binary: its key, and how to tell that it is whole.
std::string header(std::string_view key, std::string_view binary) {
  return std::string(kMagic) + std::string(key) + hash_of(binary);
}

std::string binary_of(const cl::Program& program) {
  const auto binaries = program.getInfo<CL_PROGRAM_BINARIES>();
  return binaries.empty() ? std::string() : std::string(binaries.front().begin(), binaries.front().end());
}

}  // namespace

std::optional<ProgramCache> ProgramCache::of(const cl::Device& device, const std::string& wanted) {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return fs::path(value ? value : "");
  };
  const fs::path given = wanted.empty() ? variable("EGOSGM_CACHE") : fs::path(wanted);
  const fs::path xdg = variable("XDG_CACHE_HOME"), home = variable("HOME");
  if (given == "off") return std::nullopt;
  if (!given.empty()) return ProgramCache(given, device);
  const cl::Platform platform(device.getInfo<CL_DEVICE_PLATFORM>());
  if (keeps_programs(trimmed(platform.getInfo<CL_PLATFORM_NAME>()))) return std::nullopt;
  if (xdg.is_absolute()) return ProgramCache(xdg / "egosgm", device);
  if (home.is_absolute()) return ProgramCache(home / ".cache/egosgm", device);
  return std::nullopt;
}

ProgramCache::ProgramCache(fs::path folder, const cl::Device& device, std::uintmax_t max_bytes)
    : folder_(std::move(folder)), identity_(identity_of(device)), max_bytes_(max_bytes) {}

fs::path ProgramCache::file_of(const ProgramSource& source) const {
  return folder_ / hash_of(identity_ + part(source.options) + part(source.text)).append(kEnd);
}

cl::Program ProgramCache::built(const cl::Context& context, const cl::Device& device,
                                const ProgramSource& source) const {
  const fs::path path = file_of(source);
  const std::string bytes = read(path, max_bytes_);
  const std::string_view binary = std::string_view(bytes).substr(std::min(bytes.size(), kMagic.size() + 2 * kDigits));
  if (binary.empty() || !bytes.starts_with(header(path.stem().string(), binary))) return {};
  try {
    const cl::Program program(context, {device}, {std::vector<unsigned char>(binary.begin(), binary.end())});
    const cl_int status = ::clBuildProgram(program(), 1, &device(), source.options.c_str(), nullptr, nullptr);
    return status == CL_SUCCESS ? program : cl::Program();
  } catch (const cl::Error&) {
    return {};
  }
}

void ProgramCache::keep(const ProgramSource& source, const cl::Program& program) const {
  std::string binary;
  try {
    binary = binary_of(program);
  } catch (const cl::Error&) {
  }
  if (binary.empty()) return;
  const fs::path path = file_of(source);
  std::error_code none;
  if (folder_.has_parent_path()) fs::create_directories(folder_.parent_path(), none);
  ::mkdir(folder_.c_str(), 0700);
  write(path, header(path.stem().string(), binary) + binary);
  make_room();
}

void ProgramCache::make_room() const {
  struct File {
    fs::file_time_type used;
    fs::path path;
    std::uintmax_t bytes;
  };
  std::vector<File> files;
  std::uintmax_t bytes = 0;
  std::error_code error;
  for (fs::directory_iterator next(folder_, error), end; !error && next != end; next.increment(error)) {
    std::error_code none;  // another process may have removed it
    if (!is_ours(next->path().filename()) || !next->is_regular_file(none)) continue;
    const File file{next->last_write_time(none), next->path(), next->file_size(none)};
    if (none) continue;
    files.push_back(file);
    bytes += file.bytes;
  }
  std::sort(files.begin(), files.end(), [](const File& a, const File& b) { return a.used < b.used; });
  for (const File& file : files) {
    if (bytes <= max_bytes_) return;
    fs::remove(file.path, error);
    bytes -= file.bytes;
  }
}

}  // namespace egosgm::ocl
