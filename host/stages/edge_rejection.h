// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Drops the predictions on both sides of a disparity jump: a small error of the motion puts them on the wrong surface,
/// and a narrow search could not get back. Neighbours are the nearest valid of the next two pixels to the left, right,
/// above and below.
class EdgeRejection {
 public:
  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits. REQUIRES: a largest jump above 0.
  EdgeRejection(ocl::Context& context, shared::ImageSize size, const EdgeRejectionOptions& options, int pixels = 0);

  /// Writes what is kept of `disparity` to `kept`.
  void reject(const Map& disparity, Map& kept, Views views);

 private:
  ocl::Stage stage_;
  const float max_jump_px_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const float, const Map, Map> reject_;
};

}  // namespace egosgm
