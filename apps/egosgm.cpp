// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <string_view>

#include "apps/program.h"

namespace {

/// Whether main() is left by its own way. A driver may end the whole program: PoCL's compiler does on a full disk.
std::atomic<bool> is_over = false;

void tell_of_an_end_from_within() {
  if (is_over.exchange(true)) return;
  constexpr std::string_view kMessage =
      "egosgm: error: the OpenCL driver ended the program, for what it says above: where that is its cache, make room, "
      "delete the cache, or set POCL_CACHE_DIR to another folder\n";
  [[maybe_unused]] const auto written = ::write(STDERR_FILENO, kMessage.data(), kMessage.size());
}

}  // namespace

/// In place of the C library's, for drivers too: PoCL ends the program where a file of its cache is cut. A handler of
/// SIGABRT would not do, as PoCL's compiler sets its own.
extern "C" void abort() noexcept {
  tell_of_an_end_from_within();
  std::signal(SIGABRT, SIG_DFL);
  ::raise(SIGABRT);
  ::_exit(128 + SIGABRT);
}

int main(int argc, char** argv) {
  std::atexit(tell_of_an_end_from_within);
  const int code = egosgm::app::run_program(argc, argv, nullptr);
  is_over = true;
  return code;
}
