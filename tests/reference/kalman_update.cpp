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

/// One view, and what the pixels of it say.
class View {
 public:
  View(shared::ImageSize size, const float* predicted, const float* measured)
      : size_(size), predicted_(predicted), measured_(measured) {}

  /// Of the pixels around, those measured nearer than predicted (sign 1), or farther (-1), by more than a pixel.
  int moving(int x, int y, float sign) const {
    return count(x, y, [&](std::size_t i) { return is_moving(i, sign); });
  }
  /// Those to the left and to the right among them.
  bool is_between_moving(int x, int y, float sign) const {
    const std::size_t i = static_cast<std::size_t>(y) * size_.width + x;
    return x >= kSupportStep && x + kSupportStep < size_.width && is_moving(i - kSupportStep, sign) &&
           is_moving(i + kSupportStep, sign);
  }

 private:
  bool is_moving(std::size_t i, float sign) const {
    return predicted_[i] != EGOSGM_INVALID_DISPARITY && measured_[i] != EGOSGM_INVALID_DISPARITY &&
           sign * (measured_[i] - predicted_[i]) > kDifferencePx;
  }

  template <typename Condition>
  int count(int x, int y, Condition&& condition) const {
    int found = 0;
    for (int v = -2; v <= 2; ++v) {
      for (int u = -2; u <= 2; ++u) {
        const int column = x + u * kSupportStep, row = y + v * kSupportStep;
        if (column < 0 || column >= size_.width || row < 0 || row >= size_.height) continue;
        found += condition(static_cast<std::size_t>(row) * size_.width + column);
      }
    }
    return found;
  }

  const shared::ImageSize size_;
  const float *predicted_, *measured_;
};

bool contradict(float gate_px, float a, float b) { return gate_px > 0 && std::abs(a - b) > gate_px; }

Estimate update(const KalmanUpdateOptions& options, const View& view, int x, int y, const Estimate& predicted,
                const Estimate& measured) {
  if (!is_valid(measured)) return options.keep_predicted ? predicted : kNone;
  const bool is_plain = options.gate_px <= 0;  // the paper's: all that is predicted and measured is averaged
  const float z = measured.disparity, wide = kDoubtfulVariancePx2;
  if (!is_valid(predicted)) return measured;
  const float innovation = z - predicted.disparity;
  if (!contradict(options.gate_px, z, predicted.disparity) && (is_plain || !measured.doubtful)) {
    const bool moves = options.ask_neighbours && std::abs(innovation) > kDifferencePx &&
                       view.is_between_moving(x, y, innovation > 0 ? 1.0f : -1.0f) &&
                       view.moving(x, y, innovation > 0 ? 1.0f : -1.0f) >= 13;
    return moves ? Estimate{z, wide, true} : fuse(predicted, measured);
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
    const View view(size, &predicted.disparity[first], &measured.disparity[first]);
    const bool is_hidden = options.gate_px > 0 && !predicted.hidden.empty() && predicted.hidden[i] != 0;
    Estimate of_measurement{measured.disparity[i], measured.variance[i],
                            !measured.doubtful.empty() && measured.doubtful[i] != 0};
    Verdict verdict{kMostEvidence, true, true};
    if (evidence) {
      const float d = predicted.disparity[i];
      const bool is_new = d == EGOSGM_INVALID_DISPARITY || std::abs(of_measurement.disparity - d) > options.gate_px;
      if (is_valid(of_measurement) && is_new &&
          supporters_of(size, measured, first, x, y, of_measurement.disparity, 2) < 1) {
        of_measurement = kNone;
      }
      verdict = judge(size, options.gate_px, *evidence, i / pixels, x, y, d, of_measurement.disparity);
    }
    if (!verdict.counts) of_measurement = kNone;
    const bool lives = verdict.lives && !is_hidden;
    const Estimate estimate =
        update(options, view, x, y, {predicted.disparity[i], predicted.variance[i], false}, of_measurement);
    const bool is_there = lives && is_valid(estimate);
    out.disparity[i] = is_there ? estimate.disparity : EGOSGM_INVALID_DISPARITY;
    out.doubtful.push_back(!is_hidden && estimate.doubtful);
    out.variance[i] = is_there ? std::max(estimate.variance, options.min_variance_px2) : 0;
    out.evidence.push_back(static_cast<std::uint8_t>(is_there ? verdict.evidence : 0));
  }
  return out;
}

}  // namespace egosgm::reference
