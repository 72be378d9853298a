// SPDX-License-Identifier: Apache-2.0
#include "vision/file_io.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "tests/support/expect_refused.h"
#include "tests/support/files.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

std::size_t count_entries(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(
      std::distance(std::filesystem::directory_iterator(folder), std::filesystem::directory_iterator()));
}

/// No file may grow beyond `bytes` while this lives: the way a full disk shows.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    handler_ = ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    ::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_{};
  void (*handler_)(int) = SIG_DFL;
};

class FileIo : public ::testing::Test {
 protected:
  const TemporaryFolder folder_;
};

TEST_F(FileIo, WrittenBytesAreReadBack) {
  const std::string bytes("a\0b\nc", 5);
  write_file(folder_ / "file", bytes);
  EXPECT_EQ(read_file(folder_ / "file", 5), bytes);
  EXPECT_EQ(read_file_start(folder_ / "file", 2), bytes.substr(0, 2));
  write_file(folder_ / "file", "");
  EXPECT_EQ(read_file(folder_ / "file", 5), "");
  EXPECT_EQ(count_entries(folder_.path()), 1u);
}

TEST_F(FileIo, WhatHasComeMeanwhileStays) {
  const auto stays = [&](const auto& write) {
    try {
      write();
    } catch (const IoError& error) {
      return std::string(error.what()).find("has come there meanwhile, and stays") != std::string::npos &&
             read_file(folder_ / "file", 9) == "mine";
    }
    return false;
  };
  const KeepFiles others;
  write_file(folder_ / "file", "mine");
  EXPECT_TRUE(stays([&] { write_file(folder_ / "file", "another"); }));
  std::filesystem::create_symlink(folder_ / "nowhere", folder_ / "link");
  write_file(folder_ / "link", "led there");
  EXPECT_EQ(read_file(folder_ / "nowhere", 9), "led there");
  EXPECT_TRUE(stays([&] { write_file(folder_ / "file", "another"); }));
  EXPECT_EQ(count_entries(folder_.path()), 3u);
}

TEST_F(FileIo, NewFilesObeyTheUmask) {
  const mode_t before = ::umask(027);
  write_file(folder_ / "file", "x");
  ::umask(before);
  struct stat status {};
  ASSERT_EQ(::stat((folder_ / "file").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0640u);
}

TEST_F(FileIo, FullDiskLeavesTheOldFileAndNothingElse) {
  write_file(folder_ / "file", "old");
  {
    const FileSizeLimit limit(1000);
    expect_refused<IoError>([&] { write_file(folder_ / "file", std::string(5000, 'x')); },
                            {(folder_ / "file").string(), "cannot be written", "File too large"});
  }
  EXPECT_EQ(read_file(folder_ / "file", 100), "old");
  EXPECT_EQ(count_entries(folder_.path()), 1u);
}

bool has_unnamed_files(const std::filesystem::path& folder) {
#ifdef O_TMPFILE
  const int descriptor = ::open(folder.c_str(), O_TMPFILE | O_WRONLY, 0600);
  if (descriptor >= 0) ::close(descriptor);
  return descriptor >= 0;
#else
  return false;
#endif
}

TEST_F(FileIo, KillWhileWritingLeavesOnlyWholeFiles) {
  const std::string bytes(std::size_t{4} << 20, 'x');
  for (int round = 0; round < 12; ++round) {
    const TemporaryFolder folder;
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      for (int i = 0;; ++i) write_file(folder / ("file" + std::to_string(i % 3)), bytes);
    }
    while (!std::filesystem::exists(folder / "file0")) ::usleep(1000);  // ctest ends it where that never comes
    ::usleep(static_cast<useconds_t>(700 * round));
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    EXPECT_TRUE(std::filesystem::exists(folder / "file0"));
    for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
      const bool hidden = entry.path().filename().string().starts_with('.');
      if (hidden && !has_unnamed_files(folder.path())) continue;
      EXPECT_EQ(entry.file_size(), bytes.size()) << entry.path();
    }
  }
}

TEST_F(FileIo, UnwritablePlacesAreNamedWithTheReason) {
  write_file(folder_ / "file", "old");
  expect_refused<IoError>([&] { write_file(folder_ / "none/file", "x"); }, {"none/file", "No such file or directory"});
  expect_refused<IoError>([&] { write_file(folder_ / "file/x", "x"); }, {"file/x", "Not a directory"});
  expect_refused<IoError>([&] { write_file(folder_.path(), "x"); }, {folder_.path().string(), "directory"});
  expect_refused<IoError>([&] { write_file("", "x"); }, {"cannot be written"});
  expect_refused<IoError>([&] { make_folder(folder_ / "file/sub"); }, {"file/sub", "Not a directory"});
  expect_refused<IoError>([&] { make_folder(folder_ / "file"); }, {"file", "Not a directory"});
  make_folder(folder_ / "a/b/c");
  make_folder(folder_ / "a/b/c");
  EXPECT_TRUE(std::filesystem::is_directory(folder_ / "a/b/c"));
}

TEST_F(FileIo, TheModeOfAnOldFileStaysAndWhatIsProtectedIsNotReplaced) {
  write_file(folder_ / "file", "old");
  ASSERT_EQ(::chmod((folder_ / "file").c_str(), 0600), 0);
  write_file(folder_ / "file", "new");
  struct stat status {};
  ASSERT_EQ(::stat((folder_ / "file").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 07777, 0600u);
  EXPECT_EQ(read_file(folder_ / "file", 10), "new");
  if (::geteuid() == 0) return;  // who may write to all files
  ASSERT_EQ(::chmod((folder_ / "file").c_str(), 0400), 0);
  expect_refused<IoError>([&] { write_file(folder_ / "file", "newer"); }, {"file", "Permission denied"});
  EXPECT_EQ(read_file(folder_ / "file", 10), "new");
}

TEST_F(FileIo, LinksAreFollowedAndHardLinksAreCut) {
  make_folder(folder_ / "elsewhere");
  write_file(folder_ / "elsewhere/file", "old");
  std::filesystem::create_hard_link(folder_ / "elsewhere/file", folder_ / "second_name");
  std::filesystem::create_symlink("elsewhere/file", folder_ / "link");
  std::filesystem::create_symlink("link", folder_ / "link_to_link");
  write_file(folder_ / "link_to_link", "new");
  EXPECT_TRUE(std::filesystem::is_symlink(folder_ / "link_to_link"));
  EXPECT_TRUE(std::filesystem::is_symlink(folder_ / "link"));
  EXPECT_EQ(read_file(folder_ / "elsewhere/file", 10), "new");
  EXPECT_EQ(read_file(folder_ / "second_name", 10), "old");
  std::filesystem::create_symlink("elsewhere/none", folder_ / "to_nothing");
  write_file(folder_ / "to_nothing", "made");
  EXPECT_EQ(read_file(folder_ / "elsewhere/none", 10), "made");
  std::filesystem::create_symlink("loop", folder_ / "loop");
  expect_refused<IoError>([&] { write_file(folder_ / "loop", "x"); }, {"loop", "symbolic links"});
}

TEST_F(FileIo, PipesAndDescriptorsAreWrittenThrough) {
  const std::filesystem::path pipe = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const int reading = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK);
  ASSERT_GE(reading, 0);
  EXPECT_TRUE(is_stream(pipe));
  write_file(pipe, "through");
  char bytes[16] = {};
  EXPECT_EQ(::read(reading, bytes, sizeof bytes), 7);
  ::close(reading);
  EXPECT_TRUE(std::filesystem::is_fifo(pipe));

  const int open_file = ::open((folder_ / "open").c_str(), O_WRONLY | O_CREAT, 0600);
  ASSERT_GE(open_file, 0);
  ASSERT_EQ(::write(open_file, "before ", 7), 7);
  const std::string name = "/dev/fd/" + std::to_string(open_file);
  EXPECT_TRUE(is_stream(name));
  write_file(name, "after");
  ::close(open_file);
  EXPECT_EQ(read_file(folder_ / "open", 20), "before after");
  EXPECT_FALSE(is_stream(folder_ / "open"));
  EXPECT_FALSE(is_stream(folder_ / "none"));
}

TEST_F(FileIo, APipeWithoutItsOtherEndIsNotWaitedForWithoutEnd) {
  const std::filesystem::path pipe = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  expect_refused([&] { read_file(pipe, 100); }, {"pipe", "nobody writes to"});
  expect_refused<IoError>([&] { write_file(pipe, "x"); }, {"pipe", "nobody reads"});
}

TEST_F(FileIo, APipeThatIsWrittenLateAndInPiecesIsReadWhole) {
  const std::filesystem::path pipe = folder_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const std::string piece(100000, 'x');  // more than a pipe holds
  const auto pause = [] { std::this_thread::sleep_for(std::chrono::milliseconds(100)); };
  std::thread writer([&] {
    pause();
    const int writing = ::open(pipe.c_str(), O_WRONLY);
    pause();
    for (int i = 0; i < 2; ++i, pause()) {
      for (std::string_view rest = piece; !rest.empty();) {
        const ssize_t written = ::write(writing, rest.data(), rest.size());
        if (written <= 0) break;
        rest.remove_prefix(static_cast<std::size_t>(written));
      }
    }
    ::close(writing);
  });
  EXPECT_EQ(read_file(pipe, 1000000), piece + piece);
  writer.join();
}

TEST_F(FileIo, TellsOfAFileBeforeItIsThere) {
  std::string told;
  {
    const BeforeWrite outer([&](const auto&, std::string_view bytes) {
      told += "outer ";
      return bytes != "no";
    });
    {
      const BeforeWrite inner([&](const std::filesystem::path& file, std::string_view bytes) {
        told += file.filename().string() + "=" + std::string(bytes) + (std::filesystem::exists(file) ? " late " : " ");
        return true;
      });
      write_file(folder_ / "a", "1");
    }
    write_file(folder_ / "b", "2");
    write_file(folder_ / "e", "no");
    const BeforeWrite none([](const auto&, std::string_view) -> bool { throw IoError("no record"); });
    expect_refused<IoError>([&] { write_file(folder_ / "c", "3"); }, {"no record"});
  }
  write_file(folder_ / "d", "4");
  EXPECT_EQ(told, "a=1 outer outer ");
  EXPECT_TRUE(std::filesystem::exists(folder_ / "b"));
  for (const char* name : {"c", "e"}) EXPECT_FALSE(std::filesystem::exists(folder_ / name)) << name;
}

TEST_F(FileIo, LooksWithoutATrace) {
  expect_writable(folder_ / "none");
  expect_refused<IoError>([&] { expect_writable(folder_ / "no/folder"); },
                          {"no/folder", "No such file", "not there: make it"});
  EXPECT_EQ(count_entries(folder_.path()), 0u);
}

TEST_F(FileIo, UnreadablePlacesAreNamedWithTheReason) {
  expect_refused([&] { read_file(folder_ / "none", 10); }, {"none", "No such file or directory"});
  expect_refused([&] { read_file(folder_.path(), 10); }, {folder_.path().string(), "Is a directory"});
  expect_refused([&] { read_file("/dev/zero", 10); }, {"/dev/zero", "device"});
  write_file(folder_ / "file", "12345");
  expect_refused([&] { read_file(folder_ / "file", 4); }, {"file", "larger than 4 bytes"});
}

}  // namespace
}  // namespace egosgm::vision
