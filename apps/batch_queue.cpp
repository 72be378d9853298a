// SPDX-License-Identifier: Apache-2.0
#include "apps/batch_queue.h"

#include <algorithm>
#include <numeric>

namespace egosgm::app {

BatchQueue::BatchQueue(int jobs, int devices) : waiting_(jobs), tried_(jobs), retired_(devices) {
  std::iota(waiting_.begin(), waiting_.end(), 0);
}

std::deque<int>::iterator BatchQueue::first_untried(int device) {
  return std::find_if(waiting_.begin(), waiting_.end(), [&](int job) { return !tried_[job].contains(device); });
}

std::optional<int> BatchQueue::next(int device) {
  std::unique_lock lock(mutex_);
  const auto is_over = [&] { return stopped_ || retired_[device]; };
  changed_.wait(lock, [&] { return is_over() || running_ == 0 || first_untried(device) != waiting_.end(); });
  const auto found = first_untried(device);
  if (is_over() || found == waiting_.end()) return std::nullopt;
  const int job = *found;
  waiting_.erase(found);
  ++running_;
  return job;
}

void BatchQueue::succeeded(int job) {
  const std::lock_guard lock(mutex_);
  --running_;
  for (const int device : tried_[job]) retired_[device] = true;
  changed_.notify_all();
}

void BatchQueue::failed() {
  const std::lock_guard lock(mutex_);
  --running_;
  changed_.notify_all();
}

bool BatchQueue::hand_over(int job, int device) {
  const std::lock_guard lock(mutex_);
  --running_;
  tried_[job].insert(device);
  bool another = false;
  for (std::size_t i = 0; i < retired_.size(); ++i) {
    another = another || (!retired_[i] && !tried_[job].contains(static_cast<int>(i)));
  }
  if (another) waiting_.push_front(job);
  changed_.notify_all();
  return another;
}

void BatchQueue::stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  changed_.notify_all();
}

bool BatchQueue::is_retired(int device) const {
  const std::lock_guard lock(mutex_);
  return retired_[device];
}

}  // namespace egosgm::app
