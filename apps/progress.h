// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <string>

namespace egosgm::app {

/// Says on a terminal what is waited for, in a line that goes with it. Nothing elsewhere, or if quiet.
class Waiting {
 public:
  Waiting(const std::string& what, bool quiet);
  ~Waiting();
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;

 private:
  const bool shown_;
};

/// Progress on the standard output: a bar with frames per second and the time left on a terminal, a line a frame
/// elsewhere, nothing if quiet.
class Progress {
 public:
  Progress(int frames, bool quiet);
  /// Leaves the cursor on a new line.
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// One more frame is done. `line` says what it gave.
  void done(const std::string& line);
  /// Something that the reader must not miss; stays above the bar.
  void note(const std::string& line);

  double frames_per_second() const;

 private:
  std::string bar(const std::string& line) const;

  const int frames_;
  const bool quiet_;
  const bool terminal_;
  int done_ = 0;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace egosgm::app
