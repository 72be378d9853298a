// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// Disparities [px] of a small rectified pair of kU8 from -half to half - 1; kNoValue where none is sure.
Image match_widely(const Image& left, const Image& right, int half);

/// An image of kU8 made smaller: each pixel is the mean of factor x factor ones, of the image moved up by
/// `down_px`.
Image shrunk_grey(const Image& image, int factor, double down_px);

}  // namespace egosgm::vision
