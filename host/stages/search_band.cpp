// SPDX-License-Identifier: Apache-2.0
#include "host/stages/search_band.h"

#include <algorithm>

#include "kernels/method.h"

namespace egosgm {
namespace {

shared::ImageSize blocks_of(shared::ImageSize size) {
  return {(size.width + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK, (size.height + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK};
}

shared::Band whole(shared::DisparityRange range) {
  return {static_cast<cl_short>(range.min), static_cast<cl_ushort>(SearchBand::max_chunks(range)),
          static_cast<cl_short>(range.min), static_cast<cl_short>(range.min + range.count - 1)};
}

}  // namespace

SearchBands::SearchBands(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range)
    : bands(context, 2 * pixel_count(size)),
      cell_offsets(context, 2 * pixel_count(size)),
      row_sums(context, 2 * static_cast<std::size_t>(size.height)) {
  const shared::Band band = whole(range);
  bands.write(context, std::vector(bands.size(), band));
  std::vector<cl_uint> offsets(cell_offsets.size());
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    offsets[i] = static_cast<cl_uint>(i % static_cast<std::size_t>(size.width)) * band.chunks;
  }
  cell_offsets.write(context, offsets);
  const cl_uint cells_of_row = static_cast<cl_uint>(size.width) * band.chunks * EGOSGM_LANES;
  row_sums.write(context, std::vector(row_sums.size(), shared::RowSum{cells_of_row, 0}));
}

SearchBand::SearchBand(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
                       const SearchBandOptions& options, int row_group)
    : stage_(ocl::Stage::of_row_groups(context, "SearchBand", "search_band.cl", size, row_group)),
      blocks_(blocks_of(size)),
      range_(range),
      options_(options),
      block_ranges_(context, 2 * pixel_count(blocks_)),
      coarse_ranges_(context, 2 * pixel_count(blocks_)),
      none_(context, 2 * pixel_count(blocks_)),
      found_(context, 2 * pixel_count(blocks_)),
      block_bands_(context, 2 * pixel_count(blocks_)),
      gather_blocks_(stage_, "gather_blocks"),
      gather_coarse_(stage_, "gather_coarse"),
      bands_of_blocks_(stage_, "bands_of_blocks"),
      bands_of_pixels_(stage_, "bands_of_pixels"),
      sum_rows_(stage_, "sum_rows"),
      full_range_(stage_, "full_range") {
  // Where the kernel that writes them fails, those that read them must stay in bounds.
  for (ocl::Buffer<shared::BlockRange>* ranges : {&block_ranges_, &coarse_ranges_, &none_, &found_}) {
    ranges->write(context, std::vector(ranges->size(), shared::BlockRange{}));
  }
  block_bands_.write(context, std::vector(block_bands_.size(), whole(range)));
}

void SearchBand::narrow(const StereoMaps& predicted, const Map* coarse, SearchBands& bands, Views views) {
  ocl::Context& context = stage_.enter();
  const shared::ImageSize size = stage_.size();
  const ocl::Range blocks = ocl::every_pixels(context, blocks_, stage_.pixels(), views.count);
  if (coarse)
    stage_.launch(gather_coarse_, ocl::every_pixel(context, blocks_, views.count), size, *coarse, coarse_ranges_);
  if (options_.from_neighbours)
    stage_.launch(gather_blocks_, blocks, size, views.row_step, predicted.disparity, block_ranges_);
  stage_.launch(bands_of_blocks_, blocks, size, range_, options_.from_neighbours, options_.neighbour_margin_px,
                options_.neighbour_min_count, options_.coarse_margin_px, block_ranges_, coarse ? coarse_ranges_ : none_,
                found_, block_bands_);
  stage_.launch_pixels(bands_of_pixels_, views.count, views.row_step, range_, options_.sigmas,
                       options_.min_half_width_px, predicted.disparity, predicted.variance,
                       options_.coarse_tolerance_px, options_.coarse_margin_px, found_, block_bands_, bands.bands,
                       bands.cell_offsets, bands.row_sums);
  if (stage_.pixels() == 1) sum_rows(predicted.disparity, bands, views);
}

void SearchBand::full_range(SearchBands& bands, Views views) {
  stage_.launch(full_range_, ocl::every_pixel(stage_.enter(), stage_.size(), views.count), stage_.size(), whole(range_),
                bands.bands, bands.cell_offsets, bands.row_sums);
}

void SearchBand::full_range(const Map& predicted, SearchBands& bands, Views views) {
  full_range(bands, views);
  sum_rows(predicted, bands, views);
}

void SearchBand::sum_rows(const Map& predicted, SearchBands& bands, Views views) {
  stage_.launch_rows(sum_rows_, views.count, views.row_step, predicted, bands.bands, bands.cell_offsets,
                     bands.row_sums);
}

}  // namespace egosgm
