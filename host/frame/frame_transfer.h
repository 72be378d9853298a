// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "egosgm/pipeline.h"
#include "host/frame/frame_report.h"
#include "host/method/publish_step.h"
#include "host/ocl/host_memory.h"
#include "host/stages/maps.h"
#include "host/stages/search_band.h"
#include "host/stages/vertical_alignment.h"

namespace egosgm {

/// The results of a frame on the device.
struct FrameOnDevice {
  const StereoMaps& result;     // that is published; no later frame writes it before this one is collected
  const StereoMaps* predicted;  // null where there is no prediction. From here on, the next frame writes them:
  const StereoMaps& measured;   // (or they are the result)
  const SearchBands& bands;
  Views matched;  // they are of these
  MatchedParts parts;
  const VerticalOffset& offset;
  std::vector<PublishedMap> published;
};

/// Brings a frame's images to the device and its results back: one for each frame that may
/// be under way. Transfers have queues of their own; with those of the kernels they are tied here.
class FrameTransfer {
 public:
  FrameTransfer(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range);

  /// Copies the images, enqueues their way to the device, and lets what is enqueued for it from now on wait for them.
  /// REQUIRES: what check_frame asks; no frame of this transfer is under way.
  const FrameImages& upload(const ImageView& left, const ImageView& right);

  /// Places for disparity and variance that are published, of both views; this transfer's until it is released.
  OutputMaps output() { return {output_disparity_, output_variance_}; }

  /// Enqueues the way back, behind all that was enqueued for the device.
  void download(const FrameOnDevice& frame, const FrameOutputs& outputs);

  /// When all but the result was fetched, so that the next frame may write it.
  const cl::Event& scratch_fetched() const { return scratch_fetched_; }

  /// Fills the outputs that `download` was given, and what a report can tell of them. Cannot fail.
  /// REQUIRES: its commands have ended.
  void collect(FrameReport& report) const;

  /// Lets what is enqueued from now on write the last frame's result. REQUIRES: that is not under way.
  void release();

 private:
  using MapReadback = ocl::Readback<float>;

  void fetch(const cl::Buffer& buffer, std::size_t bytes, void* to);
  void fetch(const cl::Buffer& buffer, std::size_t bytes, Output output);
  /// A disparity with its variance, or without, of the left view.
  void fetch_left(const StereoMaps& maps, Output disparity, Output variance, const Wanted& wanted);
  template <typename T>
  const T* fetched(Output output) const {
    return reinterpret_cast<const T*>(fetched_[static_cast<std::size_t>(output)].data());
  }
  void give(const OutputText& text, const MapView<float>& view) const;
  void give(const OutputText& text, const MapView<std::uint16_t>& view) const;
  void give(const OutputText& text, const MapView<std::uint8_t>& view) const;
  void fetch_view(const ocl::Buffer<float>& maps, int view, const MapView<float>& wanted, MapReadback& readback);

  ocl::Context& context_;
  const shared::ImageSize size_;
  const shared::DisparityRange range_;
  FrameImages images_;
  ocl::Buffer<float> output_disparity_, output_variance_;
  ocl::Upload upload_;
  MapReadback disparity_, variance_, right_disparity_, right_variance_;
  std::array<std::vector<char>, kOutputCount> fetched_;  // what the next frame overwrites on the device
  float vertical_offset_px_ = 0;
  std::vector<shared::RowSum> row_sums_;  // of the views that were searched
  MatchedParts parts_{};
  cl::Event scratch_fetched_;
  bool has_prediction_ = false;
  FrameOutputs outputs_;
};

}  // namespace egosgm
