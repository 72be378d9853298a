// SPDX-License-Identifier: Apache-2.0
#include "apps/interrupt.h"

#include <unistd.h>

#include <atomic>
#include <csignal>

namespace egosgm::app {
namespace {

std::atomic<bool> flag{false};
static_assert(std::atomic<bool>::is_always_lock_free);  // or a handler may not touch it

struct Caught {
  int signal;
  struct sigaction before = {};
  std::atomic<bool> came{false};
};
Caught signals[] = {{SIGINT}, {SIGTERM}, {SIGHUP}};
bool are_caught = false;

/// `timeout` leads the process group: it sends its signal to the program, and once more to the whole group.
bool is_from_leader_of_group(const siginfo_t& info) { return info.si_code == SI_USER && info.si_pid == getpgrp(); }

void handle(int signal, siginfo_t* info, void* /*context*/) {
  for (Caught& caught : signals) {
    if (caught.signal != signal || !caught.came.exchange(true) || is_from_leader_of_group(*info)) continue;
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
  flag = true;
}

}  // namespace

void catch_interrupts() {
  struct sigaction action = {};
  action.sa_sigaction = &handle;
  action.sa_flags = SA_RESTART | SA_SIGINFO;
  for (Caught& caught : signals) {
    caught.came = false;
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
