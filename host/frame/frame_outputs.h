// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/frame.h"

namespace egosgm {

/// Calls visit(name, view) for every map that a frame can give.
template <typename Outputs, typename Visit>
void for_each_output(Outputs& outputs, Visit&& visit) {
  visit("disparity", outputs.disparity);
  visit("variance", outputs.variance);
  visit("reason", outputs.reason);
  visit("right_disparity", outputs.right_disparity);
  visit("right_variance", outputs.right_variance);
  visit("predicted", outputs.debug.predicted);
  visit("predicted_variance", outputs.debug.predicted_variance);
  visit("measured", outputs.debug.measured);
  visit("measured_variance", outputs.debug.measured_variance);
  visit("search_width", outputs.debug.search_width);
  visit("dynamic", outputs.debug.dynamic);
}

}  // namespace egosgm
