// SPDX-License-Identifier: Apache-2.0
#include "host/stages/speckle_removal.h"

namespace egosgm {

SpeckleRemoval::SpeckleRemoval(ocl::Context& context, shared::ImageSize size, const SpeckleRemovalOptions& options,
                               int strip_rows, int row_group)
    : stage_(ocl::Stage::of_row_groups(context, "SpeckleRemoval", "speckle_removal.cl", size, row_group)),
      options_(options),
      max_size_(static_cast<cl_uint>(std::max(options.max_size_px, 0))),
      strip_rows_(strip_rows > 0           ? strip_rows
                  : stage_.row_group() > 1 ? 1
                                           : cpu_tuning().speckle_strip_rows),
      runs_(context, 2 * pixel_count(size)),
      parents_(context, ocl::Scratch::kOfStage0, 2 * pixel_count(size)),
      roots_(context, ocl::Scratch::kOfStage1, 2 * pixel_count(size)),
      sizes_(context, ocl::Scratch::kOfStage2, 2 * pixel_count(size)),
      find_runs_(stage_, "find_runs"),
      join_strips_(stage_, "join_strips"),
      join_seams_(stage_, "join_seams"),
      measure_(stage_, "measure"),
      drop_(stage_, "drop") {}

void SpeckleRemoval::remove(Map& disparity, Views views) {
  if (options_.max_size_px <= 0) return;
  const shared::ImageSize size = stage_.size();
  const int strips = (size.height + strip_rows_ - 1) / strip_rows_;
  stage_.launch_rows(find_runs_, views.count, options_.max_difference_px, disparity, runs_, parents_, sizes_);
  if (strip_rows_ > 1) {
    stage_.launch(join_strips_, ocl::every_row(stage_.enter(), {1, strips}, views.count), size,
                  options_.max_difference_px, strip_rows_, disparity, runs_, parents_);
  }
  if (strips > 1) {
    stage_.launch(join_seams_, ocl::every_pixel(stage_.enter(), {size.width, strips - 1}, views.count), size,
                  options_.max_difference_px, strip_rows_, disparity, runs_, parents_);
  }
  stage_.launch_pixels(measure_, views.count, runs_, parents_, roots_, sizes_);
  stage_.launch_pixels(drop_, views.count, max_size_, runs_, roots_, sizes_, disparity);
}

}  // namespace egosgm
