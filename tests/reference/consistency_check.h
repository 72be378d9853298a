// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// Where the right view lacks a row, one that agrees of those above and below it is enough.
testing::HostMaps consistency_check(shared::ImageSize size, float max_difference_px, bool keep_outside,
                                    const testing::HostMaps& in, shared::RowSteps row_steps = {1, 1});

}  // namespace egosgm::reference
