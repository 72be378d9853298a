// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/forward_warp.h"

#include <algorithm>
#include <cmath>

#include "tests/reference/method.h"

namespace egosgm::reference {
namespace {

float row_times(const float (&row)[4], float wx, float wy, float wd) {
  return row[0] * wx + row[1] * wy + row[2] * wd + row[3];
}

float variance_of_motion(const shared::DisparityMotion& m, float u, float v, float d) {
  const float by_disparity = m.noise_dd * d + m.noise_dx * u + m.noise_dy * v;
  const float by_place = u * (m.noise_xx * u + m.noise_xy * v) + m.noise_yy * v * v;
  const float q = d * d * (d * by_disparity + by_place);
  return q < 0 ? 0 : q;
}

// What its surface's disparity changes from `row`, on which a pixel of row y lands, to the nearest one, in steps of
// rows.
float to_nearest_row(shared::ImageSize size, const shared::DisparityMotion& m, int y, float row,
                     const float* disparity) {
  const float nearest = std::nearbyint(row);
  const int step = row < nearest ? m.row_step : -m.row_step;
  if (y + step < 0 || y + step >= size.height) return 0;
  const float beside = disparity[static_cast<std::ptrdiff_t>(step) * size.width], change = beside - *disparity;
  const bool is_one_surface = beside > EGOSGM_INVALID_DISPARITY && std::abs(change) <= kRowsAgreePx;
  return is_one_surface ? std::abs(nearest - row) * change : 0;
}

void warp_view(shared::ImageSize size, shared::DisparityRange range, const shared::DisparityMotion& m,
               float process_noise_px2, const float* disparity, const float* variance, const std::uint8_t* evidence,
               float* out_disparity, float* out_variance, std::uint8_t* out_evidence, std::uint8_t* hidden) {
  for (int y = 0; y < size.height; y += m.row_step) {
    for (int x = 0; x < size.width; ++x) {
      const std::size_t source = static_cast<std::size_t>(y) * size.width + x;
      if (disparity[source] == EGOSGM_INVALID_DISPARITY) continue;
      const float wx = static_cast<float>(x) - m.cx, wy = static_cast<float>(y) - m.cy,
                  wd = disparity[source] + m.doffs;
      const float w = row_times(m.w, wx, wy, wd);
      if (!(w > kMinDepthRatio)) continue;
      const float phi = 1 / w;
      const float u = row_times(m.x, wx, wy, wd) * phi, v = row_times(m.y, wx, wy, wd) * phi, metric = wd * phi;
      const float rows = static_cast<float>(m.row_step), row = (v + m.cy) * (1 / rows);
      const float target_x = std::nearbyint(u + m.cx), target_y = rows * std::nearbyint(row);
      const float d = metric + to_nearest_row(size, m, y, row, disparity + source) - m.doffs + 0.0f;
      if (!(target_x >= 0 && target_x < static_cast<float>(size.width))) continue;
      if (!(target_y >= 0 && target_y < static_cast<float>(size.height))) continue;
      if (!(d >= static_cast<float>(range.min))) continue;
      float p = phi * phi * variance[source] + process_noise_px2 + variance_of_motion(m, u, v, metric);
      if (!(p < kMaxVariancePx2)) p = kMaxVariancePx2;

      const std::size_t target = static_cast<std::size_t>(target_y) * size.width + static_cast<std::size_t>(target_x);
      if (d < out_disparity[target]) continue;
      const bool is_nearer = d > out_disparity[target];
      out_disparity[target] = d;
      out_variance[target] = is_nearer ? p : std::max(p, out_variance[target]);
      out_evidence[target] = is_nearer ? evidence[source] : std::max(evidence[source], out_evidence[target]);
    }
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(size.width) * size.height; ++i) {
    if (!(out_disparity[i] > static_cast<float>(range.min + range.count - 1))) continue;
    out_disparity[i] = EGOSGM_INVALID_DISPARITY;
    out_variance[i] = 0;
    hidden[i] = 1;
  }
}

}  // namespace

testing::HostMaps forward_warp(shared::ImageSize size, shared::DisparityRange range,
                               const shared::DisparityMotion& left, const shared::DisparityMotion& right,
                               float process_noise_px2, const testing::HostMaps& belief) {
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
  testing::HostMaps out{std::vector<float>(2 * pixels, EGOSGM_INVALID_DISPARITY),
                        std::vector<float>(2 * pixels, 0.0f),
                        std::vector<std::uint8_t>(2 * pixels, 0),
                        {},
                        std::vector<std::uint8_t>(2 * pixels, 0)};
  const std::vector<std::uint8_t> evidence =
      belief.evidence.empty() ? std::vector<std::uint8_t>(2 * pixels, 0) : belief.evidence;
  warp_view(size, range, left, process_noise_px2, belief.disparity.data(), belief.variance.data(), evidence.data(),
            out.disparity.data(), out.variance.data(), out.evidence.data(), out.hidden.data());
  warp_view(size, range, right, process_noise_px2, belief.disparity.data() + pixels, belief.variance.data() + pixels,
            evidence.data() + pixels, out.disparity.data() + pixels, out.variance.data() + pixels,
            out.evidence.data() + pixels, out.hidden.data() + pixels);
  return out;
}

}  // namespace egosgm::reference
