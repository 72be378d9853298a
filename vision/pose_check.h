// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "egosgm/export.h"

namespace egosgm::vision {

/// The fault of given motions (current_from_previous, one after the other), told by the odometry's motions of the
/// same frames: another unit, the inverse, other axes, poses of a frame earlier or later. Empty where they agree, and
/// where too few frames moved to tell. Thread-safe.
EGOSGM_EXPORT std::string suspect_motions(const std::vector<Eigen::Isometry3d>& given,
                                          const std::vector<std::optional<Eigen::Isometry3d>>& found);

}  // namespace egosgm::vision
