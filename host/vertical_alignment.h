// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/options.h"
#include "host/maps.h"
#include "host/ocl/kernel.h"

namespace egosgm {

/// Takes out what rectification left between the rows of the views. A left pixel (x, y) lies at (x - d, y + dy) in the
/// right image, dy a quadratic of that place; it is estimated from matched pixels (a robust step of Lucas and Kanade
/// 1981 a frame) and the right image resampled, so that rows correspond.
///
/// A steady frame:  images = align(upload); match; estimate(images, measured); ...; commit.
/// The first frame: images = align(upload); match; estimate(images, measured); images = realign(upload); match; ...
/// What a frame estimates is lost unless it commits: a frame that failed has changed nothing.
class VerticalAlignment {
 public:
  /// `row_group`: how many work-items share a row; 0: what suits the device.
  VerticalAlignment(ocl::Context& context, shared::ImageSize size, const VerticalAlignmentOptions& options,
                    int row_group = 0);

  /// The images with the right one resampled by the committed offsets, in memory of this stage that the next call
  /// overwrites; `images` itself where nothing is known or the option is off.
  const FrameImages& align(const FrameImages& images);

  /// The same with the offset that this frame's last `estimate` gave.
  const FrameImages& realign(const FrameImages& images);

  /// Improves the offset by what is left of it between `aligned` images with the disparities `measured` (left view).
  void estimate(const FrameImages& aligned, const StereoMaps& measured);

  /// Keeps this frame's estimates for the next one. Enqueues nothing and cannot fail.
  void commit() { committed_ = working_; }

  /// What a frame rests on. One that may have to be gone back to, if a frame under way fails, is to be kept.
  using State = int;
  State state() const { return committed_; }
  void keep(State state) { kept_ = state; }
  void go_back(State state) { committed_ = working_ = state; }

  /// Forgets all: nothing is known of the offset, and it is taken as 0. Cannot fail.
  void reset() { committed_ = working_ = kUnknown; }

  /// Whether no frame has committed an estimate yet: a frame that is worth two passes. False where the option is off.
  bool is_unknown() const { return options_.enabled && committed_ == kUnknown; }

  /// Element 0: the offset dy [px] by which the last `align` or `realign` resampled the middle of the right image.
  const ocl::Buffer<float>& offset_px() const { return states_[applied_]; }

 private:
  static constexpr int kUnknown = 0;  // the state that is never written: offset 0, which rests on nothing

  int free_state() const;

  ocl::Context& context_;
  const shared::ImageSize size_;
  const VerticalAlignmentOptions options_;
  const int row_group_;
  using ResampleKernel = ocl::Kernel<const shared::ImageSize, const ocl::Buffer<float>, const ocl::Buffer<cl_uchar>,
                                     ocl::Buffer<cl_uchar>>;
  using SumKernel =
      ocl::Kernel<const shared::ImageSize, const ocl::Buffer<cl_uchar>, const ocl::Buffer<float>, ocl::Buffer<cl_long>>;
  ResampleKernel resample_u8_, resample_u16_;
  SumKernel sum_rows_u8_, sum_rows_u16_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const float, const ocl::Buffer<cl_long>, const ocl::Buffer<float>,
              ocl::Buffer<float>>
      update_;
  FrameImages aligned_;
  ocl::Buffer<cl_long> row_sums_;  // of each sampled row: see the kernel
  ocl::Buffer<float> states_[5];   // see `update` in the kernel
  State committed_ = kUnknown, working_ = kUnknown, applied_ = kUnknown, kept_ = kUnknown;
};

}  // namespace egosgm
