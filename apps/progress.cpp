// SPDX-License-Identifier: Apache-2.0
#include "apps/progress.h"

#include <fmt/core.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "apps/standard_output.h"

namespace egosgm::app {
namespace {

constexpr const char* kEraseLine = "\r\x1b[K";
constexpr int kBarWidth = 24;

std::size_t terminal_columns() {
  winsize size = {};
  return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

std::string clock_text(double seconds) {
  const int s = static_cast<int>(std::lround(seconds));
  return fmt::format("{}:{:02}", s / 60, s % 60);
}

}  // namespace

Waiting::Waiting(const std::string& what, bool quiet) {
  if (quiet) return;
  after_a_while_ = std::jthread([this, what](const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    ended_.wait_for(lock, stop, std::chrono::milliseconds(500), [] { return false; });
    if (!stop.stop_requested()) say(fmt::format("egosgm: {}", what));
  });
}

Progress::Progress(int frames, bool quiet) : frames_(frames), quiet_(quiet), terminal_(isatty(STDOUT_FILENO) == 1) {}

Progress::~Progress() {
  if (quiet_ || !terminal_ || done_ == 0) return;
  print_now("\n");
}

void Progress::done(const std::string& line) {
  ++done_;
  if (quiet_) return;
  print_now(terminal_ ? bar(line) : line + '\n');
}

void Progress::note(const std::string& line) {
  if (quiet_) return;
  print_now(fmt::format("{}{}\n", terminal_ ? kEraseLine : "", line));
}

double Progress::frames_per_second() const {
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start_;
  return seconds.count() > 0 ? done_ / seconds.count() : 0;
}

std::string Progress::bar(const std::string& line) const {
  const int filled = kBarWidth * done_ / std::max(frames_, 1);
  const double rate = frames_per_second();
  std::string text =
      fmt::format("[{:#<{}}{:.<{}}] {}/{}  {:.1f} frames/s  {} left  {}", "", filled, "", kBarWidth - filled, done_,
                  frames_, rate, clock_text(rate > 0 ? (frames_ - done_) / rate : 0), line);
  text.resize(std::min(text.size(), terminal_columns() - 1));
  return kEraseLine + text;
}

}  // namespace egosgm::app
