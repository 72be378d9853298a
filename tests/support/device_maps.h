// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <vector>

#include "host/stages/maps.h"
#include "tests/support/random_maps.h"

namespace egosgm::testing {

/// Where there is no disparity, the variance is NaN, unless it is a mark: nobody may read it.
inline StereoMaps upload(ocl::Context& context, shared::ImageSize size, const HostMaps& maps) {
  StereoMaps on_device(context, size);
  std::vector<float> variance = maps.variance;
  for (std::size_t i = 0; i < variance.size(); ++i) {
    const bool is_meant = maps.disparity[i] > EGOSGM_INVALID_DISPARITY || variance[i] == EGOSGM_HIDDEN;
    if (!is_meant) variance[i] = std::numeric_limits<float>::quiet_NaN();
  }
  on_device.disparity.write(context, maps.disparity);
  on_device.variance.write(context, variance);
  return on_device;
}

/// Without variances that mean nothing.
inline HostMaps download(ocl::Context& context, const StereoMaps& maps) {
  return masked({maps.disparity.read(context), maps.variance.read(context)});
}

/// A prediction whose variances mark what is hidden (EGOSGM_HIDDEN), as `hidden` and variances; and back.
inline HostMaps download_marked(ocl::Context& context, const StereoMaps& maps) {
  HostMaps marked{maps.disparity.read(context), maps.variance.read(context)};
  for (const float p : marked.variance) marked.hidden.push_back(p == EGOSGM_HIDDEN);
  return masked(marked);
}
inline HostMaps with_marks(HostMaps maps) {
  for (std::size_t i = 0; i < maps.hidden.size(); ++i) {
    if (maps.hidden[i]) maps.variance[i] = EGOSGM_HIDDEN;
  }
  return maps;
}

}  // namespace egosgm::testing
