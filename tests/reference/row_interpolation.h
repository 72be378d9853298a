// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// Fills the rows of the right view between every `right_row_step`-th one.
testing::HostMaps row_interpolation(shared::ImageSize size, int right_row_step, const testing::HostMaps& in);

}  // namespace egosgm::reference
