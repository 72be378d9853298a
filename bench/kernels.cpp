// SPDX-License-Identifier: Apache-2.0
// Every kernel of a full and of a steady frame: its time on the device, and the roofs of the device. bench/kernels.py
// makes a table and a picture of it.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <string>
#include <utility>

#include "bench/report.h"
#include "bench/roofs.h"
#include "bench/street_frame.h"
#include "egosgm/error.h"
#include "egosgm/pipeline.h"
#include "host/ocl/device_handle.h"
#include "host/ocl/errors.h"

namespace egosgm::bench {
namespace {

constexpr const char* kHelp =
    "egosgm_kernels: the kernels of a frame of full range and of a steady one on a synthetic street.\n"
    "  --size WxH        of the images (1242x375)\n"
    "  --disparities N   the range (128)\n"
    "  --rounds N        median of N rounds of five frames of each kind (3)\n"
    "  --threads N       compute units of PoCL (2)\n"
    "  --json FILE       write the rows\n"
    "  --count           time nothing; run a frame of each kind, and print which and how many cells it matched after "
    "it\n"
    "Rows: FRAME.STAGE.KERNEL. Columns: ms of a frame (median), with quartiles; launches; cells: that the frame "
    "matched.\n";

constexpr int kFramesARound = 5;

/// Times of a kernel, a frame each.
struct Kernel {
  int launches = 0;
  std::vector<double> ms;
};
using Kernels = std::map<std::string, Kernel>;

void add(const FrameTimes& times, const std::string& frame, Kernels& kernels) {
  std::map<std::string, std::pair<int, double>> sums;
  for (const CommandTime& command : times.commands) {
    if (!command.is_launch) continue;
    auto& [launches, ms] = sums[frame + "." + command.stage + "." + command.name];
    ++launches;
    ms += command.ms;
  }
  for (const auto& [name, sum] : sums) {
    kernels[name].launches = sum.first;
    kernels[name].ms.push_back(sum.second);
  }
}

double quartile(std::vector<double> values, int which) {
  std::sort(values.begin(), values.end());
  return values[which * (values.size() - 1) / 4];
}

std::vector<Row> rows_of(const Kernels& kernels, const StreetFrame& frame, shared::ImageSize size, int disparities) {
  std::vector<Row> rows;
  for (const auto& [name, kernel] : kernels) {
    const double cells = name.starts_with("full.") ? frame.full_range_cells() : frame.steady_cells();
    add_row({name,
             size,
             disparities,
             median(kernel.ms),
             {{"lower_ms", quartile(kernel.ms, 1)},
              {"upper_ms", quartile(kernel.ms, 3)},
              {"launches", static_cast<double>(kernel.launches)},
              {"cells", cells}}},
            rows);
  }
  return rows;
}

/// Seconds until a pipeline has all that its frames need.
double build_s(const Device& device, const Street& street, int disparities) {
  const auto start = std::chrono::steady_clock::now();
  PipelineOptions options;
  options.disparities = disparities;
  const Pipeline pipeline(street.calibration, street.size.width, street.size.height, options, device);
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// For tools that count what kernels do: one frame of each kind, and no other launch between the lines.
void run_once(StreetFrame& frame) {
  const auto tell = [](const char* what, double cells) {
    std::printf("frame %s %.0f\n", what, cells);
    std::fflush(stdout);
  };
  tell("none", 0);
  frame.full_range();
  tell("full", frame.full_range_cells());
  frame.steady();
  tell("steady", frame.steady_cells());
}

int run(int argc, char** argv) {
  const Arguments arguments = parse_arguments(argc, argv, kHelp, 3);
  const shared::ImageSize size = arguments.size.value_or(shared::ImageSize{1242, 375});
  const int disparities = arguments.disparities.value_or(128);
  const Device device = Device::select();
  const Street street = make_street(size, disparities);
  Machine machine{device.info(), 0, "a synthetic street", arguments.threads, {}};
  if (!arguments.counts) machine.more.emplace_back("build_s", build_s(device, street, disparities));
  ocl::Context context(device.handle().device);
  ocl::translated(context, [&] {
    // A tool that counts is no GPU, whatever it calls itself.
    StreetFrame frame(context, street, disparities, arguments.counts ? Scheduling::kWavefront : Scheduling::kAutomatic);
    if (arguments.counts) return run_once(frame);
    const Roofs roofs = roofs_of(context);
    machine.copy_gb_s = roofs.copy_gb_s;
    for (const auto& [name, value] : {std::pair{"min_add_g_s", roofs.min_add_g_s},
                                      {"popcount_g_s", roofs.popcount_g_s},
                                      {"launch_us", roofs.launch_us},
                                      {"enqueue_us", roofs.enqueue_us},
                                      {"local_gb_s", roofs.local_gb_s},
                                      {"barrier_ns", roofs.barrier_ns}}) {
      machine.more.emplace_back(name, value);
    }
    print_machine(machine);
    Kernels kernels;
    for (int i = 0; i < arguments.rounds * kFramesARound; ++i) {
      add(frame.full_range(), "full", kernels);
      add(frame.steady(), "steady", kernels);
    }
    const std::vector<Row> rows = rows_of(kernels, frame, size, disparities);
    if (!arguments.json.empty()) write_json(arguments.json, machine, rows);
  });
  return 0;
}

}  // namespace
}  // namespace egosgm::bench

int main(int argc, char** argv) { return egosgm::bench::guarded("egosgm_kernels", egosgm::bench::run, argc, argv); }
