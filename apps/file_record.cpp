// SPDX-License-Identifier: Apache-2.0
#include "apps/file_record.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <isa-l.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <system_error>

#include "host/vision/file_io.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxRecordBytes = std::size_t{1} << 30;
constexpr std::string_view kHeader = "egosgm: what a run has written so far, each with its digest; keep it\n";

[[noreturn]] void refuse_changed(const fs::path& file) {
  throw InvalidArgument(file.string() +
                        ": is not as egosgm wrote it, or not its file at all, and stays: choose another --out");
}

[[noreturn]] void fail(const fs::path& file) {
  throw IoError(file.string() + ": cannot be written: " + std::generic_category().message(errno) +
                "; free some space or choose another --out");
}

/// What the whole lines say. A kill may have cut the last one.
struct Contents {
  std::map<std::string, std::string> files;
  std::string chain;
  std::size_t bytes = 0;
};

std::string line_of(const std::string& chain, const std::string& name, const std::string& digest) {
  return chain + ' ' + digest + ' ' + name + '\n';
}

std::string next_chain(const std::string& chain, const std::string& name, const std::string& digest) {
  return digest_of(line_of(chain, name, digest));
}

Contents contents_of(const fs::path& file) {
  constexpr std::size_t kDigits = 16, kName = 2 * (kDigits + 1);
  const std::string text = vision::read_file(file, kMaxRecordBytes);
  Contents contents;
  if (kHeader.starts_with(text)) return contents;
  if (!text.starts_with(kHeader)) refuse_changed(file);
  contents.bytes = kHeader.size();
  for (std::size_t end; (end = text.find('\n', contents.bytes)) != std::string::npos; contents.bytes = end + 1) {
    const std::string line = text.substr(contents.bytes, end + 1 - contents.bytes);
    if (line.size() <= kName + 1) refuse_changed(file);
    const std::string digest = line.substr(kDigits + 1, kDigits);
    const std::string name = line.substr(kName, line.size() - kName - 1);
    contents.chain = next_chain(contents.chain, name, digest);
    if (line != line_of(contents.chain, name, digest)) refuse_changed(file);
    contents.files[name] = digest;
  }
  return contents;
}

}  // namespace

std::string digest_of(std::string_view bytes) {  // CRC-64/XZ, in a fraction of the time that writing takes
  return fmt::format("{:016x}", crc64_ecma_refl(0, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

LockedFile::LockedFile(const fs::path& file, int flags, int lock)
    : descriptor_(::open(file.c_str(), flags | O_CLOEXEC | O_NOFOLLOW, 0666)) {
  // Where a file system has no locks, there is none.
  if (descriptor_ < 0 || ::flock(descriptor_, lock | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
  ::close(descriptor_);
  throw FolderInUse(fmt::format("--out {}: another egosgm is writing there: wait for its end, or choose another",
                                file.parent_path().string()));
}

LockedFile::~LockedFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::map<std::string, std::string> recorded_files(const fs::path& folder) {
  const fs::path file = folder / kFileRecord;
  std::error_code none;
  const fs::file_status status = fs::symlink_status(file, none);
  if (!fs::exists(status)) return {};
  if (!fs::is_regular_file(status)) refuse_changed(file);
  const LockedFile lock(file, O_RDONLY, LOCK_SH);
  return contents_of(file).files;
}

FileRecord::FileRecord(const fs::path& folder) : file_(folder / kFileRecord) {
  struct stat status {};
  do {  // whoever had the last one may just have removed it
    opened_ = std::make_unique<LockedFile>(file_, O_WRONLY | O_CREAT | O_APPEND, LOCK_EX);
    if (opened_->descriptor() < 0 || ::fstat(opened_->descriptor(), &status) != 0) fail(file_);
  } while (status.st_nlink == 0);
  const Contents contents = contents_of(file_);
  files_ = contents.files;
  chain_ = contents.chain;
  if (::ftruncate(opened_->descriptor(), static_cast<off_t>(contents.bytes)) != 0) fail(file_);
  if (contents.bytes == 0) write(kHeader);
}

void FileRecord::clear() {
  files_.clear();
  chain_.clear();
  if (::ftruncate(opened_->descriptor(), static_cast<off_t>(kHeader.size())) != 0) fail(file_);
}

void FileRecord::add(const std::string& name, const std::string& digest) {
  chain_ = next_chain(chain_, name, digest);
  write(line_of(chain_, name, digest));
  files_[name] = digest;
}

void FileRecord::remove() {
  if (::unlink(file_.c_str()) != 0) fail(file_);
}

void FileRecord::write(std::string_view text) const {
  if (const ssize_t written = ::write(opened_->descriptor(), text.data(), text.size());
      written != static_cast<ssize_t>(text.size())) {
    if (written >= 0) errno = ENOSPC;
    fail(file_);
  }
}

}  // namespace egosgm::app
