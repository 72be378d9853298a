// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Decides on a disparity that points outside of the other image, where nothing can contradict it.
enum class OutsideView { kDrop, kKeep };
inline OutsideView outside_view(const ConsistencyCheckOptions& options) {
  return options.keep_unseen ? OutsideView::kKeep : OutsideView::kDrop;
}

/// Keeps what both views agree on: the pixel that a disparity points to in the other view must be valid and within a
/// tolerance. Each view is checked against the other as it came in.
class ConsistencyCheck {
 public:
  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  ConsistencyCheck(ocl::Context& context, shared::ImageSize size, int pixels = 0);

  /// Writes what is kept of the `views` of `disparity` to `kept`, which is another map. Of `disparity`, both views are
  /// read.
  void check(const Map& disparity, float max_difference_px, OutsideView outside, Map& kept, Views views);

 private:
  ocl::Stage stage_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const float, const cl_int, const Map, Map> check_;
};

}  // namespace egosgm
