// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

#include "egosgm/export.h"
#include "egosgm/image.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

// In memory a disparity map is kF32 in pixels, with kInvalidDisparity where there is none. A pixel counts as valid
// if it is finite and above kInvalidDisparity. All functions are thread-safe (writers: for different files), check
// sizes before they allocate, and throw InvalidArgument for what cannot be read and IoError for what cannot be written.

inline bool is_valid_disparity(float d) { return d > kInvalidDisparity && d <= 3.402823466e38f; }

/// A true disparity which says that nothing is there, the sky for instance: from 0 to 1/256 px, KITTI's PNG value 1.
inline bool is_sky(float truth) { return truth >= 0 && truth <= 1.0f / 256; }

/// Reads 16-bit grey PNG (KITTI's has 256 steps a pixel), PFM, or NumPy's .npy, in which what is not above 0 or not
/// finite is invalid; the file's first bytes tell which.
EGOSGM_EXPORT Image read_disparity(const std::filesystem::path& file, double png_steps_per_px = 256);

/// Reads any map of numbers as they are stored, a variance or a confidence for instance: grey PNG of 8 or 16 bits, PFM
/// or .npy. kF32; infinity in a PFM becomes NaN.
EGOSGM_EXPORT Image read_values(const std::filesystem::path& file);

/// Writes KITTI's PNG or a PFM by the extension. Returns how many valid pixels could not be stored (see
/// write_disparity_png).
EGOSGM_EXPORT std::int64_t write_disparity(const std::filesystem::path& file, const Image& disparity);

/// KITTI's disparity PNG: 16-bit grey, disparity = value / 256, 0 = invalid. Stores max(d * 256, 1), truncated, as
/// KITTI's development kit does, for 0 <= d < 256. The format has no room for a negative disparity or one of 256 and
/// more: those become invalid. Returns how many; a PFM keeps them.
EGOSGM_EXPORT std::int64_t write_disparity_png(const std::filesystem::path& file, const Image& disparity);

/// How many valid pixels of a kF32 map that PNG has no room for.
EGOSGM_EXPORT std::int64_t count_outside_png(const Image& disparity);

/// KITTI's PNG of an optical flow, kFlow, (u, v) in px: 16-bit RGB, red = 64 u + 32768, green likewise of v, blue = 1.
/// All three are 0 where u or v is not finite or outside of what 16 bits hold, -512 to 511.98 px.
EGOSGM_EXPORT void write_flow_png(const std::filesystem::path& file, const Image& flow);

/// One-channel PFM (Middlebury): rows bottom-up, byte order by the scale's sign, infinity or NaN = invalid.
EGOSGM_EXPORT Image read_pfm(const std::filesystem::path& file);

/// Writes any kF32 map (disparity, variance, depth), little endian; infinity where it is invalid.
EGOSGM_EXPORT void write_pfm(const std::filesystem::path& file, const Image& map);

}  // namespace egosgm::vision
