// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// gate_px 0: no gate.
testing::HostMaps kalman_update(float gate_px, bool keep_predicted, float min_variance_px2,
                                const testing::HostMaps& predicted, const testing::HostMaps& measured);

}  // namespace egosgm::reference
