// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

testing::HostMaps edge_rejection(shared::ImageSize size, float max_jump_px, const testing::HostMaps& in,
                                 cl_int row_step = 1);

}  // namespace egosgm::reference
