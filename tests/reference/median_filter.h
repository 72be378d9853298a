// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

testing::HostMaps median_filter(shared::ImageSize size, const testing::HostMaps& in, cl_int row_step = 1);

}  // namespace egosgm::reference
