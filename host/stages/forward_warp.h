// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "egosgm/calibration.h"
#include "egosgm/motion.h"
#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"
#include "host/tuning_defaults.h"

namespace egosgm {

/// The motion of the disparity space of `view` (EGOSGM_LEFT or EGOSGM_RIGHT) with the left camera: H = Gamma T Gamma^-1
/// (eqs. 1-4), and the variance that its covariance adds.
shared::DisparityMotion disparity_motion(const Calibration& calibration, const Motion& current_from_previous, int view);

/// Predicts the maps of both views by the camera's motion (eqs. 1-6): every disparity lands on the pixel nearest to
/// where its point is seen next, with the variance p' = Phi^2 p + q. The nearest surface wins; of equal disparities the
/// one that is known least. What falls behind the camera, outside of the image or outside of the disparity range is
/// dropped; what came nearer than the range still hides what is behind it, and leaves no disparity there, but a mark in
/// place of its variance (EGOSGM_HIDDEN).
class ForwardWarp {
 public:
  /// `pixels` of a work-item: 1 (and atomics) or 16 (and bands of `band_rows` rows); 0: by the device. Same bits.
  ForwardWarp(ocl::Context& context, shared::ImageSize size, const Calibration& calibration,
              const ForwardWarpOptions& options, shared::DisparityRange range, int pixels = 0,
              int band_rows = cpu_tuning().warp_band_rows);

  /// `evidence` moves with the belief; it is 0 where nothing lands. REQUIRES: `motion` is valid; `predicted` is not
  /// `belief`.
  void warp(const StereoMaps& belief, const FlagMap& evidence, const Motion& current_from_previous,
            StereoMaps& predicted, FlagMap& predicted_evidence, Views views);

 private:
  using Size = const shared::ImageSize;
  using Range = const shared::DisparityRange;
  using ViewMotion = const shared::DisparityMotion;
  using In = const ocl::Buffer<float>;
  using Out = ocl::Buffer<float>;

  struct Atomics {
    ocl::Kernel<Size, Range, ViewMotion, ViewMotion, const float, In, In, ocl::Buffer<cl_int>, ocl::Buffer<cl_uint>,
                Out, ocl::Buffer<cl_uint>, Out, ocl::Buffer<cl_uint>>
        move;
    ocl::Kernel<Size, const ocl::Buffer<cl_int>, const ocl::Buffer<cl_uint>, ocl::Buffer<cl_uint>> splat_disparity;
    ocl::Kernel<Size, const ocl::Buffer<cl_int>, const ocl::Buffer<cl_uint>, In, const ocl::Buffer<cl_uint>, Out,
                const FlagMap, ocl::Buffer<cl_uint>>
        splat_variance;
    ocl::Kernel<Size, Range, const ocl::Buffer<cl_uint>, Out, Out, const ocl::Buffer<cl_uint>, FlagMap> decode;
    ocl::Buffer<cl_int> landed;
    ocl::Buffer<cl_uint> moved_key;
    ocl::Buffer<float> moved_variance;
    ocl::Buffer<cl_uint> zbuffer, most_evidence;
    Atomics(ocl::Context& context, const ocl::Stage& stage);
  };
  struct Bands {
    ocl::Kernel<Size, ViewMotion, ViewMotion, In, ocl::Buffer<cl_int>> find_spans;
    ocl::Kernel<Size, Range, ViewMotion, ViewMotion, const float, const cl_int, const ocl::Buffer<cl_int>, In, In,
                const FlagMap, Out, Out, FlagMap>
        splat_bands;
    ocl::Buffer<cl_int> spans;
    Bands(ocl::Context& context, const ocl::Stage& stage);
  };

  ocl::Stage stage_;
  const Calibration calibration_;
  const ForwardWarpOptions options_;
  const shared::DisparityRange range_;
  const int band_rows_;
  std::optional<Atomics> atomics_;  // one of the two
  std::optional<Bands> bands_;
};

}  // namespace egosgm
