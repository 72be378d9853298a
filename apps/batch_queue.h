// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <set>
#include <vector>

namespace egosgm::app {

/// Deals out jobs 0, 1, 2, ... to devices. A job that fails on a device goes to one that has not tried it. If it
/// succeeds there, the first device is to blame and gets no more; if it fails on all, the job is to blame, and they go
/// on. Thread-safe.
class BatchQueue {
 public:
  BatchQueue(int jobs, int devices);

  /// The next job for `device`. Waits while another device might still hand one over. None: nothing is left for it.
  std::optional<int> next(int device);

  // REQUIRES, of all three: `next(device)` gave `job`.

  void succeeded(int job);
  /// The job itself cannot be done.
  void failed();
  /// The device failed at it. Returns whether another one will try; if none can, the job has failed.
  bool hand_over(int job, int device);

  /// No more jobs for anyone.
  void stop();

  bool is_retired(int device) const;

 private:
  std::deque<int>::iterator first_untried(int device);

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<int> waiting_;
  std::vector<std::set<int>> tried_;  // by job: the devices that failed at it
  std::vector<bool> retired_;         // by device
  int running_ = 0;
  bool stopped_ = false;
};

}  // namespace egosgm::app
