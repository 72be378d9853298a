// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <utility>

#include "egosgm/image.h"
#include "host/method_options.h"
#include "host/ocl/buffer.h"
#include "kernels/shared.h"

namespace egosgm {

inline std::size_t pixel_count(shared::ImageSize size) { return static_cast<std::size_t>(size.width) * size.height; }

inline shared::DisparityRange range_of(const MethodOptions& options) {
  return {options.min_disparity, options.disparities};
}

/// The define of kernels that read images of `type`.
inline ocl::Defines pixel_define(PixelType type) {
  return ocl::Defines().set("PIXEL_BYTES", type == PixelType::kU8 ? 1 : 2);
}

/// Both views' pixels on the device, the left view first, without gaps; 1 or 2 bytes each.
struct FrameImages {
  ocl::Buffer<cl_uchar> pixels;
  PixelType type = PixelType::kU8;
};

/// A stage that is built for images of one type: one of each type that was prepared.
template <typename Stage>
class OfEachType {
 public:
  explicit OfEachType(std::function<Stage(PixelType)> build) : build_(std::move(build)) {}

  /// Builds the one for `type`, where that was not done. Enqueues nothing.
  void prepare(PixelType type) {
    if (!stages_[index(type)]) stages_[index(type)].emplace(build_(type));
  }
  /// REQUIRES: it was prepared.
  Stage& operator[](PixelType type) { return stages_[index(type)].value(); }

 private:
  static int index(PixelType type) { return type == PixelType::kU8 ? 0 : 1; }

  std::function<Stage(PixelType)> build_;
  std::optional<Stage> stages_[2];
};

/// A map of both views, the left one first.
using Map = ocl::Buffer<float>;

/// Disparity [px] and variance [px^2] of both views. Where there is no disparity, a variance means nothing. A
/// copy shares the device's memory.
struct StereoMaps {
  Map disparity, variance;

  StereoMaps(Map disparities, Map variances) : disparity(std::move(disparities)), variance(std::move(variances)) {}
  StereoMaps(ocl::Context& context, shared::ImageSize size)
      : disparity(context, 2 * pixel_count(size)), variance(context, 2 * pixel_count(size)) {}
};

/// The maps that a frame publishes of its belief.
struct OutputMaps {
  Map& disparity;  // what is confirmed; not written where that is all of the belief
  Map& variance;   // of what is published
};

/// A map of both views of bytes: 1 where something holds, else 0.
using FlagMap = ocl::Buffer<cl_uchar>;

/// The prediction of this frame from the last frame's maps, of the tracked views.
struct Prediction {
  StereoMaps warped;    // before anything was dropped
  StereoMaps rejected;  // of these, what EdgeRejection keeps; until the step ends
  StereoMaps maps;
  StereoMaps filled;  // before they were checked, where they are; until the step ends
  FlagMap evidence;   // of what was warped
  FlagMap hidden;     // where a surface that came nearer than the range hides what is behind it

  Prediction(ocl::Context& context, shared::ImageSize size)
      : warped(context, size),
        rejected(Map(context, ocl::Scratch::kOfStep0, 2 * pixel_count(size)), warped.variance),
        maps(context, size),
        filled(Map(context, ocl::Scratch::kOfStep1, 2 * pixel_count(size)), maps.variance),
        evidence(context, 2 * pixel_count(size)),
        hidden(context, 2 * pixel_count(size)) {}

  /// Says nothing of any pixel.
  void fill_with_nothing(ocl::Context& context) {
    maps.disparity.fill(context, EGOSGM_INVALID_DISPARITY);
    maps.variance.fill(context, 0);
    evidence.fill(context, 0);
    hidden.fill(context, 0);
  }
};

/// The views that a stage works on, and which of their rows.
struct Views {
  int count = 2;
  cl_int row_step = 1;

  static const Views kLeft, kBoth;
  friend bool operator==(const Views&, const Views&) = default;
};
inline constexpr Views Views::kLeft{1}, Views::kBoth{2};

}  // namespace egosgm
