// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "egosgm/tuning.h"

namespace egosgm {

// The defaults of device classes. 0: the stage decides by the disparity range and the device's limits.
inline constexpr Tuning kCpuTuning{.tile_width = 128,  // measured best on two cores (bench/NOTES.md)
                                   .tile_height = 24,
                                   .warp_band_rows = 32,
                                   .speckle_strip_rows = 24,
                                   .row_group = 1};
inline constexpr Tuning kGpuTuning{.tile_width = 128, .tile_height = 24, .warp_band_rows = 32};  // not measured yet

/// `tuning` with the class's defaults where it says nothing. `device_type`: as in DeviceInfo.
Tuning with_defaults(Tuning tuning, const std::string& device_type);

}  // namespace egosgm
