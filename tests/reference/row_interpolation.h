// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// Fills the rows of both views between those that are there.
testing::HostMaps row_interpolation(shared::ImageSize size, cl_int row_step, const testing::HostMaps& in);

}  // namespace egosgm::reference
