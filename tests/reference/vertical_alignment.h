// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "kernels/shared.h"

namespace egosgm::reference {

/// Vertical offset of the right image [px], and the number of estimates that it rests on.
struct VerticalOffset {
  float offset_px = 0, estimates = 0;
};

/// `images`: the grey values of both views. Each value of the right view is read `offset_px` further down, to a 256th.
std::vector<int> resample(shared::ImageSize size, float offset_px, const std::vector<int>& images);

/// A Gauss-Newton step from `known`, which `aligned` were resampled by; `grey`: 1 for images of 8 bits, 256 for 16.
VerticalOffset estimate_offset(shared::ImageSize size, float gain, const std::vector<int>& aligned, int grey,
                               const std::vector<float>& left_disparity, VerticalOffset known);

}  // namespace egosgm::reference
