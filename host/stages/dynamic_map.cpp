// SPDX-License-Identifier: Apache-2.0
#include "host/stages/dynamic_map.h"

#include <utility>

#include "host/stages/forward_warp.h"
#include "kernels/method.h"

namespace egosgm {
namespace {

shared::ImageSize divided(shared::ImageSize size, int by) { return {size.width / by, size.height / by}; }

Motion inverse(const Motion& motion) {
  Motion result;
  result.current_from_previous = motion.current_from_previous.inverse();
  return result;
}

}  // namespace

DynamicMap::Level::Level(ocl::Context& context, shared::ImageSize size, int pixels)
    : image(divided(size, pixels / 2)),
      blocks(divided(size, pixels)),
      last(context, pixel_count(image)),
      current(context, pixel_count(image)),
      last_codes(context, ocl::Scratch::kOfStage0, pixel_count(image)),
      current_codes(context, ocl::Scratch::kOfStage1, pixel_count(image)),
      disparity(context, pixel_count(blocks)),
      places(context, ocl::Scratch::kOfStage3, pixel_count(blocks)),
      found(context, pixel_count(blocks)),
      costs(context, ocl::Scratch::kOfStage2, EGOSGM_DYNAMIC_PLACES * EGOSGM_DYNAMIC_PLACES * pixel_count(blocks)),
      marks(context, pixel_count(blocks)) {}

std::vector<DynamicMap::Level> DynamicMap::levels(ocl::Context& context, shared::ImageSize size) {
  context.enter("DynamicMap");
  std::vector<Level> levels;
  for (int side = EGOSGM_DYNAMIC_BLOCK; side <= EGOSGM_DYNAMIC_MAX_BLOCK; side *= 2) {
    const shared::ImageSize blocks = divided(size, side);
    if (blocks.width > 0 && blocks.height > 0) levels.emplace_back(context, size, side);
  }
  return levels;
}

DynamicMap::DynamicMap(ocl::Context& context, shared::ImageSize size, const Calibration& calibration,
                       std::vector<Level> levels, int pixels)
    : stage_(context, "DynamicMap", "dynamic_map.cl", size, pixels),
      calibration_(calibration),
      levels_(std::move(levels)),
      halve_(stage_, "halve"),
      shrink_(stage_, "shrink_halves"),
      encode_(stage_, "encode_small"),
      compare_(stage_, "compare_places"),
      find_(stage_, "find_places"),
      vote_(stage_, "vote_blocks"),
      mark_(stage_, "mark") {}

void DynamicMap::keep(const FrameImages& images, ocl::Buffer<cl_ushort>& halved) {
  const shared::ImageSize size = half(stage_.size());
  if (size.width == 0 || size.height == 0) return;
  const ocl::Range each = ocl::every_pixels(stage_.enter(), size, stage_.pixels(), /*views=*/1);
  stage_.launch(halve_, each, stage_.size(), images.type == PixelType::kU8 ? 1 : 2, images.pixels, halved);
}

void DynamicMap::mark(const Frame& last, const Frame& current, const Motion& current_from_previous,
                      ocl::Buffer<cl_uchar>& marks) {
  ocl::Context& context = stage_.enter();
  if (levels_.empty()) return marks.fill(context, 0);
  const auto each = [&](shared::ImageSize size, int views) {
    return ocl::every_pixels(context, size, stage_.pixels(), views);
  };
  const shared::DisparityMotion motion = disparity_motion(calibration_, inverse(current_from_previous), EGOSGM_LEFT);
  const Greys *last_greys = &last.halved, *greys = &current.halved;
  const Level* finer = nullptr;
  int side = EGOSGM_DYNAMIC_BLOCK;
  for (Level& level : levels_) {
    if (finer) {
      stage_.launch(shrink_, each(level.image, 2), finer->image, *last_greys, *greys, level.last, level.current);
      last_greys = &level.last;
      greys = &level.current;
    }
    stage_.launch(encode_, each(level.image, 2), level.image, *last_greys, *greys, level.last_codes,
                  level.current_codes);
    stage_.launch(compare_, each(level.blocks, 1), stage_.size(), level.image, level.blocks, side, motion,
                  level.last_codes, level.current_codes, last.disparity, current.disparity, level.disparity,
                  level.places, level.costs);
    stage_.launch(find_, each(level.blocks, 1), level.blocks, finer == nullptr, level.places, level.costs, level.found);
    finer = &level;
    side *= 2;
  }
  const Level* coarser = nullptr;
  for (std::size_t i = levels_.size(); i-- > 0; coarser = &levels_[i]) {
    Level& level = levels_[i];
    const shared::ImageSize coarse = coarser ? coarser->blocks : shared::ImageSize{0, 0};
    stage_.launch(vote_, each(level.blocks, 1), level.blocks, coarse, i == 0, level.found,
                  coarser ? coarser->marks : level.marks, level.marks);
  }
  const Level& finest = levels_.front();
  stage_.launch(mark_, each(finest.blocks, 1), stage_.size(), finest.blocks, current.disparity, finest.disparity,
                finest.marks, marks);
}

}  // namespace egosgm
