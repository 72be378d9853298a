// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "kernels/shared.h"
#include "tests/reference/evidence.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// `evidence`: null where the method has none.
testing::HostMaps kalman_update(shared::ImageSize size, const KalmanUpdateOptions& options,
                                const testing::HostMaps& predicted, const testing::HostMaps& measured,
                                const FrameEvidence* evidence = nullptr);

}  // namespace egosgm::reference
