// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/device.h"
#include "egosgm/tuning.h"

namespace egosgm {

// The defaults of device classes. 0: the stage decides by the disparity range and the device's limits.
inline constexpr Tuning kCpuTuning{
    .tile_width = 128, .tile_height = 24, .warp_band_rows = 32, .speckle_strip_rows = 24, .row_group = 1};
// Up to four compute units are busy with fewer tiles, too, and wait less often (docs/decisions.md).
inline constexpr int kFewComputeUnits = 4;
inline constexpr Tuning kSmallCpuTuning{
    .tile_width = 256, .tile_height = 48, .warp_band_rows = 96, .speckle_strip_rows = 24, .row_group = 1};
inline constexpr Tuning kGpuTuning{.tile_width = 128, .tile_height = 24, .warp_band_rows = 32};  // not measured yet

/// `tuning` with the defaults of the device's class where it says nothing.
Tuning with_defaults(Tuning tuning, const DeviceInfo& device);

}  // namespace egosgm
