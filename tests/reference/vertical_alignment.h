// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "kernels/shared.h"

namespace egosgm::reference {

/// Vertical offset of the right image [px]: terms of 1, u, v, u v, u^2, v^2, with u and v from -1 to 1 over the image;
/// and the number of estimates that they rest on.
struct VerticalOffset {
  std::array<float, EGOSGM_OFFSET_TERMS> terms_px{};
  float estimates = 0;
};

/// Of a place in the right image, at most 2 px.
float offset_at(shared::ImageSize size, const VerticalOffset& offset, int x, int y);

/// `images`: the grey values of both views. Each value of the right view is read further down by the offset in the
/// middle of its sixteen columns, to a 256th.
std::vector<int> resample(shared::ImageSize size, const VerticalOffset& offset, const std::vector<int>& images);

/// A Gauss-Newton step from `known`, which `aligned` were resampled by; `grey`: 1 for images of 8 bits, 256 for 16.
VerticalOffset estimate_offset(shared::ImageSize size, float gain, const std::vector<int>& aligned, int grey,
                               const std::vector<float>& left_disparity, const VerticalOffset& known);

}  // namespace egosgm::reference
