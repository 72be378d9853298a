// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "host/ocl/defines.h"
#include "host/ocl/program_folder.h"

namespace egosgm::ocl {

/// One device with its in-order queue, the programs built for it, and the commands under way. Not thread-safe.
class Context {
 public:
  /// `programs`: where programs come from; null: from the embedded kernels, compiled.
  explicit Context(const cl::Device& device, std::shared_ptr<const ProgramFolder> programs = nullptr);

  /// Builds `file`, or returns what it built before. Throws BuildError, or InvalidArgument as ProgramFolder does.
  const cl::Program& program(const std::string& file, const Defines& defines);
  /// All that were built.
  std::vector<std::pair<ProgramSource, cl::Program>> programs() const;

  /// What is built, allocated and enqueued from now on belongs to `stage`: errors and timings name it. A string
  /// literal.
  void enter(const char* stage) { stage_ = stage; }
  const char* stage() const { return stage_; }

  cl::CommandQueue& queue() { return queue_; }

  /// Remembers a command, for `wait` to ask whether it succeeded.
  void record(cl::Event command, bool is_launch = false) {
    commands_.push_back({stage_, std::move(command), is_launch});
  }

  struct Finished {
    const char* stage;
    double ms;
    bool is_launch;
  };
  /// Waits for the recorded commands, forgets them, and throws if one failed. Nothing less tells: clFinish returns
  /// success after a failed kernel, and a later command of the same queue runs as if nothing were.
  /// Returns the device time of each.
  std::vector<Finished> wait();

  /// Lets the recorded commands end, and forgets them.
  void drain() noexcept;

  /// Throws DeviceError, naming the stage and the limit, for a buffer that this device cannot hold.
  void expect_allocatable(std::uint64_t bytes) const;
  void count_allocation(std::uint64_t bytes) { allocated_bytes_ += bytes; }
  std::uint64_t allocated_bytes() const { return allocated_bytes_; }

  const cl::Context& get() const { return context_; }
  const cl::Device& device() const { return device_; }
  std::size_t max_work_group_size() const { return max_work_group_size_; }

 private:
  cl::Program created(const ProgramSource& source) const;

  struct Command {
    const char* stage;
    cl::Event event;
    bool is_launch;
  };

  cl::Device device_;
  cl::Context context_;
  cl::CommandQueue queue_;
  std::string build_options_;
  std::size_t max_work_group_size_ = 1;
  std::uint64_t max_allocation_bytes_ = 0;
  std::uint64_t allocated_bytes_ = 0;
  const char* stage_ = "setup";
  std::shared_ptr<const ProgramFolder> folder_;
  std::map<std::pair<std::string, std::string>, std::pair<ProgramSource, cl::Program>> programs_;
  std::vector<Command> commands_;
};

/// Leaves no command running when its scope ends, however it ends. Declare it after the memory that the commands use.
struct Drain {
  Context& context;
  ~Drain() { context.drain(); }
};

}  // namespace egosgm::ocl
