// SPDX-License-Identifier: Apache-2.0
// What it costs to hand frames over in device memory, and what several devices give.
#include <sys/resource.h>

#include <algorithm>
#include <barrier>
#include <chrono>
#include <cstdio>
#include <random>
#include <thread>

#include "bench/report.h"
#include "bench/street.h"
#include "egosgm/error.h"
#include "egosgm/opencl.h"
#include "host/method_options.h"

namespace egosgm::bench {
namespace {

constexpr const char* kHelp =
    "egosgm_offload: a steady frame, both views, on a synthetic street before a standing camera.\n"
    "host_way           images and maps in the host's memory (Pipeline::process)\n"
    "device_way         images and maps on the device, on a queue of the caller (DevicePipeline), enqueue to finish\n"
    "device_way_call    of that, what the host spends in the call\n"
    "one_unit, units    a frame's share of the time when one compute unit, or each of them as a device of its own, "
    "works\n"
    "                   through a sequence: the quotient is what several devices give\n"
    "  --size WxH        1242x375 without\n"
    "  --disparities N   128 without\n"
    "  --rounds N        a figure is the median of N frames, host's and device's way in random turns (50)\n"
    "  --threads N       compute units of PoCL (2)\n"
    "  --json FILE       write the rows\n";

using Clock = std::chrono::steady_clock;
double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

/// Of all threads of this process, PoCL's among them: on a machine that others use too, steadier than the clock.
double cpu_ms() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  const auto ms = [](const timeval& time) {
    return 1e3 * static_cast<double>(time.tv_sec) + 1e-3 * static_cast<double>(time.tv_usec);
  };
  return ms(usage.ru_utime) + ms(usage.ru_stime);
}

/// What frames took.
struct Times {
  std::vector<double> wall_ms, cpu_ms;

  template <typename Frame>
  void add(Frame&& frame) {
    const double cpu = bench::cpu_ms();
    const auto start = Clock::now();
    frame();
    wall_ms.push_back(ms_since(start));
    cpu_ms.push_back(bench::cpu_ms() - cpu);
  }
};

/// A pipeline's place for a frame's left maps.
struct Maps {
  std::vector<float> disparity, variance;
  FrameOutputs views(shared::ImageSize size) {
    const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
    disparity.resize(pixels), variance.resize(pixels);
    const std::ptrdiff_t stride = static_cast<std::ptrdiff_t>(size.width * sizeof(float));
    FrameOutputs outputs;
    outputs.disparity = {disparity.data(), size.width, size.height, stride};
    outputs.variance = {variance.data(), size.width, size.height, stride};
    return outputs;
  }
};

constexpr int kWarmUp = 5;  // the rows' offset, the prediction, and its variance

class HostWay {
 public:
  HostWay(const Street& street, const MethodOptions& options, const Device& device)
      : street_(street), pipeline_(street.calibration, street.size.width, street.size.height, options, device) {
    for (int i = 0; i < kWarmUp; ++i) frame();
  }
  void frame() { pipeline_.process(street_.view(EGOSGM_LEFT), street_.view(EGOSGM_RIGHT), Motion{}, outputs_); }

 private:
  const Street& street_;
  Pipeline pipeline_;
  Maps maps_;
  FrameOutputs outputs_ = maps_.views(street_.size);
};

/// A queue and the street's images in its context.
class DeviceWay {
 public:
  DeviceWay(const Street& street, const MethodOptions& options) {
    cl_platform_id platform = nullptr;
    cl_device_id device = nullptr;
    clGetPlatformIDs(1, &platform, nullptr);
    clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 1, &device, nullptr);
    context_ = clCreateContext(nullptr, 1, &device, nullptr, nullptr, nullptr);
    queue_ = clCreateCommandQueue(context_, device, 0, nullptr);
    pixels_ = clCreateBuffer(context_, CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR, street.images.size(),
                             const_cast<std::uint8_t*>(street.images.data()), nullptr);
    pipeline_.emplace(queue_, street.calibration, street.size.width, street.size.height, options);
    for (int i = 0; i < kWarmUp; ++i) frame();
  }
  ~DeviceWay() {
    pipeline_.reset();
    clReleaseMemObject(pixels_);
    clReleaseCommandQueue(queue_);
    clReleaseContext(context_);
  }
  DeviceWay(const DeviceWay&) = delete;
  DeviceWay& operator=(const DeviceWay&) = delete;

  /// Returns the milliseconds in the call.
  double frame() {
    const auto start = Clock::now();
    pipeline_->enqueue({pixels_, PixelType::kU8}, Motion{});
    const double call_ms = ms_since(start);
    clFinish(queue_);
    return call_ms;
  }

 private:
  cl_context context_;
  cl_command_queue queue_;
  cl_mem pixels_;
  std::optional<DevicePipeline> pipeline_;
};

struct Setting {
  Street street;
  MethodOptions options;
  int rounds;

  Row row(const std::string& name, double ms) const { return {name, street.size, options.disparities, ms, {}}; }
  Row row(const std::string& name, const Times& times) const {
    Row row = this->row(name, median(times.wall_ms));
    row.more.emplace_back("cpu_ms", median(times.cpu_ms));
    return row;
  }
};

void compare_ways(const Setting& setting, std::vector<Row>& rows) {
  HostWay host(setting.street, setting.options, Device::list().front());
  DeviceWay device(setting.street, setting.options);
  Times host_times, device_times;
  std::vector<double> call_ms;
  const std::size_t rounds = setting.rounds;
  std::mt19937 random(5);
  while (host_times.wall_ms.size() < rounds || device_times.wall_ms.size() < rounds) {
    const bool hosts =
        device_times.wall_ms.size() == rounds || (host_times.wall_ms.size() < rounds && random() % 2 == 0);
    if (hosts) {
      host_times.add([&] { host.frame(); });
    } else {
      device_times.add([&] { call_ms.push_back(device.frame()); });
    }
  }
  rows.push_back(setting.row("host_way", host_times));
  rows.push_back(setting.row("device_way", device_times));
  rows.push_back(setting.row("device_way_call", median(call_ms)));
  std::printf("device_way / host_way: %.3f by the clock, %.3f by CPU time\n",
              median(device_times.wall_ms) / median(host_times.wall_ms),
              median(device_times.cpu_ms) / median(host_times.cpu_ms));
}

/// Milliseconds a frame when that many compute units, each a device, work at the same time.
double ms_a_frame(const Setting& setting, const Device& whole, int units) {
  std::barrier gate(units + 1);
  std::vector<std::jthread> threads;
  for (int unit = 0; unit < units; ++unit) {
    threads.emplace_back([&, unit] {
      HostWay way(setting.street, setting.options, whole.compute_units(unit, unit));
      gate.arrive_and_wait();
      for (int round = 0; round < setting.rounds; ++round) way.frame();
      gate.arrive_and_wait();
    });
  }
  gate.arrive_and_wait();
  const auto start = Clock::now();
  gate.arrive_and_wait();
  return ms_since(start) / (setting.rounds * units);
}

void compare_units(const Setting& setting, std::vector<Row>& rows) {
  const Device whole = Device::select();
  const int units = whole.info().compute_units;
  if (units < 2) return;
  try {
    whole.compute_units(0, 0);
  } catch (const InvalidArgument& error) {
    std::printf("one_unit, units: left out: %s\n", error.what());
    return;
  }
  const double one = ms_a_frame(setting, whole, 1), all = ms_a_frame(setting, whole, units);
  rows.push_back(setting.row("one_unit", one));
  rows.push_back(setting.row("units", all));
  std::printf("%d units' throughput / one unit's: %.2f\n", units, one / all);
}

int run(int argc, char** argv) {
  const Arguments arguments = parse_arguments(argc, argv, kHelp, 50);
  Setting setting{
      make_street(arguments.size.value_or(shared::ImageSize{1242, 375}), arguments.disparities.value_or(128)),
      {},
      arguments.rounds};
  setting.options.disparities = arguments.disparities.value_or(128);
  std::vector<Row> rows;
  compare_ways(setting, rows);
  compare_units(setting, rows);
  for (const Row& row : rows) {
    std::printf("%-16s %8.3f ms", row.name.c_str(), row.median_ms);
    for (const auto& [name, value] : row.more) std::printf("  %s %.3f", name.c_str(), value);
    std::printf("\n");
  }
  const Machine machine{Device::select().info(), 0, "a synthetic street, standing camera", arguments.threads};
  print_machine(machine);
  if (!arguments.json.empty()) write_json(arguments.json, machine, rows);
  return 0;
}

}  // namespace
}  // namespace egosgm::bench

int main(int argc, char** argv) { return egosgm::bench::guarded("egosgm_offload", egosgm::bench::run, argc, argv); }
