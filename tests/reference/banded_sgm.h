// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// Disparity and matching variance of both views. `codes`: per view and pixel, without padding, left to right: census codes, or
/// grey values (8 bits) if `sad`. `bands`: per view and pixel.
testing::HostMaps banded_sgm(const shared::SgmParameters& parameters, int paths, bool sad,
                             const std::vector<std::uint64_t> (&codes)[2], const std::vector<shared::Band>& bands);

}  // namespace egosgm::reference
