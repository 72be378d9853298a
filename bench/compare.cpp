// SPDX-License-Identifier: Apache-2.0
// This library and OpenCV's four semi-global matchers on the same images, in one process, in turns.
#include <time.h>

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <opencv2/core/utility.hpp>

#include "bench/inputs.h"
#include "bench/opencv_matcher.h"
#include "bench/turns.h"
#include "egosgm/error.h"
#include "egosgm/named_options.h"
#include "egosgm/odometry.h"
#include "egosgm/pipeline.h"
#include "egosgm/vision/moving_objects.h"
#include "egosgm/vision/opencv.h"
#include "host/ocl/device_handle.h"
#include "host/stages/matcher.h"

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

using Clock = std::chrono::steady_clock;

/// What one turn of a contender gave.
struct Turn {
  double seconds = 0;
  std::map<std::string, double> more;
};

using TurnFunction = std::function<Turn()>;

struct Contender {
  std::string name;
  TurnFunction turn;
};

/// Made, and warmed up by a turn, when its first turn comes: what --benchmark_filter leaves out takes no memory.
TurnFunction when_needed(std::function<TurnFunction()> make) {
  return [make = std::move(make), turn = TurnFunction()]() mutable {
    if (!turn) {
      turn = make();
      turn();  // pays for what only a first turn costs
    }
    return turn();
  };
}

/// Wall time, and the processor time of all threads in it.
class Stopwatch {
 public:
  Turn turn(std::map<std::string, double> more, double parts = 1) const {
    const double seconds = std::chrono::duration<double>(Clock::now() - start_).count();
    more["cpus"] = (cpu_seconds() - cpu_start_) / seconds;
    return {seconds / parts, std::move(more)};
  }

 private:
  static double cpu_seconds() {
    timespec time{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  }

  Clock::time_point start_ = Clock::now();
  double cpu_start_ = cpu_seconds();
};

/// Where a contender runs: ours on a device, OpenCV on `threads`.
struct Place {
  Device device;
  int threads;
  std::string suffix;  // of its name
};

/// A pipeline with the maps that a caller takes from it.
class Matcher {
 public:
  Matcher(const Clip& clip, const MethodOptions& options, const Device& device)
      : pipeline_(clip.calibration, clip.frames.front().left.cols, clip.frames.front().left.rows, options, device),
        disparity_(clip.frames.front().left.size(), vision::kF32),
        variance_(disparity_.size(), vision::kF32),
        dynamic_(disparity_.size(), vision::kU8) {}

  FrameReport operator()(const ClipFrame& frame, const std::optional<Motion>& motion) {
    submit(frame, motion);
    return collect();
  }
  void submit(const ClipFrame& frame, const std::optional<Motion>& motion, bool wants_dynamic = false) {
    FrameOutputs outputs;
    outputs.disparity = vision::map_view(disparity_);
    outputs.variance = vision::map_view(variance_);
    if (wants_dynamic) outputs.debug.dynamic = {dynamic_.row(0), dynamic_.cols, dynamic_.rows, dynamic_.cols};
    pipeline_.submit(vision::image_view(frame.left), vision::image_view(frame.right), motion, outputs);
  }
  FrameReport collect() { return pipeline_.collect(); }

  /// Of the frame collected last.
  const vision::Image& disparity() const { return disparity_; }
  const vision::Image& dynamic() const { return dynamic_; }

  void reset() { pipeline_.reset(); }

  Turn turn(const Stopwatch& watch, const FrameReport& last, std::size_t frames = 1) const {
    double device_ms = 0;
    for (const StageTime& stage : last.stages) device_ms += stage.ms;
    return watch.turn({{"device_ms", device_ms},
                       {"search_fraction", last.search_fraction},
                       {"density", last.density},
                       {"launches", last.launches},
                       {"device_memory_bytes", static_cast<double>(pipeline_.device_memory_bytes())}},
                      static_cast<double>(frames));
  }

 private:
  Pipeline pipeline_;
  vision::Image disparity_, variance_, dynamic_;
};

TurnFunction opencv(const OpencvMode& mode, const Clip& clip, int disparities, int threads) {
  const auto matcher = make_opencv_matcher(mode.mode, disparities);
  const auto disparity = std::make_shared<cv::Mat>();
  return [&clip, matcher, disparity, threads] {
    const ClipFrame& frame = clip.frames.back();
    cv::setNumThreads(threads);
    const Stopwatch watch;
    matcher->compute(vision::mat_of(frame.left), vision::mat_of(frame.right), *disparity);
    return watch.turn({{"threads", cv::getNumThreads()}});
  };
}

/// Without a motion, as a frame that is not a clip's first: the vertical offset is known.
TurnFunction full_both(const Clip& clip, const MethodOptions& options, const Device& device) {
  const auto matcher = std::make_shared<Matcher>(clip, options, device);
  return [&clip, matcher] {
    const Stopwatch watch;
    const FrameReport report = (*matcher)(clip.frames.back(), std::nullopt);
    return matcher->turn(watch, report);
  };
}

TurnFunction banded_frame(const Clip& clip, const MethodOptions& options, const Device& device) {
  const auto matcher = std::make_shared<Matcher>(clip, options, device);
  return [&clip, matcher] {
    matcher->reset();
    for (std::size_t i = 0; i < Clip::kSteadyFrom; ++i) (*matcher)(clip.frames[i], clip.frames[i].motion);
    const Stopwatch watch;
    FrameReport report;
    for (std::size_t i = Clip::kSteadyFrom; i < clip.frames.size(); ++i) {
      report = (*matcher)(clip.frames[i], clip.frames[i].motion);
    }
    return matcher->turn(watch, report, clip.frames.size() - Clip::kSteadyFrom);
  };
}

/// As `egosgm run` does it: on the host, a frame's odometry, and the objects and scene flow of the one collected last,
/// while the device is at work.
class Stream {
 public:
  Stream(const Clip& clip, const MethodOptions& options, const Device& device, bool finds_objects)
      : clip_(clip),
        finds_objects_(finds_objects),
        matcher_(clip, options, device),
        odometry_(clip.calibration),
        tracker_(clip.calibration) {}

  Turn operator()() {
    matcher_.reset();
    odometry_.reset();
    tracker_ = vision::ObjectTracker(clip_.calibration);
    std::vector<std::optional<Motion>> motions;
    Stopwatch steady;
    for (std::size_t i = 0; i < clip_.frames.size(); ++i) {
      motions.push_back(estimate(clip_.frames[i]));
      matcher_.submit(clip_.frames[i], motions[i], finds_objects_);
      if (i == 0) continue;
      matcher_.collect();
      follow(clip_.frames[i - 1], motions[i - 1]);
      if (i == Clip::kSteadyFrom) steady = Stopwatch();  // after the host's work for the first one measured,
    }
    estimate(clip_.frames[Clip::kSteadyFrom]);  // and therefore with that of the one after the last
    const FrameReport last = matcher_.collect();
    follow(clip_.frames.back(), motions.back());
    return matcher_.turn(steady, last, clip_.frames.size() - Clip::kSteadyFrom);
  }

 private:
  std::optional<Motion> estimate(const ClipFrame& frame) {
    return odometry_.process(vision::image_view(frame.left), vision::image_view(frame.right)).motion;
  }
  void follow(const ClipFrame& frame, const std::optional<Motion>& motion) {
    if (!finds_objects_) return;
    tracker_.process(frame.left, matcher_.disparity(), matcher_.dynamic(), motion);
    tracker_.scene_flow();
  }

  const Clip& clip_;
  const bool finds_objects_;
  Matcher matcher_;
  StereoOdometry odometry_;
  vision::ObjectTracker tracker_;
};

template <bool finds_objects>
TurnFunction video_frame(const Clip& clip, const MethodOptions& options, const Device& device) {
  const auto stream = std::make_shared<Stream>(clip, options, device, finds_objects);
  return [stream] { return (*stream)(); };
}

/// Census to disparity of the left view over the full range, eight paths, as OpenCV's modes do it: images up, disparity
/// down.
class LeftMatcher {
 public:
  LeftMatcher(const Clip& clip, const MethodOptions& options, const Device& device)
      : size_{clip.frames.back().left.cols, clip.frames.back().left.rows},
        range_{options.min_disparity, options.disparities},
        context_(device.handle().device),
        matcher_(context_, size_, range_, options.banded_sgm),
        everything_(context_, size_, range_),
        images_{ocl::Buffer<cl_uchar>(context_, 2 * pixel_count(size_)), PixelType::kU8},
        measured_(context_, size_),
        disparity_(pixel_count(size_)) {
    for (const vision::Image* view : {&clip.frames.back().left, &clip.frames.back().right}) {
      for (int y = 0; y < view->rows; ++y) pixels_.insert(pixels_.end(), view->row(y), view->row(y) + view->cols);
    }
    matcher_.prepare(images_.type);
  }

  void operator()() {
    images_.pixels.write(context_, pixels_);
    matcher_.match(images_, everything_, measured_, Views::kLeft);
    const ocl::Drain drain{context_};
    cl::Event done;
    context_.queue().enqueueReadBuffer(measured_.disparity.get(), CL_FALSE, 0, disparity_.size() * sizeof(float),
                                       disparity_.data(), nullptr, &done);
    context_.record(done, "read");
    context_.wait();
  }

 private:
  const shared::ImageSize size_;
  const shared::DisparityRange range_;
  ocl::Context context_;
  egosgm::Matcher matcher_;
  const SearchBands everything_;
  FrameImages images_;
  StereoMaps measured_;
  std::vector<cl_uchar> pixels_;
  std::vector<float> disparity_;
};

TurnFunction full_left(const Clip& clip, MethodOptions options, const Device& device) {
  options.banded_sgm.paths = 8;
  const auto matcher = std::make_shared<LeftMatcher>(clip, options, device);
  return [matcher] {
    const Stopwatch watch;
    (*matcher)();
    return watch.turn({});
  };
}

MethodOptions with(MethodOptions options, const std::string& setting) {
  const std::size_t equals = setting.find('=');
  if (equals == std::string::npos) throw InvalidArgument("--set " + setting + ": write NAME=VALUE");
  PipelineOptions chosen = options;
  set_option(chosen, setting.substr(0, equals), setting.substr(equals + 1));
  return chosen;
}

std::vector<Contender> contenders(const Clip& clip, int disparities, const std::vector<std::string>& settings,
                                  const Place& place) {
  MethodOptions options;
  options.disparities = disparities;
  std::vector<Contender> list;
  const auto add = [&](const std::string& name, std::function<TurnFunction()> make) {
    list.push_back({name + place.suffix, when_needed(std::move(make))});
  };
  const auto add_ours = [&](const std::string& name, const MethodOptions& of, auto kind) {
    add(name, [&clip, of, kind, device = place.device]() -> TurnFunction {
      return [turn = kind(clip, of, device), units = device.info().compute_units] {
        Turn result = turn();
        result.more.try_emplace("threads", units);
        return result;
      };
    });
  };
  for (const OpencvMode& mode : kOpencvModes) {
    add(mode.name,
        [&clip, &mode, disparities, threads = place.threads] { return opencv(mode, clip, disparities, threads); });
  }
  add_ours("egosgm_full_left", options, full_left);
  add_ours("egosgm_full_both", options, full_both);
  add_ours("egosgm_banded_frame", options, banded_frame);
  add_ours("egosgm_banded_left", with(options, "track_right=false"), banded_frame);
  for (const std::string& setting : settings) {
    add_ours("egosgm_banded_frame " + setting, with(options, setting), banded_frame);
  }
  add_ours("egosgm_video_frame", options, video_frame<false>);
  add_ours("egosgm_video_objects", options, video_frame<true>);
  return list;
}

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
