// SPDX-License-Identifier: Apache-2.0
// The stages of a steady frame as it runs: device time, bytes moved, and their share of what a copy reaches.
#include <cstdio>
#include <fstream>
#include <map>
#include <utility>

#include "bench/report.h"
#include "bench/roofs.h"
#include "bench/street_frame.h"
#include "egosgm/error.h"
#include "host/ocl/device_handle.h"
#include "host/ocl/errors.h"

namespace egosgm::bench {
namespace {

constexpr const char* kHelp =
    "egosgm_stages: the stages of a steady frame on a synthetic street, as a pipeline with default options runs them.\n"
    "  --size WxH        only this size (else 640x480, 1242x375, 1920x1080)\n"
    "  --disparities N   only this range (else 64, 128, 256)\n"
    "  --rounds N        median of N rounds of five frames (3)\n"
    "  --threads N       compute units of PoCL (2)\n"
    "  --json FILE       write the rows\n"
    "  --bits FILE       hold the maps against checksums that were recorded on another device: exit code 1 where they "
    "differ\n"
    "Rows: a stage each, step_NAME for a step (with what the host does there), BandedSgm_full of a frame of full "
    "range,\n"
    "steady_frame and full_frame for all stages of one.\n"
    "Columns: ms and device_ms: of a frame, the former by the wall clock for steps; GB_s: every map, image and band "
    "that a\n"
    "stage takes or gives counted once (no re-reads, no memory of its own but the path sums of BandedSgm: a byte a\n"
    "computed cell written and read), by device time; of_copy: the same as part of a copy's GB/s; Gcells_s: cells "
    "that\n"
    "are matched.\n";

constexpr int kFramesARound = 5;
/// Bytes that each stage must move in a steady frame that matches so many cells.
std::map<std::string, double> bytes_of(shared::ImageSize size, double cells) {
  const double pixels = static_cast<double>(pixel_count(size));  // of a view; maps of both have every second row
  const double map = 4 * pixels, maps = 2 * map / 2, band = 12 * pixels, codes = 8 * pixels, grey = 2 * pixels;
  return {{"ForwardWarp", 4 * maps},
          {"HoleFill", 8 * maps},
          {"ConsistencyCheck", 3 * 2 * maps},
          {"CoarseMatch", grey},
          {"SearchBand", 2 * (maps + band)},
          // Resampling both images, and the estimate on every fourth row of the left view.
          {"VerticalAlignment", 2 * grey + (grey + map) / 4},
          {"Census", grey + codes},
          {"StepPenalties", grey + 8 * pixels},
          {"BandedSgm", 2 * (2 * (codes + band) + maps + cells)},
          {"MedianFilter", 2 * maps},
          {"WeightedMedian", 4 * maps + grey},
          {"RowInterpolation", 6 * map},
          {"SpeckleRemoval", 2 * map},
          // Both views' codes, prediction and measurement, those of a quarter, and what is given out of the left view.
          {"Evidence", codes * 17 / 16 + 2 * maps + 2 * map},
          {"TexturelessRegions", grey / 2 + map},
          {"KalmanUpdate", 6 * maps},
          {"OutputVariance", 12 * map}};
}

double full_range_bytes_of(shared::ImageSize size, double cells) {
  return (2 * (8 + 2 * 12) + 16) * static_cast<double>(pixel_count(size)) + 2 * cells;
}

Row row_of(const std::string& name, shared::ImageSize size, int disparities, double ms) {
  Row row;
  row.name = name;
  row.size = size;
  row.disparities = disparities;
  row.median_ms = ms;
  return row;
}

/// Checksums by what they are of: "WIDTHxHEIGHT D".
std::map<std::string, std::string> read_bits(const std::string& file) {
  std::ifstream stream(file);
  if (!stream) throw IoError("--bits " + file + ": cannot be read");
  std::map<std::string, std::string> recorded;
  for (std::string size, disparities, bits; stream >> size >> disparities >> bits;)
    recorded[size + " " + disparities] = bits;
  return recorded;
}

/// Whether the maps are those that were recorded, or none were.
bool check_bits(const std::string& of, const std::string& bits, const std::map<std::string, std::string>& recorded) {
  const auto found = recorded.find(of);
  const bool differs = found != recorded.end() && found->second != bits;
  std::printf("bits %s %s: %s\n", of.c_str(), bits.c_str(),
              found == recorded.end() ? "none were recorded"
              : differs               ? "NOT those that were recorded"
                                      : "those that were recorded");
  return !differs;
}

/// Whether the maps are those that were recorded.
bool run_frames(const Device& device, shared::ImageSize size, int disparities, const Arguments& arguments,
                double copy_gb_s, const std::map<std::string, std::string>& recorded, std::vector<Row>& rows) {
  ocl::Context context(device.handle().device);
  return ocl::translated(context, [&] {
    StreetFrame frame(context, make_street(size, disparities), disparities);
    const FrameTimes full_range = frame.full_range();
    std::map<std::string, std::vector<double>> device_ms, wall_ms;
    std::vector<double> frame_ms;
    for (int i = 0; i < arguments.rounds * kFramesARound; ++i) {
      const FrameTimes& times = frame.steady();
      for (const auto& [stage, ms] : times.device) device_ms[stage].push_back(ms);
      for (const auto& [step, ms] : times.wall) wall_ms[step].push_back(ms);
      frame_ms.push_back(times.device_ms());
    }
    const std::map<std::string, double> bytes = bytes_of(size, frame.steady_cells());
    for (const auto& [stage, all] : device_ms) {
      const double ms = median(all);
      Row row = row_of(stage, size, disparities, ms);
      const double gb_s = 1e-6 * bytes.at(stage) / ms;
      row.more = {{"device_ms", ms}, {"GB_s", gb_s}, {"of_copy", gb_s / copy_gb_s}};
      if (stage == "BandedSgm") row.more.emplace_back("Gcells_s", 1e-6 * frame.steady_cells() / ms);
      add_row(std::move(row), rows);
    }
    const double full_ms = full_range.device.at("BandedSgm");
    Row full = row_of("BandedSgm_full", size, disparities, full_ms);
    const double full_gb_s = 1e-6 * full_range_bytes_of(size, frame.full_range_cells()) / full_ms;
    full.more = {{"device_ms", full_ms},
                 {"GB_s", full_gb_s},
                 {"of_copy", full_gb_s / copy_gb_s},
                 {"Gcells_s", 1e-6 * frame.full_range_cells() / full_ms}};
    add_row(std::move(full), rows);
    for (const auto& [step, all] : wall_ms) add_row(row_of("step_" + step, size, disparities, median(all)), rows);
    add_row(row_of("full_frame", size, disparities, full_range.device_ms()), rows);
    add_row(row_of("steady_frame", size, disparities, median(frame_ms)), rows);
    return check_bits(
        std::to_string(size.width) + "x" + std::to_string(size.height) + " " + std::to_string(disparities),
        frame.bits(), recorded);
  });
}

int run(int argc, char** argv) {
  const Arguments arguments = parse_arguments(argc, argv, kHelp, 3);
  const auto recorded = arguments.bits.empty() ? std::map<std::string, std::string>() : read_bits(arguments.bits);
  const Device device = Device::select();
  Machine machine{device.info(), 0, "a synthetic street", arguments.threads};
  {
    ocl::Context context(device.handle().device);
    machine.copy_gb_s = ocl::translated(context, [&] { return copy_gb_s(context); });
  }
  print_machine(machine);
  const std::vector<shared::ImageSize> all_sizes{{640, 480}, {1242, 375}, {1920, 1080}};
  const std::vector<int> all_ranges{64, 128, 256};
  bool is_same = true;
  std::vector<Row> rows;
  for (const shared::ImageSize size : arguments.size ? std::vector{*arguments.size} : all_sizes) {
    for (const int disparities : arguments.disparities ? std::vector{*arguments.disparities} : all_ranges) {
      if (!run_frames(device, size, disparities, arguments, machine.copy_gb_s, recorded, rows)) is_same = false;
      if (!arguments.json.empty()) write_json(arguments.json, machine, rows);  // it may be stopped
    }
  }
  return rows.empty() || !is_same ? 1 : 0;
}

}  // namespace
}  // namespace egosgm::bench

int main(int argc, char** argv) { return egosgm::bench::guarded("egosgm_stages", egosgm::bench::run, argc, argv); }
