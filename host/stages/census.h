// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "egosgm/image.h"
#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Computes a code a pixel of both views, which matching compares, in padded rows, the right view's from right to left
/// (see kernels/stages/census.cl).
class Census {
 public:
  /// Codes may be read up to `padding` pixels outside the image. `pixels`: of a work-item, 1 or 16; 0: what suits the
  /// device. Same bits. `words`: of a code, which stands twice where it needs one of two; 0: what it needs.
  Census(ocl::Context& context, shared::ImageSize size, PixelType type, MatchingCost cost, int padding, int pixels = 0,
         int words = 0);

  /// `images`: both views' pixels, the left view first, without gaps. Leaves the codes of absent rows as they are.
  void encode(const ocl::Buffer<cl_uchar>& images, ocl::Buffer<cl_uint>& codes, cl_int row_step = 1) {
    encode(images, codes, row_step, false);
  }
  /// Which pixels of each window are about as bright as its centre. REQUIRES: the census of 9x7 of 16 bits.
  void encode_alike(const ocl::Buffer<cl_uchar>& images, ocl::Buffer<cl_uint>& codes) {
    encode(images, codes, 1, true);
  }

  /// 32-bit words of a code, and of all codes.
  static int words(MatchingCost cost) { return cost == MatchingCost::kCensus9x7 ? 2 : 1; }
  static std::size_t words(MatchingCost cost, shared::ImageSize size, int padding, int code_words = 0) {
    return 2 * (static_cast<std::size_t>(size.width) + 2 * static_cast<std::size_t>(padding)) * size.height *
           std::max(code_words, words(cost));
  }

  using Kernel = ocl::Kernel<const shared::ImageSize, const cl_int, const cl_int, const cl_int,
                             const ocl::Buffer<cl_uchar>, ocl::Buffer<cl_uint>>;

 private:
  void encode(const ocl::Buffer<cl_uchar>& images, ocl::Buffer<cl_uint>& codes, cl_int row_step, bool alike);

  ocl::Stage stage_;
  const cl_int padding_;
  Kernel census_;
};

}  // namespace egosgm
