// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "egosgm/pipeline.h"
#include "host/frame/frame_report.h"
#include "host/ocl/host_memory.h"
#include "host/stages/maps.h"
#include "host/stages/search_band.h"
#include "host/stages/vertical_alignment.h"

namespace egosgm {

/// The results of a frame on the device.
struct FrameOnDevice {
  const StereoMaps& result;     // that is given out; no later frame writes it before this one is collected
  const StereoMaps* predicted;  // null where there is no prediction. From here on, the next frame writes them:
  const StereoMaps& measured;   // (or they are the result)
  const SearchBands& bands;
  Views matched;  // they are of these
  MatchedParts parts;
  const VerticalOffset& offset;
  const ocl::Buffer<cl_uchar>* dynamic;            // null where it was not asked for
  const ocl::Buffer<cl_uchar>* reasons = nullptr;  // the same
};

/// Brings a frame's images to the device and its results back: one for each frame that may
/// be under way. Transfers have queues of their own; with those of the kernels they are tied here.
class FrameTransfer {
 public:
  FrameTransfer(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range);

  /// Copies the images, enqueues their way to the device, and lets what is enqueued for it from now on wait for them.
  /// REQUIRES: what check_frame asks; no frame of this transfer is under way.
  const FrameImages& upload(const ImageView& left, const ImageView& right);

  /// Places for disparity and variance that are given out, of both views; this transfer's until it is released.
  GivenOut given_out() { return {output_disparity_, output_variance_}; }

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
  using Scratch = std::vector<float>;

  template <typename T>
  void fetch(const ocl::Buffer<T>& buffer, std::size_t count, std::vector<T>& staged);
  void fetch_left(const ocl::Buffer<float>& maps, bool wanted, Scratch& staged);
  void fetch_view(const ocl::Buffer<float>& maps, int view, const MapView<float>& wanted, MapReadback& readback);

  ocl::Context& context_;
  const shared::ImageSize size_;
  const shared::DisparityRange range_;
  FrameImages images_;
  ocl::Buffer<float> output_disparity_, output_variance_;
  ocl::Upload upload_;
  MapReadback disparity_, variance_, right_disparity_, right_variance_;
  Scratch predicted_, predicted_variance_, measured_, measured_variance_, vertical_offset_px_;
  std::vector<shared::Band> bands_;
  std::vector<cl_uchar> dynamic_, reasons_;
  std::vector<shared::RowSum> row_sums_;  // of the views that were searched
  MatchedParts parts_{};
  cl::Event scratch_fetched_;
  bool has_prediction_ = false;
  FrameOutputs outputs_;
};

}  // namespace egosgm
