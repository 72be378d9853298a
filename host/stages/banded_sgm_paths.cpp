// SPDX-License-Identifier: Apache-2.0
#include "host/stages/banded_sgm_paths.h"

#include <algorithm>

#include "host/stages/census.h"
#include "host/stages/search_band.h"

namespace egosgm {
namespace {

// Disparities of a work-item at once: where work-items are lanes of a GPU, and where they hold vectors.
constexpr int kQuad = 4, kVector = 16;
/// On GPUs: lanes of a path, whose quads hold the band of nine in ten predicted pixels, and a group that fills the
/// largest unit of scheduling (a wavefront of CDNA).
constexpr int kLanes = 8, kGroupSize = 64;
/// The local memory that a group's costs may take, half of what OpenCL promises; 16 bits each, of two pixels a line.
constexpr int kLocalBytes = 16 << 10, kCostBytes = 2 * 2;

int groups_of(int lines, int lines_a_group) { return (lines + lines_a_group - 1) / lines_a_group; }

int vector_of(const ocl::Context& context) { return ocl::is_gpu(context) ? kQuad : kVector; }

/// A pixel's vectors hold so many cells more than its band, which may begin and end within one.
int spare_cells(int vector) { return vector == kQuad ? kQuad : vector + EGOSGM_LANES; }

/// The size of one of the four buffers of partial sums: a byte a cell, and the lanes of a pixel's last vector beyond
/// its band.
std::size_t sum_bytes(shared::ImageSize size, shared::DisparityRange range, int vector) {
  return 2 * pixel_count(size) * (SearchBand::max_chunks(range) * EGOSGM_LANES + spare_cells(vector));
}

ocl::Defines defines(const ocl::Context& context, shared::DisparityRange range, const BandedSgmOptions& options,
                     BandedSgmPaths::Group group) {
  return sgm_defines(SearchBand::max_chunks(range), Census::words(options.cost), options)
      .set("LANES", group.lanes)
      .set("LINES", group.lines)
      .set("VECTOR", vector_of(context));
}

}  // namespace

BandedSgmPaths::Group BandedSgmPaths::default_group(const ocl::Context& context, shared::DisparityRange range) {
  if (!ocl::is_gpu(context)) return {1, 1};
  const int limit = static_cast<int>(std::min<std::size_t>(context.max_work_group_size(), kGroupSize));
  const int quads = SearchBand::max_chunks(range) * EGOSGM_LANES / kQuad;
  int lanes = 1;
  while (lanes < std::min(quads, kLanes) && 2 * lanes <= limit) lanes *= 2;
  while (2 * lanes <= limit && limit / lanes * quads * kQuad * kCostBytes > kLocalBytes) lanes *= 2;
  return {lanes, limit / lanes};
}

std::size_t BandedSgmPaths::most_sum_bytes(shared::ImageSize size, shared::DisparityRange range) {
  return sum_bytes(size, range, kVector);
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
      forward_first_(context, ocl::Scratch::kOfStage0, sum_bytes(size, range, vector_of(context))),
      forward_second_(context, ocl::Scratch::kOfStage1, sum_bytes(size, range, vector_of(context))),
      backward_first_(context, ocl::Scratch::kOfStage2, sum_bytes(size, range, vector_of(context))),
      backward_second_(context, ocl::Scratch::kOfStage3, sum_bytes(size, range, vector_of(context))),
      follow_paths_(stage_, "follow_paths"),
      find_winners_(stage_, "find_winners") {}

void BandedSgmPaths::follow(int pass, const shared::SgmParameters& parameters, const MatchInputs& inputs, Views views) {
  const auto [width, height] = stage_.size();
  const int diagonals = width + height - 1;
  const int first_lines = pass == 0 ? height : width, second_lines = paths_ == 8 ? diagonals : width;
  const int groups = groups_of(first_lines, group_.lines) + groups_of(second_lines, group_.lines);
  const int work_items = group_.lanes * group_.lines;
  const ocl::Range lines{cl::NDRange(work_items, groups, 2 * views.count), cl::NDRange(work_items, 1, 1)};
  const cl_int view_count = views.count;
  stage_.launch(follow_paths_, lines, parameters, pass, view_count, inputs.codes, inputs.penalties, inputs.bands.bands,
                inputs.bands.cell_offsets, forward_first_, forward_second_, backward_first_, backward_second_);
}

void BandedSgmPaths::match(const shared::SgmParameters& parameters, const MatchInputs& inputs, StereoMaps& measured,
                           ocl::Buffer<cl_uint>& ranks, Views views) {
  for (int pass = 0; pass < paths_ / 4; ++pass) follow(pass, parameters, inputs, views);
  const int work_items = group_.lanes * group_.lines;
  const int groups_a_row = groups_of(stage_.size().width, group_.lines);
  const ocl::Range pixels{
      cl::NDRange(static_cast<std::size_t>(groups_a_row) * work_items, stage_.size().height, views.count),
      cl::NDRange(work_items, 1, 1)};
  stage_.launch(find_winners_, pixels, parameters, inputs.codes, inputs.bands.bands, inputs.bands.cell_offsets,
                forward_first_, forward_second_, backward_first_, backward_second_, measured.disparity,
                measured.variance, ranks);
}

}  // namespace egosgm
