// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

testing::HostMaps forward_warp(shared::ImageSize size, shared::DisparityRange range,
                               const shared::DisparityMotion& left, const shared::DisparityMotion& right,
                               float process_noise_px2, const testing::HostMaps& belief);

}  // namespace egosgm::reference
