// SPDX-License-Identifier: Apache-2.0
#include "host/stages/textureless_regions.h"

#include "kernels/method.h"

namespace egosgm {

TexturelessRegions::TexturelessRegions(ocl::Context& context, shared::ImageSize size, PixelType type, int pixels)
    : stage_(context, "TexturelessRegions", "textureless_regions.cl", size, pixels, pixel_define(type)),
      blocks_(shared::coarse_size(size)),
      labels_(context, ocl::Scratch::kOfStage0, 2 * pixel_count(blocks_)),
      counts_(context, ocl::Scratch::kOfStage1, 2 * 2 * (static_cast<std::size_t>(blocks_.width) + 1)),
      find_(stage_, "find_textureless"),
      spread_(stage_, "spread_labels"),
      count_(stage_, "count_filled"),
      leave_out_(stage_, "leave_out") {}

void TexturelessRegions::leave_out(const ocl::Buffer<cl_uchar>& images, Map& disparity, Views views) {
  const ocl::Range each = ocl::every_pixels(stage_.enter(), blocks_, stage_.pixels(), views.count);
  const ocl::Range each_row = ocl::every_row(stage_.enter(), blocks_, views.count);
  const ocl::Range each_column = ocl::every_row(stage_.enter(), {1, blocks_.width}, views.count);
  stage_.launch(find_, each, stage_.size(), images, labels_);
  for (int time = 0; time < EGOSGM_TEXTURELESS_SPREADS; ++time) {
    stage_.launch(spread_, each_column, blocks_, /*in_rows=*/0, labels_);
    stage_.launch(spread_, each_row, blocks_, /*in_rows=*/1, labels_);
  }
  counts_.fill(stage_.enter(), 0);
  stage_.launch(count_, each, stage_.size(), views.row_step, disparity, labels_, counts_);
  stage_.launch(leave_out_, each, stage_.size(), views.row_step, images, labels_, counts_, disparity);
}

}  // namespace egosgm
