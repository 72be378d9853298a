// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "host/method_options.h"
#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// Disparity and matching variance of both views. `codes`: what reference::codes gives, per view. `bands`: per view and
/// pixel. `grey`: both views' grey values of 8 bits, for the penalties of `options`. reads_off: whether the right
/// view's disparities are read off the left view's match. row_step: every so many-th row of it is matched.
testing::HostMaps banded_sgm(shared::ImageSize size, shared::DisparityRange range, const BandedSgmOptions& options,
                             const std::vector<std::uint64_t> (&codes)[2], const std::vector<std::uint16_t>& grey,
                             const std::vector<shared::Band>& bands, bool reads_off = false, cl_int row_step = 1);

}  // namespace egosgm::reference
