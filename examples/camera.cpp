// SPDX-License-Identifier: Apache-2.0
// Disparity from a live stereo camera that gives both views side by side (ZED, and most USB stereo cameras), or from
// such a video, played at its own speed. A frame that comes while the last one is matched replaces the one that waits:
// frames are dropped, and what is shown is never late. The images must be rectified (`egosgm doctor` tells). camera
// NUMBER|VIDEO CALIBRATION [DISPARITIES]: a window where there is a display; else it prints what it would show
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <mutex>
#include <opencv2/highgui.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "egosgm/named_options.h"
#include "egosgm/odometry.h"
#include "egosgm/pipeline.h"
#include "egosgm/vision/calibration_io.h"
#include "egosgm/vision/opencv.h"
#include "egosgm/vision/render.h"

namespace {

using Clock = std::chrono::steady_clock;
constexpr const char* kWindow = "EgoSGM: q quits";

/// Reads in a thread of its own, as fast as frames come, and keeps only the newest.
class NewestFrame {
 public:
  explicit NewestFrame(const std::string& source) {
    const bool camera = source.find_first_not_of("0123456789") == std::string::npos;
    if (!(camera ? video_.open(static_cast<int>(std::strtol(source.c_str(), nullptr, 10))) : video_.open(source))) {
      throw std::invalid_argument(source + ": no camera or video that OpenCV can open");
    }
    if (!camera) seconds_per_frame_ = 1 / std::max(1.0, video_.get(cv::CAP_PROP_FPS));
    thread_ = std::thread([this] { read(); });
  }
  ~NewestFrame() {
    stop_ = true;
    thread_.join();
  }

  /// Waits for a frame that was not taken yet; none: the source has ended.
  std::optional<cv::Mat> take() {
    std::unique_lock lock(mutex_);
    arrived_.wait(lock, [this] { return newest_ || ended_; });
    return std::exchange(newest_, std::nullopt);
  }

  int dropped() const { return dropped_; }

 private:
  void read() {
    const Clock::time_point start = Clock::now();
    cv::Mat frame;
    for (int i = 0; !stop_ && video_.read(frame); ++i) {
      // A camera waits by itself.
      std::this_thread::sleep_until(
          start + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(i * seconds_per_frame_)));
      const std::lock_guard lock(mutex_);
      dropped_ += newest_.has_value();
      newest_ = frame.clone();
      arrived_.notify_one();
    }
    const std::lock_guard lock(mutex_);
    ended_ = true;
    arrived_.notify_one();
  }

  cv::VideoCapture video_;
  double seconds_per_frame_ = 0;
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::optional<cv::Mat> newest_;
  bool ended_ = false;
  std::atomic<bool> stop_{false};
  std::atomic<int> dropped_{0};
  std::thread thread_;
};

/// Frames per second over the last frames.
class Rate {
 public:
  double tick() {
    const Clock::time_point now = Clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    mean_s_ = mean_s_ == 0 ? seconds : 0.9 * mean_s_ + 0.1 * seconds;
    return 1 / mean_s_;
  }

 private:
  Clock::time_point last_ = Clock::now();
  double mean_s_ = 0;
};

/// Shows the picture with its text. Whether to go on.
bool show(cv::Mat picture, const std::string& text, bool display) {
  std::printf("%s\n", text.c_str());
  if (!display) return true;
  cv::putText(picture, text, {8, 24}, cv::FONT_HERSHEY_SIMPLEX, 0.6, {255, 255, 255}, 1, cv::LINE_AA);
  cv::imshow(kWindow, picture);
  return cv::waitKey(1) != 'q';
}

void run(const std::string& source, const egosgm::Calibration& calibration, const egosgm::PipelineOptions& options) {
  using namespace egosgm;
  const bool display = std::getenv("DISPLAY") || std::getenv("WAYLAND_DISPLAY");
  NewestFrame newest(source);
  std::optional<Pipeline> pipeline;
  std::optional<StereoOdometry> odometry;
  cv::Mat grey;
  Rate rate;
  int matched = 0;
  while (const std::optional<cv::Mat> both = newest.take()) {
    cv::cvtColor(*both, grey, cv::COLOR_BGR2GRAY);
    const int width = grey.cols / 2;
    if (!pipeline) {
      pipeline.emplace(calibration, width, grey.rows, options);
      odometry.emplace(calibration);
    }
    const cv::Mat left = grey.colRange(0, width), right = grey.colRange(width, 2 * width);  // no copies
    const auto motion = odometry->process(vision::image_view(left), vision::image_view(right)).motion;
    const cv::Mat disparity = vision::process(*pipeline, left, right, motion).disparity;
    ++matched;
    const std::string text = cv::format("frame %d  %.1f frames/s  %d dropped", matched, rate.tick(), newest.dropped());
    const vision::Image picture =
        vision::color_disparity(vision::image_of(disparity), {0, static_cast<double>(options.disparities)});
    if (!show(vision::mat_of(picture), text, display)) break;
  }
  std::printf("%d matched, %d dropped\n", matched, newest.dropped());
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 3) return std::fprintf(stderr, "usage: camera NUMBER|VIDEO CALIBRATION [DISPARITIES]\n"), 2;
  egosgm::PipelineOptions options;
  if (argc > 3) egosgm::set_option(options, "disparities", argv[3]);
  run(argv[1], egosgm::vision::read_calibration(argv[2]), options);
} catch (const std::exception& error) {
  std::fprintf(stderr, "camera: %s\n", error.what());
  return 1;
}
