// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

testing::HostMaps edge_variance(shared::ImageSize size, float weight, const testing::HostMaps& maps);

}  // namespace egosgm::reference
