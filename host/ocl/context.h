// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "egosgm/device.h"
#include "host/ocl/program.h"
#include "host/ocl/program_cache.h"
#include "host/ocl/program_folder.h"

namespace egosgm::ocl {

/// The device's in-order queues. Transfers have their own, so that they run beside the kernels of another frame.
using Queue = DeviceQueue;

/// Memory that is needed for a while and shared by all who need it at other times: kernels run one after another. Of a
/// stage: within a call of it. Of a step: from one of its stages to another of them.
enum class Scratch { kOfStage0, kOfStage1, kOfStage2, kOfStage3, kOfStage4, kOfStep0, kOfStep1 };

/// A command that was enqueued. The names are string literals.
struct Command {
  const char* stage;
  const char* name;  // of the kernel, or "write", "read", ...
  Queue queue;
  bool is_launch;
  cl::Event event;
  std::int64_t enqueued_ns;  // on the host's steady clock, no earlier than on the device's
};

/// One device with its queues, the programs built for it, and the commands under way. Not thread-safe.
class Context {
 public:
  /// `programs`: where programs come from; null: from the embedded kernels, compiled and kept as ProgramCache::of says.
  explicit Context(const cl::Device& device, std::shared_ptr<const ProgramFolder> programs = nullptr,
                   const std::string& cache = {});
  /// On a queue of the caller's, in its context; kernels run there.
  explicit Context(const cl::CommandQueue& kernels, std::shared_ptr<const ProgramFolder> programs = nullptr,
                   const std::string& cache = {});

  /// The program of `file`, which `build` builds.
  Program& program(const std::string& file, const Defines& defines, Joins joins = Joins::kYes);
  /// Builds what was asked for since the last call: what joins, and whose defines agree, together. Programs that come
  /// from a folder are those of a file each. Throws BuildError, or InvalidArgument as ProgramFolder does.
  void build();
  /// The number of builds by the compiler, or from binaries of a folder of programs.
  int builds() const { return builds_; }
  /// All files that were asked for, as a compiler gets each of them alone.
  std::vector<ProgramSource> sources() const;
  /// Builds one of them.
  cl::Program built(const ProgramSource& source);

  /// Programs, memory and commands belong to `stage` from now on: errors and timings name it. `stage` is a string
  /// literal.
  void enter(const char* stage) { stage_ = whole_ ? whole_ : stage; }
  /// While it lives, the stages entered are parts of `stage`, and go by its name.
  class Within {
   public:
    Within(Context& context, const char* stage) : context_(context) { context.stage_ = context.whole_ = stage; }
    ~Within() { context_.whole_ = nullptr; }
    Within(const Within&) = delete;
    Within& operator=(const Within&) = delete;

   private:
    Context& context_;
  };
  const char* stage() const { return stage_; }

  /// While it lives, kernels run on a queue of its own, and memory is counted from 0: what a device has left for what
  /// is small does not shape it. REQUIRES: all recorded commands were taken.
  class Apart {
   public:
    explicit Apart(Context& context);
    ~Apart();
    Apart(const Apart&) = delete;
    Apart& operator=(const Apart&) = delete;

   private:
    Context& context_;
    const cl::CommandQueue kernels_;
    const std::uint64_t allocated_bytes_;
    const char* const stage_;
  };

  cl::CommandQueue& queue(Queue which = Queue::kKernels) { return queues_[static_cast<std::size_t>(which)]; }

  /// Lets what is enqueued on `which` from now on wait for `event` of another queue. Throws if the event's command has
  /// failed: PoCL 3.1 never ends a command whose dependency failed before it was enqueued.
  void let_wait(Queue which, const cl::Event& event);

  /// Lets the device begin what was enqueued on all queues: else a driver may wait until somebody waits.
  void flush() {
    for (const cl::CommandQueue& queue : queues_) queue.flush();
  }

  /// The last recorded command of `kKernels`. REQUIRES: there is one.
  const cl::Event& last_kernel() const;

  /// Remembers a command, for `wait` to ask whether it succeeded.
  void record(cl::Event event, const char* name, Queue queue = Queue::kKernels, bool is_launch = false) {
    commands_.push_back({stage_, name, queue, is_launch, std::move(event), steady_ns()});
  }

  /// An event that ends when all recorded commands have, and fails if one does; the last one's own would not. Throws if
  /// one has failed already.
  cl::Event end_of_recorded();

  /// The commands recorded since the last call; they are forgotten here.
  std::vector<Command> take_commands() { return std::exchange(commands_, {}); }

  struct Finished {
    const char* stage;
    double ms;
    bool is_launch;
  };
  /// When a command was queued, submitted, started and ended [ns].
  struct Times {
    std::int64_t queued, submitted, started, ended;
  };
  /// Completes the times of a driver: Intel's says that a barrier was queued at 0.
  static Times completed(Times answered);
  /// Waits for `commands` and throws if one failed. Nothing less tells: clFinish returns success after a failed kernel,
  /// and a later command of the same queue runs as if nothing were. Returns the device time of each.
  std::vector<Finished> wait(const std::vector<Command>& commands);
  /// Waits for the recorded commands.
  std::vector<Finished> wait() { return wait(take_commands()); }

  /// Times of commands that have ended, on the host's steady clock. A command is recorded right after it was queued, so
  /// that the least distance between the two is how far the device's clock is off.
  std::vector<Times> times_of(const std::vector<Command>& commands);

  /// Throws if one of `commands` has failed by now. Does not wait.
  void expect_none_failed(const std::vector<Command>& commands);

  /// Those of `commands` that have not ended. Throws if one of them has failed by now.
  std::vector<Command> unfinished(std::vector<Command> commands);

  /// Lets all that was enqueued end, and forgets what was recorded.
  void drain() noexcept;

  /// Throws DeviceError, naming the stage and the limit, for a buffer that this device cannot hold.
  cl::Buffer allocate(std::uint64_t bytes);
  /// The shared buffer of a place, allocated anew where it has fewer bytes.
  cl::Buffer scratch(Scratch place, std::uint64_t bytes);
  /// For tests: all of it.
  const std::multimap<Scratch, cl::Buffer>& scratch() const { return scratch_; }
  std::uint64_t allocated_bytes() const { return allocated_bytes_; }
  /// Bytes that stages share, also those that were allocated before a context was Apart.
  std::uint64_t bytes_of_stages() const;
  /// The largest buffer that the device allows.
  std::uint64_t max_allocation_bytes() const { return max_allocation_bytes_; }

  const cl::Context& get() const { return context_; }
  const cl::Device& device() const { return device_; }
  std::size_t max_work_group_size() const { return max_work_group_size_; }
  /// Whether the device works in the host's memory, so that mapping a buffer copies nothing.
  bool shares_host_memory() const { return shares_host_memory_; }

 private:
  Context(const cl::Device& device, const cl::Context& context, const cl::CommandQueue& kernels,
          std::shared_ptr<const ProgramFolder> programs, const std::string& cache);
  static std::int64_t steady_ns() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }
  struct Group;
  void build_together(const Group& group);
  void build_alone(Program& program);
  /// The program of the cache, or of the compiler, with the compiler's status.
  std::pair<cl::Program, cl_int> compiled(const ProgramSource& source);
  std::pair<cl::Program, cl_int> build(const cl::Program& program, const std::string& options);
  ProgramSource source_of(const Program& program) const;
  /// Throws BuildError.
  cl::Program expect_built(const ProgramSource& source, const cl::Program& program, cl_int status) const;

  cl::Device device_;
  cl::Context context_;
  std::array<cl::CommandQueue, 3> queues_;
  std::string build_options_;
  std::size_t max_work_group_size_ = 1;
  std::uint64_t max_allocation_bytes_ = 0;
  std::uint64_t allocated_bytes_ = 0;
  bool shares_host_memory_ = false;
  bool profiles_kernels_ = true;
  const char* stage_ = "setup";
  const char* whole_ = nullptr;
  std::shared_ptr<const ProgramFolder> folder_;
  std::optional<ProgramCache> cache_;
  std::map<std::pair<std::string, std::string>, Program> programs_;  // by file and defines
  int builds_ = 0;
  std::multimap<Scratch, cl::Buffer> scratch_;
  std::vector<Command> commands_;
  std::int64_t clock_offset_ns_ = std::numeric_limits<std::int64_t>::max();  // steady clock - device's clock, at most
};

/// Leaves no command running when its scope ends, unless `is_dismissed`. Declare it after the memory that the commands
/// use.
struct Drain {
  Context& context;
  bool is_dismissed = false;
  ~Drain() {
    if (!is_dismissed) context.drain();
  }
};

}  // namespace egosgm::ocl
