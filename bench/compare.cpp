// SPDX-License-Identifier: Apache-2.0
// This library and OpenCV's four semi-global matchers on the same images, in one process, in turns.
#include <opencv2/core/version.hpp>

#include "bench/contenders.h"
#include "bench/turns.h"
#include "host/stages/maps.h"

namespace egosgm::bench {
namespace {

constexpr const char* kHelp =
    "egosgm_compare: this library and OpenCV's StereoSGBM modes on the same pair, in random turns, medians.\n"
    "  --size WxH        only this size (else 640x480, 1242x375, 1920x1080)\n"
    "  --disparities N   only this range (else 64, 128, 256, which take turns, too, but not at 1920x1080)\n"
    "  --rounds N        turns (11)\n"
    "  --set NAME=VALUE  also a banded frame with this option; repeat it for several\n"
    "  --threads N       of PoCL and of OpenCV (2); where it is more than one, all take turns with one thread, too: "
    "NAME_1t\n"
    "  --json FILE       write the rows\n"
    "  --benchmark_filter=REGEX and what else Google Benchmark knows\n"
    "opencv_*: left view, blockSize 5, P1 = 8*25, P2 = 32*25, disp12MaxDiff 1, nothing padded.\n"
    "egosgm_full_left: left view on the full range, eight paths, not checked, images up, disparity down.\n"
    "egosgm_full_both: both views on the full range by the default options, checked, upload to download.\n"
    "egosgm_banded_frame: a steady frame of the method by the default options, upload to download, motion given.\n"
    "egosgm_banded_left: the same with the left view tracked alone. egosgm_video_frame: a steady frame as a stream,\n"
    "with odometry. egosgm_video_objects: the same with objects that move by themselves and scene flow. The last four\n"
    "play KITTI 2012 000151, frames 07..11, from the start in each turn and give the mean of the last two frames.\n"
    "threads: how many a row may have. cpus: processor time of all threads by wall time, how many threads were at work "
    "in the mean; on a CPU only.\n";

void take_turn(benchmark::State& state, const Contender& contender) {
  for (auto _ : state) {
    const Turn turn = contender.turn();
    state.SetIterationTime(turn.seconds);
    for (const auto& [name, value] : turn.more) state.counters[name] = value;
  }
}

/// The device with all threads, and one compute unit of it with one thread, where it can be divided.
std::vector<Place> places(const Arguments& arguments) {
  const Device all = Device::select();
  std::vector<Place> list{{all, arguments.threads, ""}};
  if (arguments.threads > 1 && all.info().compute_units > 1) {
    try {
      list.push_back({all.compute_units(0, 0), 1, "_1t"});
    } catch (const std::exception& error) {
      std::printf("no rows of one thread: %s\n", error.what());
    }
  }
  return list;
}

/// All contenders at all `ranges` take turns.
void compare(const Clip& clip, const std::vector<int>& ranges, const std::vector<Place>& places,
             const Arguments& arguments, std::vector<Row>& rows) {
  const shared::ImageSize size{clip.frames.front().left.cols, clip.frames.front().left.rows};
  std::vector<std::pair<int, Contender>> list;
  for (const int disparities : ranges) {
    for (const Place& place : places) {
      for (Contender& contender : contenders(clip, disparities, arguments.settings, place))
        list.emplace_back(disparities, std::move(contender));
    }
  }
  for (const auto& entry : list) {
    const Contender& contender = entry.second;
    benchmark::RegisterBenchmark(benchmark_name(contender.name, size, entry.first).c_str(),
                                 [&contender](benchmark::State& state) { take_turn(state, contender); })
        ->UseManualTime()
        ->Iterations(1)
        ->Repetitions(arguments.rounds);
  }
  std::vector<Row> found;
  run_registered(found);
  for (const auto& [disparities, contender] : list) {  // turns were random, the table is not
    for (const Row& row : found) {
      if (row.name == contender.name && row.disparities == disparities) rows.push_back(row);
    }
  }
}

/// The ranges that take turns: all, but one after the other where all at once need much memory. At 1242x375 they take
/// 3.3 GB, and it grows with the pixels.
std::vector<std::vector<int>> turns_of(const std::vector<int>& ranges, shared::ImageSize size) {
  constexpr std::size_t kMostPixels = std::size_t{1} << 20;
  if (pixel_count(size) <= kMostPixels) return {ranges};
  std::vector<std::vector<int>> each;
  for (const int disparities : ranges) each.push_back({disparities});
  return each;
}

double counter(const Row& row, const char* name) {
  for (const auto& [key, value] : row.more) {
    if (key == name) return value;
  }
  return 0;
}

const Row* find(const std::vector<Row>& rows, const std::string& name, shared::ImageSize size, int disparities) {
  for (const Row& row : rows) {
    if (row.name == name && row.size.width == size.width && row.size.height == size.height &&
        row.disparities == disparities)
      return &row;
  }
  return nullptr;
}

void print_ratios(const std::vector<Row>& rows) {
  std::printf("\n%-23s %10s %5s %10s %6s %14s %14s\n", "", "size", "D", "ms", "cpus", "/ opencv_hh", "/ opencv_3way");
  for (const Row& row : rows) {
    std::printf("%-23s %5dx%-4d %5d %10.2f %6.2f", row.name.c_str(), row.size.width, row.size.height, row.disparities,
                row.median_ms, counter(row, "cpus"));
    // Of as many threads.
    const bool has_one = row.name.size() > 3 && row.name.compare(row.name.size() - 3, 3, "_1t") == 0;
    for (const std::string other : {"opencv_hh", "opencv_3way"}) {
      const Row* reference = find(rows, has_one ? other + "_1t" : other, row.size, row.disparities);
      if (reference) std::printf(" %14.3f", row.median_ms / reference->median_ms);
    }
    std::printf("\n");
  }
}

int run(int argc, char** argv) {
  const Arguments arguments = parse_turns(argc, argv, kHelp, 11, Turns::kRandom);
  const std::vector<Place> where = places(arguments);
  const std::vector<shared::ImageSize> all_sizes{{640, 480}, {1242, 375}, {1920, 1080}};
  const std::vector<int> all_ranges{64, 128, 256};
  Machine machine{where.front().device.info(), 0, {}, arguments.threads};
  std::vector<Row> rows;
  for (const shared::ImageSize size : arguments.size ? std::vector{*arguments.size} : all_sizes) {
    const Clip clip = load_clip({size.width, size.height});
    if (machine.input.empty()) {
      machine.input = clip.title + ", OpenCV " CV_VERSION;
      print_machine(machine);
      std::printf("%d threads allowed\n", arguments.threads);
    }
    const std::vector<int> ranges = arguments.disparities ? std::vector{*arguments.disparities} : all_ranges;
    for (const std::vector<int>& together : turns_of(ranges, size)) compare(clip, together, where, arguments, rows);
  }
  print_ratios(rows);
  if (!arguments.json.empty()) write_json(arguments.json, machine, rows);
  return rows.empty() ? 1 : 0;
}

}  // namespace
}  // namespace egosgm::bench

int main(int argc, char** argv) { return egosgm::bench::guarded("egosgm_compare", egosgm::bench::run, argc, argv); }
