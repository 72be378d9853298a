// SPDX-License-Identifier: Apache-2.0
#include "apps/interrupt.h"

#include <atomic>
#include <csignal>
#include <cstdint>
#include <ctime>

namespace egosgm::app {
namespace {

/// `timeout` sends its signal to the program, and once more to all that the program belongs to.
constexpr std::int64_t kTogetherMs = 500;

std::atomic<bool> flag{false};
static_assert(std::atomic<bool>::is_always_lock_free);  // or a handler may not touch it
static_assert(std::atomic<std::int64_t>::is_always_lock_free);

struct Caught {
  int signal;
  struct sigaction before = {};
  std::atomic<std::int64_t> first_ms{-1};
};
Caught signals[] = {{SIGINT}, {SIGTERM}, {SIGHUP}};
bool are_caught = false;

/// std::chrono's clocks are not promised to a handler.
std::int64_t now_ms() {
  timespec now = {};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * 1000 + now.tv_nsec / 1'000'000;
}

void handle(int signal) {
  for (Caught& caught : signals) {
    if (caught.signal != signal) continue;
    std::int64_t first_ms = -1;
    if (caught.first_ms.compare_exchange_strong(first_ms, now_ms()) || now_ms() - first_ms < kTogetherMs) continue;
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
  flag = true;
}

}  // namespace

void catch_interrupts() {
  struct sigaction action = {};
  action.sa_handler = &handle;
  action.sa_flags = SA_RESTART;
  for (Caught& caught : signals) {
    caught.first_ms = -1;
    sigaction(caught.signal, nullptr, &caught.before);
    if (caught.before.sa_handler != SIG_IGN) sigaction(caught.signal, &action, nullptr);
  }
  are_caught = true;
}

void release_interrupts() {
  for (const Caught& caught : signals) {
    if (are_caught) sigaction(caught.signal, &caught.before, nullptr);
  }
  flag = are_caught = false;
}

bool interrupted() { return flag; }

}  // namespace egosgm::app
