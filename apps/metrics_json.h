// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include "egosgm/vision/evaluation.h"

namespace egosgm::app {

/// In percent, `mae` and `mean_error` in pixels; null where there is nothing to divide by.
inline nlohmann::ordered_json json_of(const vision::DisparityMetrics& m) {
  return {{"bad_or_missing", m.bad_or_missing},   {"bad_1px", m.bad_1px},
          {"bad_of_valid", m.bad_of_valid},       {"density", m.density},
          {"interpolated", m.interpolated},       {"d1", m.d1},
          {"d1_interpolated", m.d1_interpolated}, {"mae", m.mae_px},
          {"mean_error", m.mean_error_px},        {"filled", m.filled},
          {"wrong_of_all", m.wrong_of_all}};
}

}  // namespace egosgm::app
