// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// `greys`: those of both views, on the 8-bit scale.
testing::HostMaps weighted_median(shared::ImageSize size, shared::DisparityRange range,
                                  const std::vector<std::uint16_t>& greys, const testing::HostMaps& in,
                                  cl_int row_step = 1);

}  // namespace egosgm::reference
