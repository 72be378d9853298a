// SPDX-License-Identifier: Apache-2.0
#include "apps/standard_output.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <string_view>

namespace egosgm::app {
namespace {

constexpr std::size_t kBufferBytes = 1 << 20;

int first_error = 0;

void drop_what_follows(int error) {
  if (first_error == 0) first_error = error;
  if (!std::freopen("/dev/null", "w", stdout)) std::clearerr(stdout);
}

void flush() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout)) drop_what_follows(errno);
}

}  // namespace

void open_standard_streams() {
  // In the way in which the stream is not used, so that using it is the error that it was.
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    const int way = stream == STDIN_FILENO ? O_WRONLY : O_RDONLY;
    if (::fcntl(stream, F_GETFD) < 0 && errno == EBADF) ::open("/dev/null", way);  // takes the lowest that is free
  }
  std::signal(SIGPIPE, SIG_IGN);
  // The buffer holds all that is printed once the work is done, so that a write fails where the exit code is known.
  if (isatty(STDOUT_FILENO) != 1) std::setvbuf(stdout, nullptr, _IOFBF, kBufferBytes);
}

void print_now(const std::string& text) {
  flush();
  for (std::string_view left = text; !left.empty();) {
    const ssize_t written = ::write(STDOUT_FILENO, left.data(), left.size());
    if (written >= 0) {
      left.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno != EINTR) {  // PoCL's compiler takes signals in a way that breaks writes off
      return drop_what_follows(errno);
    }
  }
}

void say(const std::string& line) { std::fputs((line + '\n').c_str(), stderr); }

int standard_output_error() {
  flush();
  return first_error;
}

}  // namespace egosgm::app
