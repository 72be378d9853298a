// SPDX-License-Identifier: Apache-2.0
#include "apps/standard_output.h"

#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>

namespace egosgm::app {
namespace {

constexpr std::size_t kBufferBytes = 1 << 20;

int first_error = 0;

void flush() {
  if (std::fflush(stdout) == 0 && !std::ferror(stdout)) return;
  if (first_error == 0) first_error = errno;
  if (!std::freopen("/dev/null", "w", stdout)) std::clearerr(stdout);
}

}  // namespace

void open_standard_output() {
  std::signal(SIGPIPE, SIG_IGN);
  // What is printed once the work is done fits, so that it fails where the exit code is known.
  if (isatty(STDOUT_FILENO) != 1) std::setvbuf(stdout, nullptr, _IOFBF, kBufferBytes);
}

void print_now(const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stdout);
  flush();
}

int standard_output_error() {
  flush();
  return first_error;
}

}  // namespace egosgm::app
