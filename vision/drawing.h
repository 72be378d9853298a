// SPDX-License-Identifier: Apache-2.0
// Tools to draw pictures of maps.
#pragma once

#include <string>

#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// Throws InvalidArgument unless a picture may be so wide.
void require_width(int width);

/// The colour of a place in 0..1 on the scale Turbo (Mikhailov 2019), BGR.
Color turbo(double position);

/// Letters are 7 pixels high, times `scale`.
int text_width(const std::string& text, int scale);
/// White letters of ASCII; what lies outside of the picture, kBgr8, is cut off. The lowest row is that above
/// `bottom`.
void draw_text(Image& picture, const std::string& text, int left, int bottom, int scale);

/// A kBgr8 picture made smaller: each pixel is the mean of what it covers. REQUIRES: `size` is not larger.
Image shrunk(const Image& picture, Size size);

/// One picture below the other. REQUIRES: both are as wide, or `above` is empty.
Image stacked(const Image& above, const Image& below);

}  // namespace egosgm::vision
