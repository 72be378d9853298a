// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "host/method_options.h"
#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// `images`: the grey values of both views; `steps_per_grey`: 1 for 8 bits, 257 for 16.
testing::HostMaps sad_check(shared::ImageSize size, const SadCheckOptions& options, const std::vector<int>& images,
                            int steps_per_grey, const testing::HostMaps& in);

}  // namespace egosgm::reference
