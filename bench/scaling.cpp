// SPDX-License-Identifier: Apache-2.0
// How time and device memory grow: with the image, with the disparity range, with the band, and with compute units.
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "bench/report.h"
#include "bench/street.h"
#include "egosgm/error.h"
#include "egosgm/pipeline.h"
#include "host/method_options.h"

namespace egosgm::bench {
namespace {

constexpr const char* kHelp =
    "egosgm_scaling: a frame, both views, upload to download, on a synthetic street before a standing camera.\n"
    "full_both matches the full range, banded_frame is a steady frame of the method.\n"
    "  --sweep NAME      only this one of:\n"
    "                    pixels       0.1 to 8.3 Mpx, D = 128\n"
    "                    disparities  D = 32 to 1024, 1242x375\n"
    "                    band         least half-width 1 to 64 px, D = 128, 1242x375: the search fraction follows\n"
    "                    units        1 and 2 compute units, each in a process of its own (POCL_MAX_PTHREAD_COUNT)\n"
    "  --rounds N        a figure is the median of N frames (5)\n"
    "  --threads N       compute units of PoCL in the other sweeps (2)\n"
    "  --json FILE       write the rows: names SWEEP_full_both, SWEEP_banded_frame\n"
    "  --benchmark_filter=REGEX and what else Google Benchmark knows\n";

constexpr shared::ImageSize kKittiSize{1242, 375};

struct Point {
  std::string name;
  shared::ImageSize size = kKittiSize;
  MethodOptions options;
  std::optional<Motion> motion = Motion{};
};

/// A pipeline with a pair that it sees again and again, and where its maps go.
class Steady {
 public:
  Steady(const Point& point, const Device& device)
      : street_(make_street(point.size, point.options.disparities)),
        pipeline_(street_.calibration, point.size.width, point.size.height, point.options, device),
        motion_(point.motion),
        disparity_(static_cast<std::size_t>(point.size.width) * point.size.height),
        variance_(disparity_.size()) {
    for (int i = 0; i < 4; ++i) frame();  // finds the rows' offset, then the prediction, then its variance
  }

  FrameReport frame() {
    FrameOutputs outputs;
    outputs.disparity = view(disparity_);
    outputs.variance = view(variance_);
    return pipeline_.process(street_.view(EGOSGM_LEFT), street_.view(EGOSGM_RIGHT), motion_, outputs);
  }

  double memory_bytes() const { return static_cast<double>(pipeline_.device_memory_bytes()); }

 private:
  MapView<float> view(std::vector<float>& map) {
    return {map.data(), street_.size.width, street_.size.height,
            static_cast<std::ptrdiff_t>(street_.size.width * sizeof(float))};
  }

  Street street_;
  Pipeline pipeline_;
  const std::optional<Motion> motion_;
  std::vector<float> disparity_, variance_;
};

void measure(const Point& point, const Device& device, int rounds, std::vector<Row>& rows) {
  std::unique_ptr<Steady> steady;
  try {
    steady = std::make_unique<Steady>(point, device);
  } catch (const BuildError&) {
    throw;
  } catch (const DeviceError& error) {  // too large for this device
    std::printf("%s %dx%d D %d: %s\n", point.name.c_str(), point.size.width, point.size.height,
                point.options.disparities, error.what());
    return;
  }
  const auto frames = [&](benchmark::State& state) {
    double device_ms = 0;
    FrameReport report;
    for (auto _ : state) {
      report = steady->frame();
      for (const StageTime& stage : report.stages) device_ms += stage.ms;
    }
    state.counters["device_ms"] = benchmark::Counter(device_ms, benchmark::Counter::kAvgIterations);
    state.counters["search_fraction"] = report.search_fraction;
    state.counters["device_memory_bytes"] = steady->memory_bytes();
    state.counters["compute_units"] = device.info().compute_units;
    state.counters["half_width_px"] = point.options.search_band.min_half_width_px;
  };
  benchmark::RegisterBenchmark(benchmark_name(point.name, point.size, point.options.disparities).c_str(), frames)
      ->UseRealTime()
      ->Iterations(1)
      ->Repetitions(rounds);
  run_registered(rows);
}

void add_both(const std::string& sweep, Point point, std::vector<Point>& points) {
  point.name = sweep + "_banded_frame";
  points.push_back(point);
  point.name = sweep + "_full_both";
  point.motion.reset();
  points.push_back(point);
}

std::vector<Point> pixels_sweep() {
  std::vector<Point> points;
  for (const double megapixels : {0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.2944}) {
    const double height = std::sqrt(megapixels * 1e6 * 9 / 16);
    Point point;
    point.size = {static_cast<int>(std::lround(height * 16 / 9)), static_cast<int>(std::lround(height))};
    add_both("pixels", point, points);
  }
  return points;
}

std::vector<Point> disparities_sweep() {
  std::vector<Point> points;
  for (int disparities = 32; disparities <= 1024; disparities *= 2) {
    Point point;
    point.options.disparities = disparities;
    add_both("disparities", point, points);
  }
  return points;
}

std::vector<Point> band_sweep() {
  std::vector<Point> points;
  for (int half_width_px = 1; half_width_px <= 64; half_width_px *= 2) {
    Point point;
    point.name = "band_banded_frame";
    point.options.search_band.min_half_width_px = static_cast<float>(half_width_px);
    points.push_back(point);
  }
  return points;
}

std::vector<Row> measure_all(const std::vector<Point>& points, int rounds) {
  const Device device = Device::select();
  std::vector<Row> rows;
  for (const Point& point : points) measure(point, device, rounds, rows);
  return rows;
}

std::string text_of(const std::vector<Row>& rows) {
  std::ostringstream text;
  for (const Row& row : rows) {
    text << row.name << ' ' << row.size.width << ' ' << row.size.height << ' ' << row.disparities << ' '
         << row.median_ms << ' ' << row.more.size();
    for (const auto& [name, value] : row.more) text << ' ' << name << ' ' << value;
    text << '\n';
  }
  return text.str();
}

std::vector<Row> rows_of(const std::string& text) {
  std::istringstream stream(text);
  std::vector<Row> rows;
  Row row;
  std::size_t counters = 0;
  while (stream >> row.name >> row.size.width >> row.size.height >> row.disparities >> row.median_ms >> counters) {
    row.more.resize(counters);
    for (auto& [name, value] : row.more) stream >> name >> value;
    rows.push_back(row);
  }
  return rows;
}

/// Measures in a child with so many compute units: PoCL counts its threads once a process.
/// REQUIRES: this process has not touched OpenCL.
std::vector<Row> measure_with_units(int units, int rounds) {
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error(std::string("pipe: ") + std::strerror(errno));
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error(std::string("fork: ") + std::strerror(errno));
  if (child == 0) {
    close(ends[0]);
    for (const char* variable : {"POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT"})
      setenv(variable, std::to_string(units).c_str(), 1);
    std::vector<Point> points;
    add_both("units", Point{}, points);
    int status = 1;
    try {
      const std::string text = text_of(measure_all(points, rounds));
      status = write(ends[1], text.data(), text.size()) == static_cast<ssize_t>(text.size()) ? 0 : 1;
    } catch (const std::exception& error) {
      std::fprintf(stderr, "egosgm_scaling, %d compute units: %s\n", units, error.what());
    }
    std::fflush(stdout);
    _exit(status);  // the parent's exit handlers are not the child's
  }
  close(ends[1]);
  std::string text;
  char buffer[4096];
  for (ssize_t count; (count = read(ends[0], buffer, sizeof buffer)) > 0;)
    text.append(buffer, static_cast<std::size_t>(count));
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (status != 0) throw std::runtime_error("the child with " + std::to_string(units) + " compute units failed");
  return rows_of(text);
}

int run(int argc, char** argv) {
  const Arguments arguments = parse_arguments(argc, argv, kHelp, 5);
  const auto wanted = [&](const char* sweep) { return arguments.sweep.empty() || arguments.sweep == sweep; };
  std::vector<Row> rows;
  if (wanted("units")) {  // first: see measure_with_units
    for (const int units : {1, 2}) {
      for (const Row& row : measure_with_units(units, arguments.rounds)) rows.push_back(row);
    }
  }
  std::vector<Point> points;
  const auto add = [&](const char* sweep, const std::vector<Point>& more) {
    if (wanted(sweep)) points.insert(points.end(), more.begin(), more.end());
  };
  add("pixels", pixels_sweep());
  add("disparities", disparities_sweep());
  add("band", band_sweep());
  for (const Row& row : measure_all(points, arguments.rounds)) rows.push_back(row);
  if (rows.empty()) throw InvalidArgument("--sweep " + arguments.sweep + ": choose pixels, disparities, band or units");

  const Machine machine{Device::select().info(), 0, "a synthetic street, standing camera", arguments.threads};
  print_machine(machine);
  if (!arguments.json.empty()) write_json(arguments.json, machine, rows);
  return 0;
}

}  // namespace
}  // namespace egosgm::bench

int main(int argc, char** argv) { return egosgm::bench::guarded("egosgm_scaling", egosgm::bench::run, argc, argv); }
