// SPDX-License-Identifier: Apache-2.0
#include "host/ocl/context.h"

#include <algorithm>
#include <set>
#include <sstream>

#include "egosgm/error.h"
#include "host/ocl/errors.h"
#include "host/ocl/sources.h"
#include "host/ocl/strings.h"

namespace egosgm::ocl {
namespace {

constexpr const char* kBaseOptions = "-cl-std=CL1.2 -Werror -cl-kernel-arg-info";

// With contraction off, + - * and sqrt round as they do on the host, and tests can ask for equality.
// Nothing is linked with these kernels, so how wide vectors are passed on a CPU without AVX-512 is no matter; clang
// warns of it, which -Werror would make a failure.
constexpr std::string_view kPreamble =
    "#pragma OPENCL FP_CONTRACT OFF\n"
    "#ifdef __clang__\n"
    "#pragma clang diagnostic ignored \"-Wunknown-warning-option\"\n"
    "#pragma clang diagnostic ignored \"-Wpsabi\"\n"
    "#endif\n";

/// The text of a kernel file or header with what it includes, but for what is in `seen`, and is added to it.
std::string expand(const std::string& file, std::set<std::string>& seen) {
  if (!seen.insert(file).second) return {};
  const auto found = sources().find(file);
  if (found == sources().end()) throw std::invalid_argument("no embedded kernel named " + file);
  std::string text;
  std::istringstream lines{std::string(found->second)};
  constexpr std::string_view kInclude = "#include \"";
  for (std::string line; std::getline(lines, line);) {
    const bool includes = line.starts_with(kInclude);
    text += includes ? expand(line.substr(kInclude.size(), line.rfind('"') - kInclude.size()), seen) : line + '\n';
  }
  return text;
}

/// Files in one text. Their macros end with them; their other names must differ.
std::string joined(const std::vector<Program*>& programs) {
  std::string text(kPreamble);
  std::set<std::string> seen;
  for (const Program* program : programs) {
    text += expand(program->file(), seen);
    std::istringstream lines{std::string(sources().at(program->file()))};
    constexpr std::string_view kDefine = "#define ";
    for (std::string line; std::getline(lines, line);) {
      if (!line.starts_with(kDefine)) continue;
      const std::string name = line.substr(kDefine.size());
      text += "#undef " + name.substr(0, name.find_first_of(" (")) + '\n';
    }
  }
  return text;
}

std::string build_options(const cl::Device& device) {
  const bool rounds_division = device.getInfo<CL_DEVICE_SINGLE_FP_CONFIG>() & CL_FP_CORRECTLY_ROUNDED_DIVIDE_SQRT;
  return std::string(kBaseOptions) + (rounds_division ? " -cl-fp32-correctly-rounded-divide-sqrt" : "");
}

std::string build_log(const cl::Program& program, const cl::Device& device) {
  try {
    return program.getBuildInfo<CL_PROGRAM_BUILD_LOG>(device);
  } catch (const cl::Error&) {
    return "";  // the compiler never ran
  }
}

cl::CommandQueue make_queue(const cl::Context& context, const cl::Device& device) {
  return {context, device, CL_QUEUE_PROFILING_ENABLE};
}

/// The reason of a failed build whose compiler named no error of the source.
std::string reason_beside(const std::string& log, const cl::Device& device) {
  if (log.find("error:") != std::string::npos) return {};
  const cl::Platform platform(device.getInfo<CL_DEVICE_PLATFORM>());
  const std::string remedy = cache_remedy(trimmed(platform.getInfo<CL_PLATFORM_NAME>()));
  return remedy.empty() ? "" : ": " + remedy;
}

void expect_not_failed(const cl::Event& event) {
  const cl_int status = event.getInfo<CL_EVENT_COMMAND_EXECUTION_STATUS>();
  // A driver that does not tell why says -1.
  if (status < 0) throw cl::Error(status < -1 ? status : CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST, "a command");
}

/// Waits for a command, and throws the status that it failed with: waiting itself only tells that it failed.
void expect_done(const cl::Event& event) {
  const cl_int waited = ::clWaitForEvents(1, &event());
  if (waited == CL_SUCCESS) return;
  expect_not_failed(event);
  throw cl::Error(waited, "clWaitForEvents");
}

double duration_ms(const cl::Event& event) {
  const auto start = event.getProfilingInfo<CL_PROFILING_COMMAND_START>();
  const auto end = event.getProfilingInfo<CL_PROFILING_COMMAND_END>();
  return static_cast<double>(end - start) * 1e-6;
}

}  // namespace

Context::Context(const cl::Device& device, std::shared_ptr<const ProgramFolder> programs, const std::string& cache)
    : Context(device, cl::Context(device), {}, std::move(programs), cache) {}

Context::Context(const cl::CommandQueue& kernels, std::shared_ptr<const ProgramFolder> programs,
                 const std::string& cache)
    : Context(kernels.getInfo<CL_QUEUE_DEVICE>(), kernels.getInfo<CL_QUEUE_CONTEXT>(), kernels, std::move(programs),
              cache) {}

Context::Context(const cl::Device& device, const cl::Context& context, const cl::CommandQueue& kernels,
                 std::shared_ptr<const ProgramFolder> programs, const std::string& cache)
    : device_(device),
      context_(context),
      queues_{make_queue(context_, device), kernels() ? kernels : make_queue(context_, device),
              make_queue(context_, device)},
      build_options_(build_options(device)),
      max_work_group_size_(device.getInfo<CL_DEVICE_MAX_WORK_GROUP_SIZE>()),
      max_allocation_bytes_(device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>()),
      shares_host_memory_(device.getInfo<CL_DEVICE_HOST_UNIFIED_MEMORY>()),
      profiles_kernels_(queue().getInfo<CL_QUEUE_PROPERTIES>() & CL_QUEUE_PROFILING_ENABLE),
      folder_(std::move(programs)),
      cache_(folder_ ? std::nullopt : ProgramCache::of(device, cache)) {}

Context::Apart::Apart(Context& context)
    : context_(context),
      kernels_(context.queue()),
      allocated_bytes_(std::exchange(context.allocated_bytes_, 0)),
      stage_(context.stage_) {
  context.queue() = make_queue(context.context_, context.device_);
}

Context::Apart::~Apart() {
  context_.queue() = kernels_;
  context_.allocated_bytes_ = allocated_bytes_;
  context_.stage_ = stage_;
}

void Context::let_wait(Queue which, const cl::Event& event) {
  expect_not_failed(event);
  event.getInfo<CL_EVENT_COMMAND_QUEUE>().flush();  // OpenCL 1.2, section 5.13: before another queue waits for it
  const std::vector<cl::Event> events{event};
  cl::Event done;
  queue(which).enqueueBarrierWithWaitList(&events, &done);
  record(done, "wait", which);
}

const cl::Event& Context::last_kernel() const {
  return std::find_if(commands_.rbegin(), commands_.rend(), [](const Command& c) { return c.queue == Queue::kKernels; })
      ->event;
}

cl::Event Context::end_of_recorded() {
  expect_none_failed(commands_);
  std::vector<cl::Event> events;
  events.reserve(commands_.size());
  for (const Command& command : commands_) events.push_back(command.event);
  cl::Event end;
  queue().enqueueMarkerWithWaitList(&events, &end);
  return end;
}

std::vector<Context::Finished> Context::wait(const std::vector<Command>& commands) {
  std::vector<Finished> finished;
  finished.reserve(commands.size());
  for (const Command& command : commands) {
    stage_ = command.stage;
    expect_done(command.event);
    const bool profiles = profiles_kernels_ || command.queue != Queue::kKernels;
    finished.push_back({command.stage, profiles ? duration_ms(command.event) : 0, command.is_launch});
  }
  return finished;
}

std::vector<Context::Times> Context::times_of(const std::vector<Command>& commands) {
  std::vector<Times> times;
  times.reserve(commands.size());
  for (const Command& command : commands) {
    const auto asked = [&](cl_profiling_info what) {
      cl_ulong ns = 0;
      command.event.getProfilingInfo(what, &ns);
      return static_cast<std::int64_t>(ns);
    };
    times.push_back(completed({asked(CL_PROFILING_COMMAND_QUEUED), asked(CL_PROFILING_COMMAND_SUBMIT),
                               asked(CL_PROFILING_COMMAND_START), asked(CL_PROFILING_COMMAND_END)}));
    clock_offset_ns_ = std::min(clock_offset_ns_, command.enqueued_ns - times.back().queued);
  }
  for (Times& t : times) {
    for (std::int64_t* ns : {&t.queued, &t.submitted, &t.started, &t.ended}) *ns += clock_offset_ns_;
  }
  return times;
}

Context::Times Context::completed(Times answered) {
  auto& [queued, submitted, started, ended] = answered;
  if (submitted <= 0 || submitted > started) submitted = started;
  if (queued <= 0 || queued > submitted) queued = submitted;
  return answered;
}

void Context::expect_none_failed(const std::vector<Command>& commands) {
  for (const Command& command : commands) {
    stage_ = command.stage;
    expect_not_failed(command.event);
  }
}

std::vector<Command> Context::unfinished(std::vector<Command> commands) {
  expect_none_failed(commands);
  std::erase_if(commands, [](const Command& command) {
    return command.event.getInfo<CL_EVENT_COMMAND_EXECUTION_STATUS>() == CL_COMPLETE;
  });
  return commands;
}

void Context::drain() noexcept {
  for (const cl::CommandQueue& queue : queues_) ::clFinish(queue());
  commands_.clear();
}

cl::Buffer Context::allocate(std::uint64_t bytes) {
  if (bytes > max_allocation_bytes_) {
    throw DeviceError(CL_MEM_OBJECT_ALLOCATION_FAILURE,
                      std::string(stage_) + ": needs a buffer of " + std::to_string(bytes >> 20) +
                          " MiB, the device allows " + std::to_string(max_allocation_bytes_ >> 20) +
                          " MiB: choose fewer disparities, a smaller image or another device");
  }
  // If host and device share memory, most drivers map without a copy only memory that they allocated as host memory.
  const cl_mem_flags place = shares_host_memory_ ? CL_MEM_ALLOC_HOST_PTR : 0;
  cl::Buffer buffer(context_, CL_MEM_READ_WRITE | place, bytes);
  allocated_bytes_ += bytes;
  return buffer;
}

cl::Buffer Context::scratch(Scratch place, std::uint64_t bytes) {
  const auto [first, end] = scratch_.equal_range(place);
  const auto found =
      std::find_if(first, end, [&](const auto& of) { return of.second.template getInfo<CL_MEM_SIZE>() >= bytes; });
  return found != end ? found->second : scratch_.emplace(place, allocate(bytes))->second;
}

std::uint64_t Context::bytes_of_stages() const {
  std::uint64_t bytes = 0;
  for (const auto& [place, buffer] : scratch_) {
    if (place <= Scratch::kOfStage4) bytes += buffer.getInfo<CL_MEM_SIZE>();
  }
  return bytes;
}

/// Programs that are built together.
struct Context::Group {
  Defines defines;
  std::vector<Program*> members;

  bool takes(const Program& program) const {
    return members.front()->joins() == Joins::kYes && program.joins() == Joins::kYes &&
           defines.agrees_with(program.defines()) &&
           std::none_of(members.begin(), members.end(), [&](const Program* p) { return p->file() == program.file(); });
  }
};

Program& Context::program(const std::string& file, const Defines& defines, Joins joins) {
  return programs_.try_emplace(std::pair{file, defines.text()}, stage_, file, defines, joins).first->second;
}

void Context::build() {
  const char* const stage = stage_;
  std::vector<Group> groups;
  for (auto& [key, program] : programs_) {
    if (program.is_built()) continue;
    auto group = std::find_if(groups.begin(), groups.end(),
                              [&, &program = program](const Group& g) { return g.takes(program); });
    if (folder_ || group == groups.end()) group = groups.insert(groups.end(), Group{});
    group->defines.add(program.defines());
    group->members.push_back(&program);
  }
  for (const Group& group : groups) build_together(group);
  stage_ = stage;
}

void Context::build_together(const Group& group) {
  if (group.members.size() == 1) return build_alone(*group.members.front());
  enter(group.members.front()->stage());
  const ProgramSource source{"kernels", joined(group.members), build_options_ + group.defines.text(), build_options_};
  const auto [program, status] = compiled(source);
  if (status == CL_BUILD_PROGRAM_FAILURE) {  // an error names the file
    for (Program* member : group.members) build_alone(*member);
    return;
  }
  expect_built(source, program, status);
  for (Program* member : group.members) {
    enter(member->stage());
    member->set_built(program);
  }
}

void Context::build_alone(Program& program) {
  enter(program.stage());
  program.set_built(built(source_of(program)));
}

cl::Program Context::built(const ProgramSource& source) {
  const auto [program, status] =
      folder_ ? build(folder_->program(context_, device_, source), folder_->options(source)) : compiled(source);
  return expect_built(source, program, status);
}

std::pair<cl::Program, cl_int> Context::compiled(const ProgramSource& source) {
  if (!cache_) return build(cl::Program(context_, source.text), source.options);
  if (const cl::Program kept = cache_->built(context_, device_, source); kept()) return {kept, CL_SUCCESS};
  const auto made = build(cl::Program(context_, source.text), source.options);
  if (made.second == CL_SUCCESS) cache_->keep(source, made.first);
  return made;
}

std::pair<cl::Program, cl_int> Context::build(const cl::Program& program, const std::string& options) {
  ++builds_;
  // cl::Program::build asks for the log whatever went wrong, and reports that there is none instead of why.
  return {program, ::clBuildProgram(program(), 1, &device_(), options.c_str(), nullptr, nullptr)};
}

cl::Program Context::expect_built(const ProgramSource& source, const cl::Program& program, cl_int status) const {
  if (status == CL_SUCCESS) return program;
  const std::string log = build_log(program, device_);
  throw BuildError(status, std::string(stage_) + ": building " + source.kernel_file + " failed with OpenCL status " +
                               status_name(status) + reason_beside(log, device_) + '\n' + log);
}

ProgramSource Context::source_of(const Program& program) const {
  std::set<std::string> seen;
  return {program.file(), std::string(kPreamble) + expand(program.file(), seen),
          build_options_ + program.defines().text(), build_options_};
}

std::vector<ProgramSource> Context::sources() const {
  std::vector<ProgramSource> all;
  for (const auto& [key, program] : programs_) all.push_back(source_of(program));
  return all;
}

}  // namespace egosgm::ocl
