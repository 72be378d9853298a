// SPDX-License-Identifier: Apache-2.0
// Ways between host and device that copy as little as the device allows.
#pragma once

#include <cstring>
#include <optional>
#include <utility>

#include "host/ocl/buffer.h"

namespace egosgm::ocl {

/// A part of a buffer in the host's address space, until it is unmapped or this object ends.
class Mapping {
 public:
  Mapping() = default;
  /// Pass `done` if there is nothing to wait for.
  Mapping(const cl::CommandQueue& queue, const cl::Buffer& buffer, cl_map_flags access, std::size_t first_byte,
          std::size_t bytes, cl::Event* done = nullptr)
      : queue_(queue),
        buffer_(buffer),
        data_(queue_.enqueueMapBuffer(buffer, done ? CL_FALSE : CL_TRUE, access, first_byte, bytes, nullptr, done)) {}
  Mapping(Mapping&& other) noexcept { *this = std::move(other); }
  Mapping& operator=(Mapping&& other) noexcept {
    std::swap(queue_, other.queue_);
    std::swap(buffer_, other.buffer_);
    std::swap(data_, other.data_);
    return *this;
  }
  ~Mapping() {
    if (data_) ::clEnqueueUnmapMemObject(queue_(), buffer_(), data_, 0, nullptr, nullptr);
  }

  void* data() const { return data_; }

  /// Gives the memory back to the device, for what is enqueued on `queue` from now on. What throws can be tried again.
  cl::Event unmap(cl::CommandQueue& queue) {
    cl::Event done;
    queue.enqueueUnmapMemObject(buffer_, data_, nullptr, &done);
    data_ = nullptr;
    return done;
  }

 private:
  cl::CommandQueue queue_;
  cl::Buffer buffer_;
  void* data_ = nullptr;
};

/// Page-locked host memory, to and from which devices with memory of their own copy at full speed: what drivers make of
/// a mapped CL_MEM_ALLOC_HOST_PTR.
class PinnedMemory {
 public:
  PinnedMemory(Context& context, std::size_t bytes)
      : buffer_(context.get(), CL_MEM_READ_WRITE | CL_MEM_ALLOC_HOST_PTR, bytes),
        mapping_(context.queue(Queue::kDownload), buffer_, CL_MAP_READ | CL_MAP_WRITE, 0, bytes) {}

  void* data() const { return mapping_.data(); }

 private:
  cl::Buffer buffer_;
  Mapping mapping_;
};

/// Writes into the first bytes of a device buffer, on the upload queue: the buffer itself where device
/// and host share memory, else page-locked memory that is copied.
class Upload {
 public:
  Upload(Context& context, const Buffer<cl_uchar>& buffer) : context_(context), buffer_(buffer.get()) {
    if (!context.shares_host_memory()) pinned_.emplace(context, buffer.size());
  }

  /// Calls `write(cl_uchar*)` with the memory to fill, and brings its first `bytes` bytes to the device.
  /// REQUIRES: no command uses the buffer.
  template <typename Write>
  void operator()(std::size_t bytes, Write&& write) {
    cl::CommandQueue& queue = context_.queue(Queue::kUpload);
    if (pinned_) {
      write(static_cast<cl_uchar*>(pinned_->data()));
      queue.enqueueWriteBuffer(buffer_, CL_FALSE, 0, bytes, pinned_->data(), nullptr, &done_);
      context_.record(done_, "write", Queue::kUpload);
    } else {
      Mapping mapping(queue, buffer_, CL_MAP_WRITE_INVALIDATE_REGION, 0, bytes);  // of an idle buffer: at once
      write(static_cast<cl_uchar*>(mapping.data()));
      done_ = mapping.unmap(queue);
      context_.record(done_, "unmap", Queue::kUpload);
    }
  }

  /// When the last one has arrived.
  const cl::Event& done() const { return done_; }

 private:
  Context& context_;
  cl::Buffer buffer_;
  std::optional<PinnedMemory> pinned_;
  cl::Event done_;
};

/// Reads a device buffer, on the download queue: the buffer itself, mapped, where device and host
/// share memory, else a copy in page-locked memory.
template <typename T>
class Readback {
 public:
  /// For at most `size` elements.
  Readback(Context& context, std::size_t size) : context_(context) {
    if (!context.shares_host_memory()) pinned_.emplace(context, size * sizeof(T));
  }

  /// Enqueues. REQUIRES: `release` after the last one. Kernels may read the buffer until then, but not write it.
  void fetch(const Buffer<T>& buffer, std::size_t first, std::size_t count) {
    cl::CommandQueue& queue = context_.queue(Queue::kDownload);
    const std::size_t first_byte = first * sizeof(T), bytes = count * sizeof(T);
    cl::Event done;
    if (pinned_) {
      queue.enqueueReadBuffer(buffer.get(), CL_FALSE, first_byte, bytes, pinned_->data(), nullptr, &done);
    } else {
      mapping_ = Mapping(queue, buffer.get(), CL_MAP_READ, first_byte, bytes, &done);
    }
    context_.record(done, pinned_ ? "read" : "map", Queue::kDownload);
  }

  /// The fetched values, once their command has ended.
  const T* data() const { return static_cast<const T*>(pinned_ ? pinned_->data() : mapping_.data()); }

  /// Enqueues what lets later kernels write the buffer again, where that takes anything.
  void release() {
    if (mapping_.data()) context_.record(mapping_.unmap(context_.queue()), "unmap");
  }

 private:
  Context& context_;
  std::optional<PinnedMemory> pinned_;
  Mapping mapping_;
};

}  // namespace egosgm::ocl
