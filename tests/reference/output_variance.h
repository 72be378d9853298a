// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "host/method_options.h"
#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

std::vector<float> output_variance(shared::ImageSize size, const OutputVarianceOptions& options,
                                   const std::vector<float>& output, const testing::HostMaps& belief,
                                   const testing::HostMaps& measured);

}  // namespace egosgm::reference
