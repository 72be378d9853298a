// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "kernels/shared.h"

namespace egosgm::reference {

/// `before`: of the frame before. Empty maps: a frame without predictions.
shared::PredictionState check_prediction(shared::ImageSize size, const shared::PredictionState& before,
                                         const std::vector<float>& warped, const std::vector<float>& predicted,
                                         const std::vector<float>& measured);

}  // namespace egosgm::reference
