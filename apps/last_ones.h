// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <deque>
#include <utility>

namespace egosgm::app {

/// The last elements of a growing row; those before are forgotten. They keep their indices in the row.
template <typename T>
class LastOnes {
 public:
  explicit LastOnes(std::size_t most) : most_(most) {}

  void push_back(T element) {
    elements_.push_back(std::move(element));
    if (elements_.size() <= most_) return;
    elements_.pop_front();
    ++first_;
  }

  std::size_t first() const { return first_; }
  std::size_t end() const { return first_ + elements_.size(); }
  /// REQUIRES: first() <= i < end().
  const T& operator[](std::size_t i) const { return elements_[i - first_]; }

 private:
  const std::size_t most_;
  std::size_t first_ = 0;
  std::deque<T> elements_;
};

}  // namespace egosgm::app
