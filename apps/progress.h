// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

namespace egosgm::app {

/// Says on the standard error what is waited for, where that takes half a second. Nothing if quiet.
class Waiting {
 public:
  Waiting(const std::string& what, bool quiet);

 private:
  std::mutex mutex_;
  std::condition_variable_any ended_;
  std::jthread after_a_while_;  // ends with this object
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
