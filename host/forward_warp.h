// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/calibration.h"
#include "egosgm/motion.h"
#include "egosgm/options.h"
#include "host/maps.h"
#include "host/ocl/kernel.h"

namespace egosgm {

/// How the disparity space of `view` (EGOSGM_LEFT or EGOSGM_RIGHT) moves with the left camera: H = Gamma T Gamma^-1
/// (eqs. 1-4), and the variance that its covariance adds.
shared::DisparityMotion disparity_motion(const Calibration& calibration, const Motion& current_from_previous, int view);

/// Predicts the maps of both views by the camera's motion (eqs. 1-6): every disparity lands on the pixel nearest to
/// where its point is seen next, with the variance p' = Phi^2 p + q. The nearest surface wins; of equal disparities the
/// one that is known least. What falls behind the camera, outside of the image or outside of the disparity range is
/// dropped.
class ForwardWarp {
 public:
  ForwardWarp(ocl::Context& context, shared::ImageSize size, const Calibration& calibration,
              const ForwardWarpOptions& options, shared::DisparityRange range);

  /// REQUIRES: `motion` is valid; `predicted` is not `belief`.
  void operator()(const StereoMaps& belief, const Motion& current_from_previous, StereoMaps& predicted);

 private:
  ocl::Context& context_;
  const shared::ImageSize size_;
  const Calibration calibration_;
  const float process_noise_px2_;
  const shared::DisparityRange range_;
  ocl::Kernel<const shared::ImageSize, const shared::DisparityRange, const cl_int, const shared::DisparityMotion,
              const float, const ocl::Buffer<float>, const ocl::Buffer<float>, ocl::Buffer<cl_int>,
              ocl::Buffer<cl_uint>, ocl::Buffer<float>, ocl::Buffer<cl_uint>, ocl::Buffer<float>>
      move_;
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<cl_int>, const ocl::Buffer<cl_uint>, ocl::Buffer<cl_uint>>
      splat_disparity_;
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<cl_int>, const ocl::Buffer<cl_uint>, const ocl::Buffer<float>,
              const ocl::Buffer<cl_uint>, ocl::Buffer<float>>
      splat_variance_;
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<cl_uint>, ocl::Buffer<float>> decode_;
  ocl::Buffer<cl_int> landed_;
  ocl::Buffer<cl_uint> moved_key_;
  ocl::Buffer<float> moved_variance_;
  ocl::Buffer<cl_uint> zbuffer_;
};

}  // namespace egosgm
