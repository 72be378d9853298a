// SPDX-License-Identifier: Apache-2.0
// An OpenCL layer that fails the n-th call, at once, or later, as a kernel fault would; and that counts references to
// OpenCL objects. OPENCL_LAYERS loads it, tests arm it by the controls of fault_layer.h. A call that it does not
// know ends the program: so none can be forgotten.
#define CL_TARGET_OPENCL_VERSION 300
#include "tests/support/fault_layer.h"

#include <CL/cl.h>
#include <CL/cl_icd.h>
#include <CL/cl_layer.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <mutex>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace {

using egosgm::testing::FaultControls;

const cl_icd_dispatch* next = nullptr;
cl_icd_dispatch layer{};

std::atomic<int> calls = 0, enqueues = 0, releases = 0;
int failing = -1;
int kind = FaultControls::kAtOnce;
// A command that says until the next `arm` that it has not ended, and then that it failed. PoCL 3.1 ends the
// program where one fails that others wait for.
cl_event held = nullptr, failed = nullptr;
bool separate_memory = false, svm_is_hidden = false;
cl_int status = CL_OUT_OF_RESOURCES;
// EGOSGM_FAILING_CONTEXT=N/M, for programs that do not know of this layer: from command M on, all of context N fail
// (both from 0), as if its device were lost.
int context_to_fail = -1, last_good_command = 0;
std::atomic<int> contexts_created = 0, commands_of_it = 0;
std::atomic<cl_context> failing_context = nullptr;

std::atomic<bool> sources_forbidden = false, builds_are_reused = false;
std::atomic<long> references = 0;
std::atomic<long> buffers_created = 0;
std::atomic<int> transfers = 0;

std::mutex queues_mutex;
std::map<cl_command_queue, int> queues;  // that live, with their owners

// Where queues batch: an event a queue that its commands wait for until it is flushed, and how many do.
struct Batch {
  cl_event gate = nullptr;
  int commands = 0;
};
std::atomic<bool> queues_batch = false;
std::atomic<int> begun_by_wait = 0;
std::mutex batches_mutex;
std::map<cl_command_queue, Batch> batches;

// The batch of a queue begins; returns its number of commands.
int begin_batch(cl_command_queue queue) {
  const std::lock_guard lock(batches_mutex);
  const auto found = batches.extract(queue);
  if (!found) return 0;
  next->clSetUserEventStatus(found.mapped().gate, CL_COMPLETE);
  next->clReleaseEvent(found.mapped().gate);
  return found.mapped().commands;
}
void begin_all_batches() {
  for (;;) {
    cl_command_queue queue;
    {
      const std::lock_guard lock(batches_mutex);
      if (batches.empty()) return;
      queue = batches.begin()->first;
    }
    begun_by_wait += begin_batch(queue);
  }
}

// Calls that take part: all of them where the fault is to come at once, enqueues only where it is to come later.
bool fails() {
  const bool chosen = kind == FaultControls::kAtOnce && calls == failing;
  ++calls;
  return chosen;
}

template <typename Object>
Object refuse(cl_int* error) {
  if (error) *error = status;
  return nullptr;
}

template <typename Object>
Object counted(Object object) {
  if (object) ++references;
  return object;
}

cl_context context_of(cl_command_queue queue) {
  cl_context context = nullptr;
  next->clGetCommandQueueInfo(queue, CL_QUEUE_CONTEXT, sizeof context, &context, nullptr);
  return context;
}

void finish_all_queues() {
  const std::lock_guard lock(queues_mutex);
  for (const auto& [queue, owners] : queues) next->clFinish(queue);
}

// Enqueues by `enqueue(number of events to wait for, those events)`, which are those given and a fault that comes
// later: the command then waits for an event that fails, and takes the rest of its queue down with it. That event must
// not fail before the enqueue: PoCL 3.1 would hang. Nor while a command runs that this one would wait for as well:
// PoCL 3.1 goes on to notify the failed command when that one ends, though it may be freed by then
// (tests/support/pocl_late_failure.c).
template <typename Enqueue>
cl_int enqueue(cl_command_queue queue, cl_uint count, const cl_event* given, cl_event* done, Enqueue&& enqueue_with) {
  const bool is_it = enqueues == failing;
  const bool fails_later = is_it && kind == FaultControls::kLate, is_held = is_it && kind == FaultControls::kHeld;
  ++enqueues;
  if (failing_context && context_of(queue) == failing_context && commands_of_it++ >= last_good_command)
    return CL_DEVICE_NOT_AVAILABLE;
  if (fails()) return status;
  std::vector<cl_event> awaited(given, given + count);
  if (queues_batch) {
    const std::lock_guard lock(batches_mutex);
    Batch& batch = batches[queue];
    if (!batch.gate) batch.gate = next->clCreateUserEvent(context_of(queue), nullptr);
    ++batch.commands;
    awaited.push_back(batch.gate);
    count = static_cast<cl_uint>(awaited.size());
    given = awaited.data();
  }
  cl_int result;
  if (fails_later) {
    finish_all_queues();
    cl_event fault = next->clCreateUserEvent(context_of(queue), nullptr);
    std::vector<cl_event> events(given, given + count);
    events.push_back(fault);
    result = enqueue_with(count + 1, events.data());
    next->clSetUserEventStatus(fault, status);
    next->clReleaseEvent(fault);
  } else {
    result = enqueue_with(count, given);
  }
  if (result == CL_SUCCESS && done) ++references;
  if (is_held) next->clRetainEvent(held = *done);  // its address is no other's
  return result;
}

cl_context CL_API_CALL create_context(const cl_context_properties* p, cl_uint n, const cl_device_id* d,
                                      void(CL_CALLBACK* f)(const char*, const void*, size_t, void*), void* u,
                                      cl_int* e) {
  if (fails()) return refuse<cl_context>(e);
  const cl_context context = counted(next->clCreateContext(p, n, d, f, u, e));
  if (context == failing_context) failing_context = nullptr;  // that one is gone, its address was used again
  if (contexts_created++ == context_to_fail) failing_context = context;
  return context;
}
cl_command_queue CL_API_CALL create_queue(cl_context c, cl_device_id d, cl_command_queue_properties p, cl_int* e) {
  if (fails()) return refuse<cl_command_queue>(e);
  const cl_command_queue queue = counted(next->clCreateCommandQueue(c, d, p, e));
  const std::lock_guard lock(queues_mutex);
  if (queue) queues.emplace(queue, 1);
  return queue;
}
cl_mem CL_API_CALL create_buffer(cl_context c, cl_mem_flags f, size_t n, void* p, cl_int* e) {
  ++buffers_created;
  return fails() ? refuse<cl_mem>(e) : counted(next->clCreateBuffer(c, f, n, p, e));
}
cl_program CL_API_CALL create_program(cl_context c, cl_uint n, const char** s, const size_t* l, cl_int* e) {
  return fails() || sources_forbidden ? refuse<cl_program>(e) : counted(next->clCreateProgramWithSource(c, n, s, l, e));
}
cl_program CL_API_CALL create_program_of_binary(cl_context c, cl_uint n, const cl_device_id* d, const size_t* l,
                                                const unsigned char** b, cl_int* s, cl_int* e) {
  return fails() ? refuse<cl_program>(e) : counted(next->clCreateProgramWithBinary(c, n, d, l, b, s, e));
}
// PoCL 3.1 takes 25 ms to find a program in its cache, as it parses the source first. Where builds are reused, a source
// that was built before with the same options, for one device, is built of that binary instead, and its kernels are
// those of this second program, which lives as long as the first.
std::mutex builds_mutex;
std::map<std::pair<std::string, std::string>, std::vector<unsigned char>> binaries;  // of source and options
std::map<cl_program, cl_program> stand_ins;

std::string source_of(cl_program program) {
  size_t size = 0;
  next->clGetProgramInfo(program, CL_PROGRAM_SOURCE, 0, nullptr, &size);
  std::string source(size, 0);
  next->clGetProgramInfo(program, CL_PROGRAM_SOURCE, size, source.data(), nullptr);
  return source;
}
std::vector<unsigned char> binary_of(cl_program program) {
  size_t size = 0;
  next->clGetProgramInfo(program, CL_PROGRAM_BINARY_SIZES, sizeof size, &size, nullptr);
  std::vector<unsigned char> binary(size);
  unsigned char* bytes = binary.data();
  next->clGetProgramInfo(program, CL_PROGRAM_BINARIES, sizeof bytes, &bytes, nullptr);
  return binary;
}
cl_program built_of(const std::vector<unsigned char>& binary, cl_program program, cl_device_id device,
                    const char* options) {
  cl_context context = nullptr;
  next->clGetProgramInfo(program, CL_PROGRAM_CONTEXT, sizeof context, &context, nullptr);
  const unsigned char* bytes = binary.data();
  const size_t size = binary.size();
  const cl_program built = next->clCreateProgramWithBinary(context, 1, &device, &size, &bytes, nullptr, nullptr);
  if (built) next->clBuildProgram(built, 1, &device, options, nullptr, nullptr);
  return built;
}
cl_program stand_in(cl_program program) {
  const std::lock_guard lock(builds_mutex);
  const auto found = stand_ins.find(program);
  return found == stand_ins.end() ? program : found->second;
}
cl_int CL_API_CALL build(cl_program p, cl_uint n, const cl_device_id* d, const char* o,
                         void(CL_CALLBACK* f)(cl_program, void*), void* u) {
  if (fails()) return status;
  if (!builds_are_reused || n != 1) return next->clBuildProgram(p, n, d, o, f, u);
  const std::lock_guard lock(builds_mutex);
  std::vector<unsigned char>& binary = binaries[{source_of(p), o ? o : ""}];
  if (!binary.empty()) {
    stand_ins[p] = built_of(binary, p, *d, o);
    return CL_SUCCESS;
  }
  const cl_int result = next->clBuildProgram(p, n, d, o, f, u);
  if (result == CL_SUCCESS) binary = binary_of(p);
  return result;
}
template <auto Call, typename... Arguments>
cl_int CL_API_CALL ask(Arguments... arguments) {
  return fails() ? status : (next->*Call)(arguments...);
}
cl_int CL_API_CALL program_info(cl_program p, cl_program_info i, size_t n, void* v, size_t* s) {
  return fails() ? status : next->clGetProgramInfo(stand_in(p), i, n, v, s);
}
cl_kernel CL_API_CALL create_kernel(cl_program p, const char* n, cl_int* e) {
  return fails() ? refuse<cl_kernel>(e) : counted(next->clCreateKernel(stand_in(p), n, e));
}
cl_int CL_API_CALL device_info(cl_device_id d, cl_device_info i, size_t n, void* v, size_t* s) {
  if (fails()) return status;
  if (svm_is_hidden && i == CL_DEVICE_SVM_CAPABILITIES) return CL_INVALID_VALUE;  // as drivers of OpenCL 1.2 do
  const cl_int result = next->clGetDeviceInfo(d, i, n, v, s);
  if (separate_memory && i == CL_DEVICE_HOST_UNIFIED_MEMORY && v) *static_cast<cl_bool*>(v) = CL_FALSE;
  return result;
}
// Commands whose last arguments are the number of events to wait for, those events, and their own.
template <auto Call, bool kTransfers = false, typename... Arguments>
cl_int CL_API_CALL command(cl_command_queue queue, Arguments... arguments) {
  if (kTransfers) ++transfers;
  std::tuple all(arguments...);
  auto& count = std::get<sizeof...(Arguments) - 3>(all);
  auto& given = std::get<sizeof...(Arguments) - 2>(all);
  return enqueue(queue, count, given, std::get<sizeof...(Arguments) - 1>(all), [&](cl_uint n, const cl_event* events) {
    count = n, given = events;
    return std::apply([&](auto... of_call) { return (next->*Call)(queue, of_call...); }, all);
  });
}
// A blocking transfer that fails later would wait for ever for the event that fails only after the enqueue: it is
// waited for here.
template <auto Call, typename Pixels>
cl_int CL_API_CALL transfer(cl_command_queue q, cl_mem b, cl_bool blocking, size_t o, size_t n, Pixels p, cl_uint count,
                            const cl_event* given, cl_event* done) {
  ++transfers;
  cl_event own = nullptr;
  const bool waits = blocking && kind == FaultControls::kLate;
  const cl_int result = enqueue(q, count, given, done, [&](cl_uint w, const cl_event* l) {
    return (next->*Call)(q, b, waits ? CL_FALSE : blocking, o, n, p, w, l, waits && !done ? &own : done);
  });
  if (!waits || result != CL_SUCCESS) return result;
  const cl_int waited = next->clWaitForEvents(1, done ? done : &own);
  if (own) next->clReleaseEvent(own);
  return waited;
}
// A map that blocks can only fail at once: PoCL 3.1 would hang.
void* CL_API_CALL map(cl_command_queue q, cl_mem b, cl_bool bl, cl_map_flags f, size_t o, size_t n, cl_uint c,
                      const cl_event* g, cl_event* e, cl_int* error) {
  ++transfers;
  void* mapped = nullptr;
  const auto enqueue_with = [&](cl_uint w, const cl_event* l) {
    cl_int result;
    mapped = next->clEnqueueMapBuffer(q, b, bl, f, o, n, w, l, e, &result);
    return result;
  };
  if (bl) begin_batch(q);
  const cl_int result = !bl ? enqueue(q, c, g, e, enqueue_with) : fails() ? status : enqueue_with(c, g);
  if (error) *error = result;
  return mapped;
}
cl_int CL_API_CALL flush(cl_command_queue queue) {
  if (fails()) return status;
  begin_batch(queue);
  return next->clFlush(queue);
}
cl_int CL_API_CALL finish(cl_command_queue queue) {
  begin_all_batches();
  return next->clFinish(queue);
}
cl_int CL_API_CALL wait_for_events(cl_uint count, const cl_event* events) {
  if (fails()) return status;
  begin_all_batches();
  return next->clWaitForEvents(count, events);
}
cl_int CL_API_CALL event_info(cl_event e, cl_event_info i, size_t n, void* v, size_t* s) {
  if (fails()) return status;
  const cl_int result = next->clGetEventInfo(e, i, n, v, s);
  const bool is_told = (e == held || e == failed) && i == CL_EVENT_COMMAND_EXECUTION_STATUS && v;
  if (is_told) *static_cast<cl_int*>(v) = e == held ? CL_QUEUED : CL_OUT_OF_RESOURCES;
  return result;
}

template <auto Call, typename Object>
cl_int CL_API_CALL retain(Object object) {
  ++references;
  return (next->*Call)(object);
}
template <auto Call, typename Object>
cl_int CL_API_CALL release(Object object) {
  --references;
  const bool chosen = kind == FaultControls::kRelease && releases == failing;
  ++releases;
  const cl_int result = (next->*Call)(object);
  return chosen ? status : result;
}

cl_int CL_API_CALL retain_queue(cl_command_queue queue) {
  const std::lock_guard lock(queues_mutex);
  ++queues[queue];
  return retain<&cl_icd_dispatch::clRetainCommandQueue>(queue);
}
cl_int CL_API_CALL release_queue(cl_command_queue queue) {
  const std::lock_guard lock(queues_mutex);
  if (--queues[queue] == 0) queues.erase(queue);
  return release<&cl_icd_dispatch::clReleaseCommandQueue>(queue);
}

cl_int CL_API_CALL release_program(cl_program program) {
  cl_uint owners = 0;
  next->clGetProgramInfo(program, CL_PROGRAM_REFERENCE_COUNT, sizeof owners, &owners, nullptr);
  if (owners == 1) {
    const std::lock_guard lock(builds_mutex);
    if (const auto found = stand_ins.extract(program)) next->clReleaseProgram(found.mapped());
  }
  return release<&cl_icd_dispatch::clReleaseProgram>(program);
}

void unknown_call() {
  std::fputs("the fault layer does not know an OpenCL call that this program makes: add it\n", stderr);
  std::abort();
}

}  // namespace

extern "C" const FaultControls fault_controls{.arm =
                                                  [](int at, int code, int how) {
                                                    if (failed) next->clReleaseEvent(failed);
                                                    failed = std::exchange(held, nullptr);
                                                    calls = enqueues = releases = 0;
                                                    failing = at;
                                                    status = code;
                                                    kind = how;
                                                  },
                                              .forbid_sources = [](int forbidden) { sources_forbidden = forbidden; },
                                              .reuse_builds = [](int reused) { builds_are_reused = reused; },
                                              .separate_memory = [](int separate) { separate_memory = separate; },
                                              .hide_svm = [](int hidden) { svm_is_hidden = hidden; },
                                              .batch =
                                                  [](int batching) {
                                                    begin_all_batches();
                                                    queues_batch = batching;
                                                    begun_by_wait = 0;
                                                  },
                                              .begun_by_wait = []() -> int { return begun_by_wait; },
                                              .calls = []() -> int { return calls; },
                                              .enqueues = []() -> int { return enqueues; },
                                              .releases = []() -> int { return releases; },
                                              .references = []() -> long { return references; },
                                              .buffers_created = []() -> long { return buffers_created; },
                                              .transfers = []() -> int { return transfers; }};

extern "C" cl_int CL_API_CALL clInitLayer(cl_uint, const cl_icd_dispatch* target, cl_uint* count,
                                          const cl_icd_dispatch** out) {
  next = target;
  if (const char* wanted = std::getenv("EGOSGM_FAILING_CONTEXT")) {
    std::sscanf(wanted, "%d/%d", &context_to_fail, &last_good_command);
  }
  using Entry = void (*)();
  static_assert(sizeof(layer) % sizeof(Entry) == 0);
  for (size_t i = 0; i < sizeof(layer) / sizeof(Entry); ++i) reinterpret_cast<Entry*>(&layer)[i] = unknown_call;
  // Finding a device comes before all that is tested here. A build log is asked for after a failure only. What fails
  // of a finish leaves nobody to tell: Context::drain is the last to go.
  layer.clGetPlatformIDs = target->clGetPlatformIDs;
  layer.clGetPlatformInfo = target->clGetPlatformInfo;
  layer.clGetDeviceIDs = target->clGetDeviceIDs;
  layer.clCreateSubDevices = target->clCreateSubDevices;
  layer.clRetainDevice = target->clRetainDevice;
  layer.clReleaseDevice = target->clReleaseDevice;
  layer.clGetProgramBuildInfo = target->clGetProgramBuildInfo;
  layer.clFinish = finish;
  layer.clFlush = flush;
  layer.clCreateUserEvent = [](cl_context c, cl_int* e) { return counted(next->clCreateUserEvent(c, e)); };  // of tests
  layer.clSetUserEventStatus = target->clSetUserEventStatus;
  layer.clSVMAlloc = target->clSVMAlloc;
  layer.clSVMFree = target->clSVMFree;
  layer.clEnqueueSVMMap = target->clEnqueueSVMMap;
  layer.clEnqueueSVMUnmap = target->clEnqueueSVMUnmap;
  layer.clCreateContext = create_context;
  layer.clCreateCommandQueue = create_queue;
  layer.clCreateBuffer = create_buffer;
  layer.clCreateProgramWithSource = create_program;
  layer.clCreateProgramWithBinary = create_program_of_binary;
  layer.clBuildProgram = build;
  layer.clGetProgramInfo = program_info;
  layer.clCreateKernel = create_kernel;
  layer.clGetDeviceInfo = device_info;
  layer.clGetKernelInfo = ask<&cl_icd_dispatch::clGetKernelInfo>;
  layer.clGetKernelArgInfo = ask<&cl_icd_dispatch::clGetKernelArgInfo>;
  layer.clGetKernelWorkGroupInfo = ask<&cl_icd_dispatch::clGetKernelWorkGroupInfo>;
  layer.clSetKernelArg = ask<&cl_icd_dispatch::clSetKernelArg>;
  layer.clEnqueueFillBuffer = command<&cl_icd_dispatch::clEnqueueFillBuffer>;
  layer.clEnqueueCopyBuffer = command<&cl_icd_dispatch::clEnqueueCopyBuffer, true>;
  layer.clEnqueueReadBuffer = transfer<&cl_icd_dispatch::clEnqueueReadBuffer>;
  layer.clEnqueueWriteBuffer = transfer<&cl_icd_dispatch::clEnqueueWriteBuffer>;
  layer.clEnqueueMapBuffer = map;
  layer.clEnqueueUnmapMemObject = command<&cl_icd_dispatch::clEnqueueUnmapMemObject, true>;
  layer.clEnqueueBarrierWithWaitList = command<&cl_icd_dispatch::clEnqueueBarrierWithWaitList>;
  layer.clEnqueueMarkerWithWaitList = command<&cl_icd_dispatch::clEnqueueMarkerWithWaitList>;
  layer.clGetMemObjectInfo = ask<&cl_icd_dispatch::clGetMemObjectInfo>;
  layer.clGetCommandQueueInfo = ask<&cl_icd_dispatch::clGetCommandQueueInfo>;
  layer.clGetEventInfo = event_info;
  layer.clEnqueueNDRangeKernel = command<&cl_icd_dispatch::clEnqueueNDRangeKernel>;
  layer.clWaitForEvents = wait_for_events;
  layer.clGetEventProfilingInfo = ask<&cl_icd_dispatch::clGetEventProfilingInfo>;
#define COUNT(Name)                                                \
  layer.clRetain##Name = retain<&cl_icd_dispatch::clRetain##Name>; \
  layer.clRelease##Name = release<&cl_icd_dispatch::clRelease##Name>
  COUNT(Context);
  COUNT(MemObject);
  COUNT(Kernel);
  COUNT(Event);
#undef COUNT
  layer.clRetainProgram = retain<&cl_icd_dispatch::clRetainProgram>;
  layer.clReleaseProgram = release_program;
  layer.clRetainCommandQueue = retain_queue;
  layer.clReleaseCommandQueue = release_queue;
  *count = sizeof(layer) / sizeof(void*);
  *out = &layer;
  return CL_SUCCESS;
}
