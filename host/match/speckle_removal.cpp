// SPDX-License-Identifier: Apache-2.0
#include "host/match/speckle_removal.h"

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context, int row_group) {
  context.enter("SpeckleRemoval");
  return context.program("speckle_removal.cl",
                         ocl::Defines().set("ROW_GROUP", row_group).set("PIXELS", row_group == 1 ? 16 : 1));
}

}  // namespace

SpeckleRemoval::SpeckleRemoval(ocl::Context& context, shared::ImageSize size, const SpeckleRemovalOptions& options,
                               int strip_rows, int row_group)
    : context_((context.enter("SpeckleRemoval"), context)),
      size_(size),
      options_(options),
      max_size_(static_cast<cl_uint>(std::max(options.max_size_px, 0))),
      row_group_(row_group > 0 ? row_group : ocl::row_group(context)),
      strip_rows_(strip_rows > 0   ? strip_rows
                  : row_group_ > 1 ? 1
                                   : kCpuTuning.speckle_strip_rows),
      runs_(context, 2 * pixel_count(size)),
      parents_(context, ocl::Scratch::kOfStage0, 2 * pixel_count(size)),
      roots_(context, ocl::Scratch::kOfStage1, 2 * pixel_count(size)),
      sizes_(context, ocl::Scratch::kOfStage2, 2 * pixel_count(size)),
      find_runs_(build(context, row_group_), "find_runs"),
      join_strips_(build(context, row_group_), "join_strips"),
      join_seams_(build(context, row_group_), "join_seams"),
      measure_(build(context, row_group_), "measure"),
      drop_(build(context, row_group_), "drop") {}

void SpeckleRemoval::remove(Map& disparity, Views views) {
  if (options_.max_size_px <= 0) return;
  context_.enter("SpeckleRemoval");
  const int strips = (size_.height + strip_rows_ - 1) / strip_rows_;
  const ocl::Range pixels = ocl::every_pixels(context_, size_, row_group_ == 1 ? 16 : 1, count(views));
  find_runs_(context_, ocl::group_a_row(size_, row_group_, count(views)), size_, options_.max_difference_px, disparity,
             runs_, parents_, sizes_);
  if (strip_rows_ > 1) {
    join_strips_(context_, ocl::every_row(context_, {1, strips}, count(views)), size_, options_.max_difference_px,
                 strip_rows_, disparity, runs_, parents_);
  }
  if (strips > 1) {
    join_seams_(context_, ocl::every_pixel(context_, {size_.width, strips - 1}, count(views)), size_,
                options_.max_difference_px, strip_rows_, disparity, runs_, parents_);
  }
  measure_(context_, pixels, size_, runs_, parents_, roots_, sizes_);
  drop_(context_, pixels, size_, max_size_, runs_, roots_, sizes_, disparity);
}

}  // namespace egosgm
