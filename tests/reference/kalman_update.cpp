// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/kalman_update.h"

#include <algorithm>
#include <cmath>

#include "tests/reference/method.h"

namespace egosgm::reference {
namespace {

struct Estimate {
  float disparity, variance;
  bool doubtful;
};

constexpr Estimate kNone{EGOSGM_INVALID_DISPARITY, 0, false};

bool is_valid(const Estimate& estimate) { return estimate.disparity != EGOSGM_INVALID_DISPARITY; }

Estimate fuse(const Estimate& predicted, const Estimate& measured) {
  const float sum = predicted.variance + measured.variance;
  const float gain = sum > 0 ? predicted.variance / sum : 0;
  return {predicted.disparity + gain * (measured.disparity - predicted.disparity), (1 - gain) * predicted.variance,
          false};
}

/// The mean innovation around a pixel of the view that begins at `view`, over 5x5 blocks of 4x4 pixels, of which every
/// second row counts; 0 where that is no drift.
float drift_around(shared::ImageSize size, const testing::HostMaps& predicted, const testing::HostMaps& measured,
                   int view, int x, int y, float gate_px) {
  int sum = 0, count = 0, nearer = 0, farther = 0;
  for (int row = std::max(y / 4 * 4 - 8, 0); row < std::min(y / 4 * 4 + 12, size.height); row += 2) {
    for (int column = std::max(x / 4 * 4 - 8, 0); column < std::min(x / 4 * 4 + 12, size.width); ++column) {
      const int i = view + row * size.width + column;
      const float d = predicted.disparity[i], z = measured.disparity[i];
      if (d == EGOSGM_INVALID_DISPARITY || z == EGOSGM_INVALID_DISPARITY) continue;
      if (gate_px > 0 && std::abs(z - d) > gate_px) continue;
      ++count;
      sum += static_cast<int>(std::nearbyint((z - d) * 256));
      nearer += z - d > 0.05f;
      farther += z - d < -0.05f;
    }
  }
  if (count < 60) return 0;
  const float mean = static_cast<float>(sum) / (256.0f * static_cast<float>(count));
  const bool most_are_off = 4 * (mean > 0 ? nearer : farther) >= 3 * count;
  return most_are_off && std::abs(mean) > 0.1f ? mean : 0;
}

bool contradict(float gate_px, float a, float b) { return gate_px > 0 && std::abs(a - b) > gate_px; }

Estimate update(const KalmanUpdateOptions& options, float drift, const Estimate& predicted, const Estimate& measured) {
  if (!is_valid(measured)) return options.keep_predicted ? predicted : kNone;
  const float z = measured.disparity, wide = kDoubtfulVariancePx2;
  if (!is_valid(predicted)) return measured;
  if (!contradict(options.gate_px, z, predicted.disparity)) {
    const float off = z - predicted.disparity, least_off = drift > 0 ? std::min(off, drift) : std::max(off, drift);
    return fuse({predicted.disparity + (least_off * drift > 0 ? least_off : 0), predicted.variance, false}, measured);
  }
  return {z, std::max(measured.variance, wide), true};
}

}  // namespace

testing::HostMaps kalman_update(shared::ImageSize size, const KalmanUpdateOptions& options,
                                const testing::HostMaps& predicted, const testing::HostMaps& measured,
                                const FrameEvidence* evidence) {
  testing::HostMaps out = predicted;
  out.evidence.clear();
  const int pixels = size.width * size.height;
  for (int i = 0; i < 2 * pixels; ++i) {
    const int first = i / pixels * pixels, x = (i - first) % size.width, y = (i - first) / size.width;
    const float drift =
        options.ask_neighbours ? drift_around(size, predicted, measured, first, x, y, options.gate_px) : 0;
    const bool is_hidden = options.gate_px > 0 && !predicted.hidden.empty() && predicted.hidden[i] != 0;
    Estimate of_measurement{measured.disparity[i], measured.variance[i], false};
    Verdict verdict{kMostEvidence, true, true};
    if (evidence) {
      const float d = predicted.disparity[i];
      const bool is_new = d == EGOSGM_INVALID_DISPARITY || std::abs(of_measurement.disparity - d) > options.gate_px;
      if (is_valid(of_measurement) && is_new &&
          supporters_of(size, measured, first, x, y, of_measurement.disparity, 2).count <
              (evidence->sees_again && d == EGOSGM_INVALID_DISPARITY ? 12 : 1)) {
        of_measurement = kNone;
      }
      verdict = judge(size, options.gate_px, *evidence, i / pixels, x, y, d, of_measurement.disparity);
    }
    if (!verdict.counts) of_measurement = kNone;
    const bool lives = verdict.lives && !is_hidden;
    const Estimate estimate =
        update(options, drift, {predicted.disparity[i], predicted.variance[i] + drift * drift, false}, of_measurement);
    const bool is_there = lives && is_valid(estimate);
    out.disparity[i] = is_there ? estimate.disparity : EGOSGM_INVALID_DISPARITY;
    out.doubtful.push_back(!is_hidden && estimate.doubtful);
    out.variance[i] = is_there ? std::max(estimate.variance, options.min_variance_px2) : 0;
    out.evidence.push_back(static_cast<std::uint8_t>(is_there ? verdict.evidence : 0));
  }
  return out;
}

}  // namespace egosgm::reference
