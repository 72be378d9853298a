// SPDX-License-Identifier: Apache-2.0
#include "host/stages/vertical_alignment.h"

#include <algorithm>
#include <vector>

#include "kernels/method.h"

namespace egosgm {
namespace {

constexpr int kSums = 9;  // a row, as kernels/stages/vertical_alignment.cl has them
constexpr std::size_t kTerms = EGOSGM_OFFSET_TERMS + 1;

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
    : stage_(ocl::Stage::of_row_groups(context, "VerticalAlignment", "vertical_alignment.cl", size, row_group,
                                       pixel_define(type))),
      gain_(options.gain),
      resample_(stage_, "resample"),
      sum_residuals_(stage_, "sum_residuals"),
      update_terms_(stage_, "update_terms"),
      sums_(std::move(sums)) {}

void VerticalAlignment::resample(const FrameImages& images, const VerticalOffset& offset, FrameImages& aligned) {
  aligned.type = images.type;
  stage_.launch_rows(resample_, /*views=*/2, offset.terms, images.pixels, aligned.pixels);
}

void VerticalAlignment::estimate(const FrameImages& aligned, const Map& disparity, const VerticalOffset& offset,
                                 VerticalOffset& improved) {
  const shared::ImageSize size = stage_.size();
  const cl_int rows = sampled_rows(size);
  stage_.launch(sum_residuals_, ocl::group_a_row({size.width, rows}, stage_.row_group(), 1), size, aligned.pixels,
                disparity, sums_.of_rows);
  stage_.launch(update_terms_, ocl::group_a_row({size.width, 1}, stage_.row_group(), 1), size, rows, gain_,
                sums_.of_rows, offset.terms, improved.terms);
  improved.is_known = true;
}

}  // namespace egosgm
