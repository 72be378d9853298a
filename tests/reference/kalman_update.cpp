// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/kalman_update.h"

#include <algorithm>
#include <cmath>

namespace egosgm::reference {
namespace {

struct Estimate {
  float disparity, variance;
};

constexpr Estimate kNone{EGOSGM_INVALID_DISPARITY, 0};

bool is_valid(const Estimate& estimate) { return estimate.disparity != EGOSGM_INVALID_DISPARITY; }

Estimate fuse(const Estimate& predicted, const Estimate& measured) {
  const float sum = predicted.variance + measured.variance;
  const float gain = sum > 0 ? predicted.variance / sum : 0;
  return {predicted.disparity + gain * (measured.disparity - predicted.disparity), (1 - gain) * predicted.variance};
}

Estimate update(float gate_px, bool keep_predicted, const Estimate& predicted, const Estimate& measured) {
  if (!is_valid(measured)) return keep_predicted ? predicted : kNone;
  if (!is_valid(predicted)) return measured;
  const bool beyond_gate = gate_px > 0 && std::abs(measured.disparity - predicted.disparity) > gate_px;
  if (!beyond_gate && measured.variance < EGOSGM_ESCAPED_VARIANCE_PX2) return fuse(predicted, measured);
  return {measured.disparity, std::max(measured.variance, EGOSGM_ESCAPED_VARIANCE_PX2)};
}

}  // namespace

testing::HostMaps kalman_update(float gate_px, bool keep_predicted, float min_variance_px2,
                                const testing::HostMaps& predicted, const testing::HostMaps& measured) {
  testing::HostMaps out = predicted;
  for (std::size_t i = 0; i < out.disparity.size(); ++i) {
    const Estimate estimate = update(gate_px, keep_predicted, {predicted.disparity[i], predicted.variance[i]},
                                     {measured.disparity[i], measured.variance[i]});
    out.disparity[i] = estimate.disparity;
    out.variance[i] = is_valid(estimate) ? std::max(estimate.variance, min_variance_px2) : 0;
  }
  return out;
}

}  // namespace egosgm::reference
