// SPDX-License-Identifier: Apache-2.0
#include "host/search_band.h"

#include <algorithm>

namespace egosgm {
namespace {

shared::ImageSize blocks_of(shared::ImageSize size) {
  return {(size.width + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK, (size.height + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK};
}

shared::Band whole(shared::DisparityRange range) {
  return {static_cast<cl_short>(range.min), static_cast<cl_ushort>(SearchBand::max_chunks(range)),
          static_cast<cl_short>(range.min), static_cast<cl_short>(range.min + range.count - 1)};
}

const cl::Program& build(ocl::Context& context, int row_group) {
  context.enter("SearchBand");
  return context.program("search_band.cl", ocl::Defines().set("ROW_GROUP", row_group));
}

}  // namespace

SearchBand::SearchBand(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
                       const SearchBandOptions& options, int row_group)
    : context_((context.enter("SearchBand"), context)),
      size_(size),
      blocks_(blocks_of(size)),
      range_(range),
      options_(options),
      row_group_(row_group > 0 ? row_group : ocl::row_group(context)),
      block_ranges_(context, 2 * pixel_count(blocks_)),
      coarse_ranges_(context, 2 * pixel_count(blocks_)),
      ridges_(context, 2 * pixel_count(blocks_)),
      ridges_with_coarse_(context, 2 * pixel_count(blocks_)),
      none_(context, 2 * pixel_count(blocks_)),
      found_(context, 2 * pixel_count(blocks_)),
      block_bands_(context, 2 * pixel_count(blocks_)),
      bands_(context, 2 * pixel_count(size)),
      cell_offsets_(context, 2 * pixel_count(size)),
      row_sums_(context, 2 * static_cast<std::size_t>(size.height)),
      gather_blocks_(build(context, row_group_), "gather_blocks"),
      gather_ridges_(build(context, row_group_), "gather_ridges"),
      gather_coarse_(build(context, row_group_), "gather_coarse"),
      bands_of_blocks_(build(context, row_group_), "bands_of_blocks"),
      bands_of_pixels_(build(context, row_group_), "bands_of_pixels"),
      widen_(build(context, row_group_), "widen"),
      sum_rows_(build(context, row_group_), "sum_rows"),
      full_range_(build(context, row_group_), "full_range") {
  for (ocl::Buffer<shared::BlockRange>* ranges : {&block_ranges_, &none_}) {
    ranges->write(context, std::vector(ranges->size(), shared::BlockRange{}));
  }
  clear(context, range, bands_, cell_offsets_);
}

void SearchBand::clear(ocl::Context& context, shared::DisparityRange range, ocl::Buffer<shared::Band>& bands,
                       ocl::Buffer<cl_uint>& cell_offsets) {
  const ocl::Drain drain{context};
  bands.fill(context, whole(range));
  cell_offsets.fill(context, 0);
  context.wait();
}

void SearchBand::operator()(const StereoMaps& predicted, const StereoMaps* warped, const StereoMaps* coarse,
                            const ocl::Buffer<shared::PredictionState>* last, int views) {
  context_.enter("SearchBand");
  searched_views_ = views;
  const ocl::Range blocks = ocl::every_pixel(context_, blocks_, views);
  const bool has_ridges = warped && options_.ridge_step_px > 0;
  if (has_ridges) gather_ridges_(context_, blocks, size_, options_.ridge_step_px, warped->disparity, ridges_);
  const Ranges& ridges = has_ridges ? ridges_ : none_;
  if (coarse) {
    gather_coarse_(context_, blocks, size_, options_.ridge_step_px, coarse->disparity, ridges, coarse_ranges_,
                   ridges_with_coarse_);
  }
  if (options_.from_neighbours) gather_blocks_(context_, blocks, size_, predicted.disparity, block_ranges_);
  bands_of_blocks_(context_, blocks, size_, range_, options_.from_neighbours, options_.neighbour_margin_px,
                   options_.neighbour_min_count, options_.coarse_margin_px, block_ranges_,
                   coarse ? coarse_ranges_ : none_, options_.ridge_step_px > 0 ? EGOSGM_RIDGE_BLOCKS : -1,
                   coarse ? ridges_with_coarse_ : ridges, found_, block_bands_);
  bands_of_pixels_(context_, ocl::every_pixel(context_, {blocks_.width, size_.height}, views), size_, range_,
                   options_.sigmas, options_.min_half_width_px, predicted.disparity, predicted.variance,
                   options_.coarse_tolerance_px, options_.coarse_margin_px, found_, block_bands_, bands_);
  if (last) widen_(context_, ocl::group_a_row(size_, 1, views), size_, whole(range_), *last, bands_);
  sum_rows(predicted);
}

void SearchBand::full_range(int views) {
  context_.enter("SearchBand");
  searched_views_ = views;
  full_range_(context_, ocl::every_pixel(context_, size_, views), size_, whole(range_), bands_, cell_offsets_,
              row_sums_);
}

void SearchBand::full_range(const StereoMaps& predicted, int views) {
  full_range(views);
  sum_rows(predicted);
}

void SearchBand::sum_rows(const StereoMaps& predicted) {
  sum_rows_(context_, ocl::group_a_row(size_, row_group_, searched_views_), size_, predicted.disparity, bands_,
            cell_offsets_, row_sums_);
}

}  // namespace egosgm
