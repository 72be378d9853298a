// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// Of the left view.
std::vector<std::uint8_t> dynamic_map(shared::ImageSize size, const testing::HostMaps& predicted,
                                      const testing::HostMaps& measured);

}  // namespace egosgm::reference
