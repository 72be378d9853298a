// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// `maps` with another right half.
testing::HostMaps right_map(shared::ImageSize size, int min_disparity, float max_difference_px,
                            const testing::HostMaps& measured, const testing::HostMaps& maps);

}  // namespace egosgm::reference
