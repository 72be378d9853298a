// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/fuse/prediction_check.h"

#include <cmath>

#include "tests/reference/method.h"

namespace egosgm::reference {

shared::PredictionState check_prediction(shared::ImageSize size, const shared::PredictionState& before,
                                         const std::vector<float>& warped, const std::vector<float>& predicted,
                                         const std::vector<float>& measured) {
  if (predicted.empty()) return {};
  shared::PredictionCounts now{};
  for (int y = 0; y < size.height; y += kCheckedRows) {
    for (int x = 0; x < size.width; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * size.width + x;
      if (predicted[i] == EGOSGM_INVALID_DISPARITY) continue;
      ++now.predicted;
      if (warped[i] == EGOSGM_INVALID_DISPARITY || measured[i] == EGOSGM_INVALID_DISPARITY) continue;
      ++now.both;
      now.differing += std::abs(measured[i] - predicted[i]) > kCheckedDifferencePx;
    }
  }
  const shared::PredictionCounts& last = before.counts;
  if (last.both == 0) return {now, 0, before.is_wrong};
  // Shares in 1 / (now.both * last.both), exactly.
  using Exact = unsigned long long;
  const Exact all = static_cast<Exact>(now.both) * last.both;
  const bool are_few = static_cast<Exact>(now.predicted) * 4 < static_cast<Exact>(last.predicted) * 3;
  const bool contradict =
      static_cast<Exact>(now.differing) * last.both > 2 * static_cast<Exact>(last.differing) * now.both + all / 40;
  return {now, are_few || contradict, before.is_wrong};
}

}  // namespace egosgm::reference
