// SPDX-License-Identifier: Apache-2.0
#include "vision/file_io.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <ctime>
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
  std::error_code none;
  if (error == ENOENT && std::filesystem::is_symlink(file, none)) {
    throw InvalidArgument(file.string() + ": is a link to what is not there; give an existing, readable file");
  }
  if (error == ENOENT || error == ENOTDIR) throw MissingPath(file.string(), what);
  throw InvalidArgument(file.string() + ": " + what);
}

[[noreturn]] void fail_writing(const std::filesystem::path& file, int error) {
  const char* remedy = error == ENOENT ? "; its folder is not there: make it, or choose another"
                                       : "; free some space or choose a folder that can be written";
  throw IoError(file.string() + ": cannot be written: " + reason(error) + remedy);
}

/// For what a pipe without its other end would be waited for without an end: whether to try again.
class Patience {
 public:
  bool goes_on() {
    constexpr timespec kPause{.tv_sec = 0, .tv_nsec = 10'000'000};
    ::nanosleep(&kPause, nullptr);
    return ++tries_ < 500;
  }

 private:
  int tries_ = 0;
};

Descriptor open_for_reading(const std::filesystem::path& file) {
  Descriptor descriptor(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));  // a pipe may have no writer yet
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
  Patience patience;
  bool has_writer = false;
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
    bytes.resize(begin + static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
    if (got < 0 && errno == EAGAIN) {  // a pipe's writer is there: from here on reads wait
      has_writer = true;
      ::fcntl(descriptor.get(), F_SETFL, 0);
    } else if (got < 0) {
      fail_reading(file, errno);
    } else if (got == 0 && S_ISFIFO(status.st_mode) && !has_writer && bytes.empty()) {
      if (!patience.goes_on()) throw InvalidArgument(file.string() + ": is a pipe that nobody writes to; give a file");
    } else if (got == 0) {
      break;
    }
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

namespace fs = std::filesystem;

fs::path folder_of(const fs::path& file) { return file.has_parent_path() ? file.parent_path() : fs::path("."); }

fs::path hidden_name(const fs::path& file) {
  static std::atomic<unsigned> counter{0};
  return folder_of(file) / (".egosgm-" + std::to_string(::getpid()) + "-" + std::to_string(counter++) + ".part");
}

/// N where `path` is /dev/fd/N or the like; -1 elsewhere.
int descriptor_named(const fs::path& path) {
  const std::string name = path.filename().string();
  if (name.empty() || name.size() > 9 || name.find_first_not_of("0123456789") != std::string::npos) return -1;
  std::error_code none;  // no /proc, no such folder
  const fs::path open_ones = fs::canonical("/proc/self/fd", none);
  return !none && fs::canonical(folder_of(path), none) == open_ones && !none ? std::stoi(name) : -1;
}

thread_local const BeforeWrite* before_write = nullptr;
thread_local bool keeps_files = false;

[[noreturn]] void fail_keeping(const fs::path& file) {
  throw IoError(file.string() + ": has come there meanwhile, and stays: give another name");
}

/// Gives a file its name in one step. 0 or errno.
int give_name(const fs::path& from, const fs::path& to) {
  if (!keeps_files) return ::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
  if (::link(from.c_str(), to.c_str()) == 0) return ::unlink(from.c_str()) == 0 ? 0 : errno;
  struct stat status {};
  if (::lstat(to.c_str(), &status) == 0) fail_keeping(to);
  return ::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;  // a file system without links
}

/// The target of a write to a file.
struct Target {
  fs::path file;  // links are followed, those to nothing too
  bool exists = false;
  struct stat status {};
  int descriptor = -1;  // of this process, where it names one

  bool is_stream() const { return descriptor >= 0 || (exists && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode)); }
};

Target target_of(const fs::path& file) {
  constexpr int kMostLinks = 40;
  if (!file.has_filename()) fail_writing(file, EISDIR);
  Target target;
  target.file = file;
  target.exists = ::stat(file.c_str(), &target.status) == 0;
  if (!target.exists && errno != ENOENT) fail_writing(file, errno);
  for (int links = 0; (target.descriptor = descriptor_named(target.file)) < 0; ++links) {
    struct stat status {};
    if (::lstat(target.file.c_str(), &status) != 0 || !S_ISLNK(status.st_mode)) break;
    if (links == kMostLinks) fail_writing(file, ELOOP);
    std::error_code error;
    target.file = folder_of(target.file) / fs::read_symlink(target.file, error);
    if (error) fail_writing(file, error.value());
  }
  if (target.is_stream() || !target.exists) return target;
  if (S_ISDIR(target.status.st_mode)) fail_writing(file, EISDIR);
  // A new file in its place needs no right to write to it: what is protected stays.
  if (::access(target.file.c_str(), W_OK) != 0) fail_writing(file, errno);
  return target;
}

void write_through(const Target& target, const fs::path& file, std::string_view bytes) {
  if (target.exists && S_ISBLK(target.status.st_mode)) {
    throw IoError(file.string() + ": is a disk: choose the name of a file");
  }
  const auto open = [&] {
    return target.descriptor >= 0 ? ::fcntl(target.descriptor, F_DUPFD_CLOEXEC, 0)
                                  : ::open(file.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK);
  };
  Descriptor descriptor(open());
  const auto has_no_reader = [&] { return !descriptor.is_open() && errno == ENXIO && S_ISFIFO(target.status.st_mode); };
  for (Patience patience; has_no_reader();) {
    if (!patience.goes_on()) throw IoError(file.string() + ": is a pipe that nobody reads; give a file");
    descriptor = Descriptor(open());
  }
  if (!descriptor.is_open()) fail_writing(file, errno);
  if (target.descriptor < 0) ::fcntl(descriptor.get(), F_SETFL, 0);  // writes wait for room
  int error = write_all(descriptor, bytes);
  if (descriptor.close() != 0 && error == 0) error = errno;
  if (error != 0) fail_writing(file, error);
}

/// The bytes of a file before it has its name. Without a name (where the file system can do that) nothing of it remains
/// when the process dies.
class Unfinished {
 public:
  explicit Unfinished(const Target& target) : target_(target) {
#ifdef O_TMPFILE
    descriptor_ = Descriptor(::open(folder_of(target.file).c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666));
    // Without /proc an unnamed file cannot get a name.
    if (descriptor_.is_open() && ::access(link_of(descriptor_).c_str(), F_OK) == 0) return;
#endif
    open_hidden();
  }
  ~Unfinished() {
    if (!hidden_.empty()) ::unlink(hidden_.c_str());
  }
  Unfinished(const Unfinished&) = delete;
  Unfinished& operator=(const Unfinished&) = delete;

  void write(std::string_view bytes) {
    if (const int error = write_all(descriptor_, bytes); error != 0) fail_writing(target_.file, error);
  }

  /// Takes the target's place in one step, with the mode of what was there.
  void take_name() {
    take_mode(target_, descriptor_.get());
    for (int tries = 0; hidden_.empty(); ++tries) {
      const fs::path name = hidden_name(target_.file);
      if (::linkat(AT_FDCWD, link_of(descriptor_).c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0) {
        hidden_ = name;
      } else if (errno != EEXIST || tries == kMostTries) {
        fail_writing(target_.file, errno);
      }
    }
    if (descriptor_.close() != 0) fail_writing(target_.file, errno);
    if (const int error = give_name(hidden_, target_.file); error != 0) fail_writing(target_.file, error);
    hidden_.clear();
  }

  static void take_mode(const Target& target, int descriptor) {
    if (!target.exists) return;
    const struct stat& old = target.status;
    const bool same_owner = ::fchown(descriptor, old.st_uid, old.st_gid) == 0;
    ::fchmod(descriptor, old.st_mode & (same_owner ? 07777 : 0777));
  }

 private:
  static constexpr int kMostTries = 1000;  // a killed process with this one's number may have left files behind

  static std::string link_of(const Descriptor& descriptor) {
    return "/proc/self/fd/" + std::to_string(descriptor.get());
  }

  void open_hidden() {
    for (int i = 0; i < kMostTries; ++i) {
      const fs::path name = hidden_name(target_.file);
      descriptor_ = Descriptor(::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
      if (descriptor_.is_open()) {
        hidden_ = name;
        return;
      }
      if (errno != EEXIST) break;
    }
    fail_writing(target_.file, errno);
  }

  const Target& target_;
  Descriptor descriptor_{-1};
  fs::path hidden_;  // its name until it is whole, where it has one
};

}  // namespace

KeepFiles::KeepFiles() : outer_(std::exchange(keeps_files, true)) {}
KeepFiles::~KeepFiles() { keeps_files = outer_; }

BeforeWrite::BeforeWrite(Function before) : before_(std::move(before)), outer_(before_write) { before_write = this; }
BeforeWrite::~BeforeWrite() { before_write = outer_; }

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

bool is_stream(const std::filesystem::path& file) { return target_of(file).is_stream(); }

void write_file(const std::filesystem::path& file, std::string_view bytes) {
  if (before_write && !before_write->before_(file, bytes)) return;
  const Target target = target_of(file);
  if (target.is_stream()) return write_through(target, file, bytes);
  Unfinished unfinished(target);
  unfinished.write(bytes);
  unfinished.take_name();
}

void expect_writable(const std::filesystem::path& file) {
  const Target target = target_of(file);
  if (!target.is_stream()) {
    const Unfinished unfinished(target);
  } else if (target.descriptor < 0 && ::access(file.c_str(), W_OK) != 0) {
    fail_writing(file, errno);
  }
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
