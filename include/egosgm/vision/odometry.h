// SPDX-License-Identifier: Apache-2.0
// Odometry belongs to the core: this header keeps its names of egosgm::vision for programs that have them.
#pragma once

#include "egosgm/odometry.h"

namespace egosgm::vision {

using egosgm::OdometryResult;
using egosgm::OdometryTimes;
using egosgm::StereoOdometry;
using egosgm::StereoOdometryOptions;

}  // namespace egosgm::vision
