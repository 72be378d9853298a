// SPDX-License-Identifier: Apache-2.0
// Stereo odometry alone, frame by frame on one thread, and its steps.
#include "egosgm/odometry.h"

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "bench/turns.h"
#include "egosgm/vision/dataset.h"
#include "egosgm/vision/image.h"
#include "egosgm/vision/synthetic.h"

namespace egosgm::bench {
namespace {

constexpr const char* kHelp =
    "egosgm_odometry: a frame of stereo odometry, on one thread, on KITTI's excerpt odometry/sequences/A below "
    "$EGOSGM_DATA or ../shared/data beside the project, else on a synthetic street of 1226x370.\n"
    "  --rounds N        median of N turns through the sequence (5)\n"
    "  --json FILE       write the row\n"
    "ms: mean of the frames with a motion; the steps beside it, likewise.\n";

struct Video {
  std::string title;
  Calibration calibration;
  std::vector<vision::StereoImages> frames;
};

Video load_video() {
  const char* data = std::getenv("EGOSGM_DATA");
  const std::filesystem::path folder =
      std::filesystem::path(data ? data : EGOSGM_SOURCE_DIR "/../shared/data") / "odometry/sequences/A";
  Video video;
  if (std::filesystem::exists(folder)) {
    const vision::StereoSequence sequence = vision::open_kitti_odometry(folder);
    video.title = sequence.title;
    video.calibration = sequence.calibration;
    for (const vision::StereoFrame& frame : sequence.frames) video.frames.push_back(vision::read_images(frame));
    return video;
  }
  vision::SyntheticOptions options;
  options.frames = 6;
  options.width = 1226;
  options.height = 370;
  const vision::SyntheticSequence street(options);
  video.title = "synthetic street";
  video.calibration = street.calibration();
  for (int k = 0; k < street.frames(); ++k) {
    const vision::SyntheticFrame frame = street.render(k);
    video.frames.push_back({frame.left, frame.right});
  }
  return video;
}

void play(benchmark::State& state, const Video& video) {
  for (auto _ : state) {
    StereoOdometry odometry(video.calibration);
    OdometryTimes sums;
    int motions = 0;
    for (const vision::StereoImages& images : video.frames) {
      const auto result = odometry.process(vision::image_view(images.left), vision::image_view(images.right));
      if (!result.motion) continue;
      ++motions;
      sums.features += result.times_ms.features;
      sums.rough_motion += result.times_ms.rough_motion;
      sums.matching += result.times_ms.matching;
      sums.motion += result.times_ms.motion;
      sums.learning += result.times_ms.learning;
    }
    if (motions == 0) {
      state.SkipWithError("no motion in any frame");
      return;
    }
    const double total = sums.features + sums.rough_motion + sums.matching + sums.motion + sums.learning;
    state.SetIterationTime(total / motions / 1000);
    state.counters["features_ms"] = sums.features / motions;
    state.counters["rough_motion_ms"] = sums.rough_motion / motions;
    state.counters["matching_ms"] = sums.matching / motions;
    state.counters["motion_ms"] = sums.motion / motions;
    state.counters["learning_ms"] = sums.learning / motions;
  }
}

int run(int argc, char** argv) {
  const Arguments arguments = parse_turns(argc, argv, kHelp, 5, Turns::kOneAfterAnother);
  const Video video = load_video();
  const shared::ImageSize size{video.frames.front().left.cols, video.frames.front().left.rows};
  benchmark::RegisterBenchmark(benchmark_name("odometry_frame", size, 0).c_str(),
                               [&video](benchmark::State& state) { play(state, video); })
      ->UseManualTime()
      ->Iterations(1)
      ->Repetitions(arguments.rounds);
  std::vector<Row> rows;
  run_registered(rows);
  for (const Row& row : rows) {
    std::printf("%s, %zu frames of %dx%d: %.2f ms a frame\n", video.title.c_str(), video.frames.size(), size.width,
                size.height, row.median_ms);
    for (const auto& [name, value] : row.more) std::printf("  %-16s %6.2f\n", name.c_str(), value);
  }
  Machine machine;
  machine.device.name = "host";
  machine.input = video.title;
  machine.threads = 1;
  if (!arguments.json.empty()) write_json(arguments.json, machine, rows);
  return rows.empty() ? 1 : 0;
}

}  // namespace
}  // namespace egosgm::bench

int main(int argc, char** argv) { return egosgm::bench::guarded("egosgm_odometry", egosgm::bench::run, argc, argv); }
