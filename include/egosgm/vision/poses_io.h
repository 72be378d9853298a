// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/motion.h"

namespace egosgm::vision {

/// Reads KITTI poses: a row of 12 numbers per frame, the 3x4 camera-to-world transform [R | t], row-major, t in metres.
/// Each rotation is replaced by the nearest exact one. Throws InvalidArgument, naming file and row, for a row that is
/// not 12 finite numbers, for an R with |R R^T - I| above 1e-4 or det R < 0, and for a file without poses. Thread-safe.
EGOSGM_EXPORT std::vector<Isometry> read_poses(const std::filesystem::path& file);

/// Writes KITTI poses with ten significant digits. Throws IoError. Thread-safe for different files.
EGOSGM_EXPORT void write_poses(const std::filesystem::path& file, const std::vector<Isometry>& world_from_camera);

/// The motion between two poses, as Pipeline and Motion take it.
inline Isometry current_from_previous(const Isometry& world_from_previous, const Isometry& world_from_current) {
  return world_from_current.inverse() * world_from_previous;
}

}  // namespace egosgm::vision
