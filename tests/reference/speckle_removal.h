// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

testing::HostMaps speckle_removal(shared::ImageSize size, const SpeckleRemovalOptions& options,
                                  const testing::HostMaps& in);

}  // namespace egosgm::reference
