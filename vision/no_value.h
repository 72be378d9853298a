// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <limits>

namespace egosgm::vision {

/// In place of a value that a pixel does not have, in maps of this library's own: sums with it and comparisons hold
/// nowhere. Maps of disparities that a caller gets have kInvalidDisparity there.
inline constexpr float kNoValue = std::numeric_limits<float>::quiet_NaN();
inline bool has_value(float value) { return !std::isnan(value); }

}  // namespace egosgm::vision
