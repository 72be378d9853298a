// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "host/method_options.h"
#include "kernels/shared.h"

namespace egosgm::reference {

/// P2 of the step between two grey values of 8 bits.
int step_penalty(const BandedSgmOptions& options, int p, int q);

/// Four a pixel, of both views, as the kernel lays them out. `images`: both views' grey values of 8 or 16 `bits`.
std::vector<std::uint8_t> step_penalties(shared::ImageSize size, const std::vector<std::uint16_t>& images, int bits,
                                         const BandedSgmOptions& options, cl_int row_step = 1);

}  // namespace egosgm::reference
