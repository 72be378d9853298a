// SPDX-License-Identifier: Apache-2.0
#include "host/stages/banded_sgm_paths.h"

#include <algorithm>

#include "host/stages/census.h"
#include "host/stages/search_band.h"

namespace egosgm {
namespace {

// Stages of kernels/sgm/banded_sgm_paths.cl.
constexpr int kStraight = 0;
constexpr int kDiagonals[] = {1, 2};

// Disparities of a work-item at once: where work-items are lanes of a GPU, and where they hold vectors.
constexpr int kQuad = 4, kVector = 16;
constexpr int kGroupSize = 32;

int groups_of(int lines, int lines_a_group) { return (lines + lines_a_group - 1) / lines_a_group; }

bool is_gpu(const ocl::Context& context) { return context.device().getInfo<CL_DEVICE_TYPE>() == CL_DEVICE_TYPE_GPU; }

int vector_of(const ocl::Context& context) { return is_gpu(context) ? kQuad : kVector; }

/// A pixel's vectors hold so many cells more than its band, which may begin and end within one.
int spare_cells(int vector) { return vector == kQuad ? kQuad : vector + EGOSGM_LANES; }

ocl::Defines defines(const ocl::Context& context, shared::DisparityRange range, const BandedSgmOptions& options,
                     BandedSgmPaths::Group group) {
  return sgm_defines(SearchBand::max_chunks(range), Census::words(options.cost), options)
      .set("LANES", group.lanes)
      .set("LINES", group.lines)
      .set("VECTOR", vector_of(context));
}

}  // namespace

BandedSgmPaths::Group BandedSgmPaths::default_group(const ocl::Context& context, shared::DisparityRange range,
                                                    MatchingCost cost) {
  if (!is_gpu(context)) return {1, 1};
  const int limit = static_cast<int>(std::min<std::size_t>(context.max_work_group_size(), kGroupSize));
  const int quads = SearchBand::max_chunks(range) * EGOSGM_LANES / kQuad;
  const int quads_a_lane = Census::words(cost) == 1 ? 2 : 1;
  int lanes = std::min(2, limit);
  while (quads_a_lane * lanes < quads && 2 * lanes <= limit) lanes *= 2;
  return {lanes, limit / lanes};
}

std::size_t BandedSgmPaths::sum_bytes(const ocl::Context& context, shared::ImageSize size,
                                      shared::DisparityRange range) {
  return 2 * pixel_count(size) * (SearchBand::max_chunks(range) * EGOSGM_LANES + spare_cells(vector_of(context)));
}

ocl::Defines sgm_defines(int max_chunks, int code_words, const BandedSgmOptions& options) {
  ocl::Defines defines;
  defines.set("MAX_CHUNKS", max_chunks)
      .set("PATHS", options.paths)
      .set("CODE_BYTES", 4 * code_words)
      .set("COST_SAD", options.cost == MatchingCost::kSad3x3 ? 1 : 0)
      .set("COST_SCALE", code_words == 2 ? 1 : 2);
  return defines;
}

BandedSgmPaths::BandedSgmPaths(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
                               const BandedSgmOptions& options, Group group)
    : stage_(context, "BandedSgm", "banded_sgm_paths.cl", size, 1, defines(context, range, options, group),
             ocl::Joins::kNo),
      paths_(options.paths),
      group_(group),
      forward_first_(context, ocl::Scratch::kOfStage0, sum_bytes(context, size, range)),
      forward_second_(context, ocl::Scratch::kOfStage1, sum_bytes(context, size, range)),
      backward_first_(context, ocl::Scratch::kOfStage2, sum_bytes(context, size, range)),
      backward_second_(context, ocl::Scratch::kOfStage3, sum_bytes(context, size, range)),
      follow_paths_(stage_, "follow_paths"),
      find_winners_(stage_, "find_winners") {}

void BandedSgmPaths::follow(int stage, const shared::SgmParameters& parameters, const MatchInputs& inputs,
                            Views views) {
  const int groups = stage == kStraight
                         ? groups_of(stage_.size().height, group_.lines) + groups_of(stage_.size().width, group_.lines)
                         : groups_of(stage_.size().width + stage_.size().height - 1, group_.lines);
  const int work_items = group_.lanes * group_.lines;
  const ocl::Range lines{cl::NDRange(work_items, groups, 2 * count(views)), cl::NDRange(work_items, 1, 1)};
  const cl_int view_count = count(views);
  stage_.launch(follow_paths_, lines, parameters, stage, view_count, inputs.codes, inputs.penalties, inputs.bands.bands,
                inputs.bands.cell_offsets, forward_first_, forward_second_, backward_first_, backward_second_);
}

void BandedSgmPaths::match(const shared::SgmParameters& parameters, const MatchInputs& inputs, StereoMaps& measured,
                           ocl::Buffer<cl_uint>& ranks, Views views) {
  follow(kStraight, parameters, inputs, views);
  if (paths_ == 8) {
    for (const int diagonal : kDiagonals) follow(diagonal, parameters, inputs, views);
  }
  const int work_items = group_.lanes * group_.lines;
  const int groups_a_row = groups_of(stage_.size().width, group_.lines);
  const ocl::Range pixels{
      cl::NDRange(static_cast<std::size_t>(groups_a_row) * work_items, stage_.size().height, count(views)),
      cl::NDRange(work_items, 1, 1)};
  stage_.launch(find_winners_, pixels, parameters, inputs.codes, inputs.bands.bands, inputs.bands.cell_offsets,
                forward_first_, forward_second_, backward_first_, backward_second_, measured.disparity,
                measured.variance, ranks);
}

}  // namespace egosgm
