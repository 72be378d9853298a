// SPDX-License-Identifier: Apache-2.0
#include "bench/contenders.h"

#include <time.h>

#include <chrono>
#include <memory>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/utility.hpp>

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

using Clock = std::chrono::steady_clock;

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

struct OpencvMode {
  const char* name;
  int mode;
};

/// Eight paths, four, five, three; only the first two keep costs of the whole image.
constexpr OpencvMode kOpencvModes[] = {{"opencv_hh", cv::StereoSGBM::MODE_HH},
                                       {"opencv_hh4", cv::StereoSGBM::MODE_HH4},
                                       {"opencv_sgbm", cv::StereoSGBM::MODE_SGBM},
                                       {"opencv_3way", cv::StereoSGBM::MODE_SGBM_3WAY}};

/// With the penalties that OpenCV's documentation gives and the other settings of its sample stereo_match, but without
/// speckle removal.
TurnFunction opencv(const OpencvMode& mode, const Clip& clip, int disparities, int threads) {
  constexpr int kBlock = 5, kDisp12MaxDiff = 1, kPreFilterCap = 63, kUniquenessRatio = 10;
  const cv::Ptr<cv::StereoSGBM> matcher = cv::StereoSGBM::create(
      /*minDisparity=*/0, (disparities + 15) / 16 * 16, kBlock, 8 * kBlock * kBlock, 32 * kBlock * kBlock,
      kDisp12MaxDiff, kPreFilterCap, kUniquenessRatio, /*speckleWindowSize=*/0, /*speckleRange=*/0, mode.mode);
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

}  // namespace

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

}  // namespace egosgm::bench
