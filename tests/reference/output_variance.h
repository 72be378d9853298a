// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "host/method_options.h"
#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// All maps have every row_step-th row alone, and so has the result.
std::vector<float> output_variance(shared::ImageSize size, int row_step, const OutputVarianceOptions& options,
                                   const std::vector<float>& output, const testing::HostMaps& belief,
                                   const testing::HostMaps& measured);

}  // namespace egosgm::reference
