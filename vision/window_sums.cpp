// SPDX-License-Identifier: Apache-2.0
#include "vision/window_sums.h"

#include <algorithm>
#include <cmath>

#include "host/cpu_clones.h"
#include "vision/no_value.h"

namespace egosgm::vision {
namespace {

constexpr int kRadius_px = 4, kStep_px = 2, kMinCount = 3;

/// Adds what alike neighbours say. `neighbours`: their disparities, kNoValue where they have no value.
EGOSGM_CPU_CLONES
void add_alike(const float* disparities, const float* tolerances, const float* neighbours, const float* values,
               int count, float* __restrict sums, float* __restrict counts) {
  for (int i = 0; i < count; ++i) {
    const bool is_alike = std::abs(neighbours[i] - disparities[i]) <= tolerances[i];
    sums[i] += is_alike ? values[i] : 0.0f;
    counts[i] += is_alike ? 1.0f : 0.0f;
  }
}

}  // namespace

BoxValues means_of_alike(const Box& box, const BoxValues& disparities, const BoxValues& values) {
  const int width = box.width();
  const auto row_of = [&](int y) { return static_cast<std::ptrdiff_t>(y) * width; };
  BoxValues tolerances(box.area()), neighbours(box.area()), means(box.area(), 0);
  for (std::size_t i = 0; i < box.area(); ++i) {
    tolerances[i] = static_cast<float>(alike_px(disparities[i]));
    neighbours[i] = has_value(values[i]) ? disparities[i] : kNoValue;
  }
  std::vector<float> sums, counts;
  for (int y = 0; y < box.height(); ++y) {
    sums.assign(static_cast<std::size_t>(width), 0);
    counts.assign(static_cast<std::size_t>(width), 0);
    for (int v = y - kRadius_px; v <= y + kRadius_px; v += kStep_px) {
      if (v < 0 || v >= box.height()) continue;
      for (int by = -kRadius_px; by <= kRadius_px; by += kStep_px) {
        const int x = std::max(0, -by), end = std::min(width, width - by);
        if (x >= end) continue;
        add_alike(&disparities[row_of(y) + x], &tolerances[row_of(y) + x], &neighbours[row_of(v) + x + by],
                  &values[row_of(v) + x + by], end - x, &sums[x], &counts[x]);
      }
    }
    for (int x = 0; x < width; ++x) {
      if (counts[x] >= kMinCount) means[row_of(y) + x] = sums[x] / counts[x];
    }
  }
  return means;
}

}  // namespace egosgm::vision
