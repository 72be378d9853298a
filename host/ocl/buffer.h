// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <vector>

#include "host/ocl/context.h"

namespace egosgm::ocl {

/// Device memory for `size` elements of `T`.
template <typename T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Buffer(Context& context, std::size_t size) : size_(std::max<std::size_t>(size, 1)) {
    buffer_ = context.allocate(size_ * sizeof(T));
  }

  /// Shared with all that have the same place. REQUIRES: what is written here is read no later than it says.
  Buffer(Context& context, Scratch place, std::size_t size) : size_(std::max<std::size_t>(size, 1)) {
    buffer_ = context.scratch(place, size_ * sizeof(T));
  }

  /// The caller's memory.
  Buffer(cl::Buffer buffer, std::size_t size) : size_(size), buffer_(std::move(buffer)) {}

  std::size_t size() const { return size_; }
  const cl::Buffer& get() const { return buffer_; }

  /// For tests and set-up: blocks.
  void write(Context& context, const std::vector<T>& values) {
    context.queue().enqueueWriteBuffer(buffer_, CL_TRUE, 0, values.size() * sizeof(T), values.data());
  }
  void fill(Context& context, T value) { fill(context, value, size_); }
  /// The first `count` elements.
  void fill(Context& context, T value, std::size_t count) {
    cl::Event done;
    context.queue().enqueueFillBuffer(buffer_, value, 0, count * sizeof(T), nullptr, &done);
    context.record(done, "fill");
  }
  /// Copies `count` elements from `from` to here.
  void copy(Context& context, std::size_t first, const Buffer& from, std::size_t first_from, std::size_t count) {
    cl::Event done;
    context.queue().enqueueCopyBuffer(from.buffer_, buffer_, first_from * sizeof(T), first * sizeof(T),
                                      count * sizeof(T), nullptr, &done);
    context.record(done, "copy");
  }
  /// For tests: waits for all that was enqueued.
  std::vector<T> read(Context& context) const {
    std::vector<T> values(size_);
    const Drain drain{context};
    cl::Event done;
    context.queue().enqueueReadBuffer(buffer_, CL_FALSE, 0, size_ * sizeof(T), values.data(), nullptr, &done);
    context.record(done, "read");
    context.wait();
    return values;
  }

 private:
  std::size_t size_;
  cl::Buffer buffer_;
};

}  // namespace egosgm::ocl
