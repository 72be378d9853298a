// SPDX-License-Identifier: Apache-2.0
#include "host/align/vertical_alignment.h"

#include <algorithm>
#include <vector>

#include "kernels/method.h"

namespace egosgm {
namespace {

constexpr int kSums = 9;  // a row, as kernels/align/vertical_alignment.cl has them
constexpr std::size_t kTerms = EGOSGM_OFFSET_TERMS + 1;

ocl::Program& build(ocl::Context& context, PixelType type, int row_group) {
  context.enter("VerticalAlignment");
  return context.program("vertical_alignment.cl", ocl::Defines()
                                                      .set("PIXEL_BYTES", type == PixelType::kU8 ? 1 : 2)
                                                      .set("ROW_GROUP", row_group)
                                                      .set("PIXELS", row_group == 1 ? 16 : 1));
}

int sampled_rows(shared::ImageSize size) {
  constexpr int kStride = EGOSGM_ALIGNED_ROW_STRIDE;
  return std::max(1, (size.height - 2 * EGOSGM_ALIGNED_BORDER_ROWS + kStride - 1) / kStride);
}

}  // namespace

VerticalOffset::VerticalOffset(ocl::Context& context) : terms(context, kTerms) {
  terms.write(context, std::vector<float>(kTerms));
}

VerticalAlignment::Sums::Sums(ocl::Context& context, shared::ImageSize size)
    : of_rows(context, kSums * static_cast<std::size_t>(sampled_rows(size))) {}

VerticalAlignment::VerticalAlignment(ocl::Context& context, shared::ImageSize size, PixelType type,
                                     const VerticalAlignmentOptions& options, Sums sums, int row_group)
    : context_((context.enter("VerticalAlignment"), context)),
      size_(size),
      gain_(options.gain),
      row_group_(row_group > 0 ? row_group : ocl::row_group(context)),
      resample_(build(context, type, row_group_), "resample"),
      sum_residuals_(build(context, type, row_group_), "sum_residuals"),
      update_terms_(build(context, type, row_group_), "update_terms"),
      sums_(std::move(sums)) {}

void VerticalAlignment::resample(const FrameImages& images, const VerticalOffset& offset, FrameImages& aligned) {
  context_.enter("VerticalAlignment");
  aligned.type = images.type;
  resample_(context_, ocl::group_a_row(size_, row_group_), size_, offset.terms, images.pixels, aligned.pixels);
}

void VerticalAlignment::estimate(const FrameImages& aligned, const Map& disparity, const VerticalOffset& offset,
                                 VerticalOffset& improved) {
  context_.enter("VerticalAlignment");
  const cl_int rows = sampled_rows(size_);
  sum_residuals_(context_, ocl::group_a_row({size_.width, rows}, row_group_, 1), size_, aligned.pixels, disparity,
                 sums_.of_rows);
  update_terms_(context_, ocl::group_a_row({size_.width, 1}, row_group_, 1), size_, rows, gain_, sums_.of_rows,
                offset.terms, improved.terms);
  improved.is_known = true;
}

}  // namespace egosgm
