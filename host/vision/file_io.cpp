// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/file_io.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "egosgm/error.h"

namespace egosgm::vision {
namespace {

std::string reason(int error) { return std::generic_category().message(error); }

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  int get() const { return fd_; }
  bool is_open() const { return fd_ >= 0; }
  // Some file systems report a full disk or quota only here.
  int close() { return ::close(std::exchange(fd_, -1)); }

 private:
  int fd_;
};

[[noreturn]] void fail_reading(const std::filesystem::path& file, int error) {
  const std::string what = "cannot be read: " + reason(error) + "; give an existing, readable file";
  if (error == ENOENT || error == ENOTDIR) throw MissingPath(file.string(), what);
  throw InvalidArgument(file.string() + ": " + what);
}

[[noreturn]] void fail_writing(const std::filesystem::path& file, int error) {
  throw IoError(file.string() + ": cannot be written: " + reason(error) +
                "; free some space or choose a folder that can be written");
}

Descriptor open_for_reading(const std::filesystem::path& file) {
  Descriptor descriptor(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  if (!descriptor.is_open()) fail_reading(file, errno);
  struct stat status {};
  if (::fstat(descriptor.get(), &status) != 0) fail_reading(file, errno);
  if (S_ISDIR(status.st_mode)) fail_reading(file, EISDIR);
  if (!S_ISREG(status.st_mode) && !S_ISFIFO(status.st_mode)) {
    throw InvalidArgument(file.string() + ": is a device or a socket; give a file");
  }
  return descriptor;
}

/// Reads until the end or until `max_bytes` are there. The file may grow or shrink meanwhile.
std::string read_up_to(const Descriptor& descriptor, const std::filesystem::path& file, std::size_t max_bytes) {
  constexpr std::size_t kBlockBytes = std::size_t{1} << 20;
  struct stat status {};
  std::string bytes;
  if (::fstat(descriptor.get(), &status) == 0 && status.st_size > 0) {
    bytes.reserve(std::min(max_bytes, static_cast<std::size_t>(status.st_size)));
  }
  while (bytes.size() < max_bytes) {
    const std::size_t begin = bytes.size();
    const std::size_t room = std::max(bytes.capacity() - begin, std::size_t{4096});
    const std::size_t wanted = std::min({kBlockBytes, room, max_bytes - begin});
    bytes.resize(begin + wanted);
    ssize_t got = 0;
    do {
      got = ::read(descriptor.get(), bytes.data() + begin, wanted);
    } while (got < 0 && errno == EINTR);
    if (got < 0) fail_reading(file, errno);
    bytes.resize(begin + static_cast<std::size_t>(got));
    if (got == 0) break;
  }
  return bytes;
}

/// 0 or errno.
int write_all(const Descriptor& descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor.get(), bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    if (written == 0) return ENOSPC;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return 0;
}

std::filesystem::path folder_of(const std::filesystem::path& file) {
  return file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
}

std::filesystem::path hidden_name(const std::filesystem::path& file) {
  static std::atomic<unsigned> counter{0};
  return folder_of(file) / (".egosgm-" + std::to_string(::getpid()) + "-" + std::to_string(counter++) + ".part");
}

/// A file without a name: nothing of it remains when the process dies. Not open where the file system has no such
/// thing.
Descriptor open_unnamed([[maybe_unused]] const std::filesystem::path& file) {
#ifdef O_TMPFILE
  return Descriptor(::open(folder_of(file).c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666));
#else
  return Descriptor(-1);
#endif
}

int give_name(const Descriptor& unnamed, const std::filesystem::path& name) {
  const std::string link = "/proc/self/fd/" + std::to_string(unnamed.get());
  return ::linkat(AT_FDCWD, link.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0 ? 0 : errno;
}

int rename_or_remove(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (::rename(from.c_str(), to.c_str()) == 0) return 0;
  const int error = errno;
  ::unlink(from.c_str());
  return error;
}

void write_named(const std::filesystem::path& file, std::string_view bytes) {
  // A killed process with this one's number may have left a file behind.
  constexpr int kMostTries = 1000;
  std::filesystem::path hidden;
  Descriptor descriptor(-1);
  for (int i = 0; i < kMostTries && !descriptor.is_open(); ++i) {
    hidden = hidden_name(file);
    descriptor = Descriptor(::open(hidden.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
    if (!descriptor.is_open() && errno != EEXIST) break;
  }
  if (!descriptor.is_open()) fail_writing(file, errno);
  int error = write_all(descriptor, bytes);
  if (descriptor.close() != 0 && error == 0) error = errno;
  if (error != 0) {
    ::unlink(hidden.c_str());
    fail_writing(file, error);
  }
  if ((error = rename_or_remove(hidden, file)) != 0) fail_writing(file, error);
}

}  // namespace

std::string read_file(const std::filesystem::path& file, std::size_t max_bytes) {
  std::string bytes = read_up_to(open_for_reading(file), file, max_bytes + 1);
  if (bytes.size() > max_bytes) {
    throw InvalidArgument(file.string() + ": is larger than " + std::to_string(max_bytes) +
                          " bytes, the most that is read; is it the right file?");
  }
  return bytes;
}

std::string read_file_start(const std::filesystem::path& file, std::size_t bytes) {
  return read_up_to(open_for_reading(file), file, bytes);
}

void write_file(const std::filesystem::path& file, std::string_view bytes) {
  if (!file.has_filename()) fail_writing(file, EISDIR);
  Descriptor unnamed = open_unnamed(file);
  if (!unnamed.is_open()) return write_named(file, bytes);
  if (const int error = write_all(unnamed, bytes); error != 0) fail_writing(file, error);
  const std::filesystem::path hidden = hidden_name(file);
  // Without /proc an unnamed file cannot get a name.
  if (give_name(unnamed, hidden) != 0) return write_named(file, bytes);
  if (unnamed.close() != 0) {
    const int error = errno;
    ::unlink(hidden.c_str());
    fail_writing(file, error);
  }
  if (const int error = rename_or_remove(hidden, file); error != 0) fail_writing(file, error);
}

void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!error && !std::filesystem::is_directory(folder, error) && !error) {
    error = std::make_error_code(std::errc::not_a_directory);
  }
  if (error) {
    throw IoError(folder.string() + ": the folder cannot be made: " + reason(error.value()) +
                  "; choose one that can be written");
  }
}

}  // namespace egosgm::vision
