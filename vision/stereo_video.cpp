// SPDX-License-Identifier: Apache-2.0
#include "vision/stereo_video.h"

#include <utility>

#include "egosgm/error.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {
namespace {

using Clock = std::chrono::steady_clock;

std::string text_of(Size size) { return std::to_string(size.width) + "x" + std::to_string(size.height); }

}  // namespace

StereoVideo::StereoVideo(MotionSource& motions, Pipeline& pipeline, StereoVideoOptions options, FrameSource* source)
    : motions_(motions),
      pipeline_(pipeline),
      options_(std::move(options)),
      source_(source),
      input_check_(options_.calibration, pipeline.options()),
      has_odometry_(motions.has_odometry()) {}

StereoVideo::~StereoVideo() {
  if (ahead_.valid()) ahead_.wait();
  try {
    while (pipeline_.under_way() > 0) pipeline_.collect();
  } catch (const Error&) {  // they are dropped
  }
}

void StereoVideo::add(VideoPair pair) {
  VideoFrame frame;
  frame.pair = std::move(pair);
  ++pairs_;
  try {
    if (frame.pair.unreadable.empty()) find_motion(frame);
    take(std::move(frame));
  } catch (const std::exception&) {
    end(std::current_exception());
  }
}

void StereoVideo::end(std::exception_ptr failure) {
  if (ahead_.valid()) ahead_.wait();
  is_ended_ = true;
  failure_ = std::move(failure);
}

std::optional<VideoFrame> StereoVideo::next() {
  while (source_ && is_open()) {
    try {
      ask_source();
    } catch (const std::exception&) {
      end(std::current_exception());
    }
  }
  if (unreadable_) return std::exchange(unreadable_, std::nullopt);
  if (pipeline_.under_way() > 0) return collect();
  if (failure_) std::rethrow_exception(failure_);
  if (is_complete()) expect_enough();
  return std::nullopt;
}

void StereoVideo::ask_source() {
  if (is_interrupted()) return end();
  std::optional<VideoFrame> frame = ahead_.valid() ? ahead_.get() : read();
  is_source_at_end_ = !frame;
  if (!frame || (!frame->pair.unreadable.empty() && is_interrupted())) return end();  // of a pipe that was waited for
  take(std::move(*frame));
  if (options_.reads_ahead) ahead_ = std::async(std::launch::async, [this] { return read(); });
}

std::optional<VideoFrame> StereoVideo::read() {
  VideoFrame frame;
  frame.read_start = Clock::now();
  std::optional<VideoPair> pair = source_->next();
  if (!pair) return std::nullopt;
  ++pairs_;
  frame.pair = std::move(*pair);
  frame.read_ms = std::chrono::duration<double, std::milli>(Clock::now() - frame.read_start).count();
  if (!frame.pair.unreadable.empty()) return frame;
  const Size size = frame.pair.images.left.size();
  if (size != source_->size()) {
    throw InvalidArgument(frame.pair.frame.left.string() + " is " + text_of(size) + " and the sequence " +
                          text_of(source_->size()) + ": all frames need one size");
  }
  find_motion(frame);
  return frame;
}

void StereoVideo::find_motion(VideoFrame& frame) {
  frame.odometry_start = Clock::now();
  frame.motion = motions_.next(frame.pair, pairs_ - 1);
}

void StereoVideo::take(VideoFrame frame) {
  if (!frame.pair.unreadable.empty()) {
    last_left_out_ = frame.pair.unreadable;
    if (left_out_++ == 0) first_left_out_ = last_left_out_;
    unreadable_ = std::move(frame);
    return;
  }
  if (frame.pair.starts_anew && submitted_ > 0) pipeline_.reset();
  pipeline_.submit(image_view(frame.pair.images.left), image_view(frame.pair.images.right), frame.motion.motion,
                   options_.outputs());
  ++submitted_;
  under_way_.push_back(std::move(frame));
}

VideoFrame StereoVideo::collect() {
  FrameReport report = pipeline_.collect();
  VideoFrame frame = std::move(under_way_.front());
  under_way_.pop_front();
  frame.report = std::move(report);
  input_check_.add(frame.pair.images.left, frame.pair.images.right, frame.report,
                   frame.motion.motion.has_value() || !has_odometry_);
  return frame;
}

bool StereoVideo::is_complete() const {
  return !source_ || is_source_at_end_ || submitted_ + left_out_ >= source_->sequence().frames.size();
}

std::string StereoVideo::text_of_left_out() const {
  return std::to_string(left_out_) + " of " + std::to_string(pairs_) + (pairs_ == 1 ? " pair" : " pairs") +
         " could not be read: " + first_left_out_;
}

std::string StereoVideo::warning_of_poses() const {
  if (ahead_.valid()) ahead_.wait();
  return motions_.warning();
}

void StereoVideo::expect_enough() const {
  if (2 * left_out_ > pairs_) {
    throw InvalidArgument(text_of_left_out() + (left_out_ > 1 ? "; the last one: " + last_left_out_ : ""));
  }
  if (source_ && motions_.has_file() && source_->has_lost_images()) {
    throw InvalidArgument("--poses: the rows of a file belong to images one after the other, and " +
                          source_->sequence().title +
                          " has images that are in no pair: give --pose-topic, or leave the poses out");
  }
}

}  // namespace egosgm::vision
