// SPDX-License-Identifier: Apache-2.0
#include "apps/interrupt.h"

#include <atomic>
#include <csignal>

namespace egosgm::app {
namespace {

std::atomic<bool> flag{false};
static_assert(std::atomic<bool>::is_always_lock_free);  // or a handler may not touch it

struct Caught {
  int signal;
  struct sigaction before = {};
};
Caught signals[] = {{SIGINT}, {SIGTERM}, {SIGHUP}};
bool are_caught = false;

}  // namespace

void catch_interrupts() {
  struct sigaction action = {};
  action.sa_handler = [](int) { flag = true; };
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  for (Caught& caught : signals) {
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
