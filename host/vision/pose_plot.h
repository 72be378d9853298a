// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "egosgm/export.h"

namespace egosgm::vision {

/// Two paths from above, their first poses laid on each other: x (to the right) and z (ahead) of the first camera in
/// metres, at one scale, with a legend and the drift at the end. Takes camera-to-world poses. Throws InvalidArgument
/// unless both have the same number of them, at least two. Thread-safe.
EGOSGM_EXPORT cv::Mat draw_path(const std::vector<Eigen::Isometry3d>& estimate,
                                const std::vector<Eigen::Isometry3d>& truth);  // BGR

/// The same as SVG.
EGOSGM_EXPORT std::string path_svg(const std::vector<Eigen::Isometry3d>& estimate,
                                   const std::vector<Eigen::Isometry3d>& truth);

}  // namespace egosgm::vision
