// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/output_variance.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "tests/reference/method.h"

namespace egosgm::reference {
namespace {

/// A map of one view.
struct Plane {
  shared::ImageSize size;
  const float* values;

  float operator()(int x, int y) const { return values[static_cast<std::size_t>(y) * size.width + x]; }
  /// A pixel on the image's edge is its own neighbour.
  float beside(int x, int y, int dx, int dy) const {
    const int u = x + dx, v = y + dy;
    return u >= 0 && u < size.width && v >= 0 && v < size.height ? (*this)(u, v) : (*this)(x, y);
  }
};

float second_difference(float before, float at, float after) {
  for (const float d : {before, at, after}) {
    if (d == EGOSGM_INVALID_DISPARITY) return kMaxRoughnessPx;
  }
  return std::min(std::abs(before + after - 2 * at), kMaxRoughnessPx);
}

std::vector<float> roughness(const Plane& disparity, int row_step) {
  std::vector<float> out;
  for (int y = 0; y < disparity.size.height; ++y) {
    for (int x = 0; x < disparity.size.width; ++x) {
      const float d = disparity(x, y);
      const float across = second_difference(disparity.beside(x, y, -1, 0), d, disparity.beside(x, y, 1, 0));
      const float down =
          second_difference(disparity.beside(x, y, 0, -row_step), d, disparity.beside(x, y, 0, row_step));
      out.push_back(across + down * (1 / static_cast<float>(row_step)));
    }
  }
  return out;
}

/// Mean of `at(i - radius), at(i - radius + step), ...`, as far as they lie in [0, end) and are multiples of `of`.
template <typename At>
float mean(int i, int radius, int step, int end, int of, At&& at) {
  float sum = 0, count = 0;
  for (int k = i - radius; k <= i + radius; k += step) {
    if (k < 0 || k >= end || k % of != 0) continue;
    sum += at(k);
    count += 1;
  }
  return sum / count;
}

/// Of the means of the rows.
float window_mean(const Plane& plane, int row_step, int x, int y, int radius, int step) {
  return mean(y, radius, step, plane.size.height, row_step,
              [&](int v) { return mean(x, radius, step, plane.size.width, 1, [&](int u) { return plane(u, v); }); });
}

/// The largest of the differences to the valid disparities kJumpDistance pixels off, to eight sides.
float jump_beside(const Plane& disparity, int row_step, int x, int y) {
  float most = 0;
  for (const int dy : {-kJumpDistance, 0, kJumpDistance}) {
    for (const int dx : {-kJumpDistance, 0, kJumpDistance}) {
      const int u = x + dx, v = y + dy;
      if (u < 0 || u >= disparity.size.width || v < 0 || v >= disparity.size.height) continue;
      if (v % row_step != 0) continue;
      if (disparity(u, v) == EGOSGM_INVALID_DISPARITY) continue;
      most = std::max(most, std::abs(disparity(u, v) - disparity(x, y)));
    }
  }
  return std::min(most, kMaxJumpPx);
}

/// (p r^3)^(1/4) of every pixel of both views, each cut.
std::vector<float> blends(const testing::HostMaps& belief, const testing::HostMaps& measured) {
  std::vector<float> out;
  for (std::size_t i = 0; i < belief.variance.size(); ++i) {
    const float most = kMaxMeanVariancePx2;
    const bool is_measured = measured.disparity[i] != EGOSGM_INVALID_DISPARITY;
    const float r = is_measured ? std::min(measured.variance[i], most) : most;
    const bool is_there = belief.disparity[i] != EGOSGM_INVALID_DISPARITY;
    const float p = is_there ? std::min(belief.variance[i], most) : 0;
    out.push_back(std::sqrt(r * std::sqrt(r * p)));
  }
  return out;
}

float calibrated(float sum) {
  const float square = sum * sum;
  return 0.36f / (1 + 0.07f / square) + 2.52f * std::sqrt(sum) / (1 + 0.8f / (square * square * sum));
}

}  // namespace

std::vector<float> output_variance(shared::ImageSize size, int row_step, const OutputVarianceOptions& options,
                                   const std::vector<float>& output, const testing::HostMaps& belief,
                                   const testing::HostMaps& measured) {
  if (!options.enabled) return testing::masked({output, belief.variance}).variance;
  std::vector<float> out;
  const std::vector<float> variances = blends(belief, measured);
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
  for (std::size_t view = 0; view < 2; ++view) {
    const Plane disparity{size, output.data() + view * pixels};
    const Plane variance{size, variances.data() + view * pixels};
    const std::vector<float> rough = roughness(disparity, row_step);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        if (y % row_step != 0) {
          out.push_back(0);
          continue;
        }
        const float p = window_mean(variance, row_step, x, y, kVarianceRadius, kVarianceStep);
        const float r = window_mean({size, rough.data()}, row_step, x, y, kRoughnessRadius, 1);
        const bool is_valid = disparity(x, y) != EGOSGM_INVALID_DISPARITY;
        const float j = jump_beside(disparity, row_step, x, y);
        const float sum =
            options.scale * (p * std::sqrt(p)) + options.roughness_weight * (r * r) + options.jump_weight * (j * j);
        out.push_back(is_valid ? calibrated(sum) : 0);
      }
    }
  }
  return out;
}

}  // namespace egosgm::reference
