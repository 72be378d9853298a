// SPDX-License-Identifier: Apache-2.0
#include "host/search/search_band.h"

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

ocl::Program& build(ocl::Context& context, int row_group) {
  context.enter("SearchBand");
  return context.program("search_band.cl",
                         ocl::Defines().set("ROW_GROUP", row_group).set("PIXELS", row_group == 1 ? 16 : 1));
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
    : context_((context.enter("SearchBand"), context)),
      size_(size),
      blocks_(blocks_of(size)),
      range_(range),
      options_(options),
      row_group_(row_group > 0 ? row_group : ocl::row_group(context)),
      block_ranges_(context, 2 * pixel_count(blocks_)),
      coarse_ranges_(context, 2 * pixel_count(blocks_)),
      none_(context, 2 * pixel_count(blocks_)),
      found_(context, 2 * pixel_count(blocks_)),
      block_bands_(context, 2 * pixel_count(blocks_)),
      gather_blocks_(build(context, row_group_), "gather_blocks"),
      gather_coarse_(build(context, row_group_), "gather_coarse"),
      bands_of_blocks_(build(context, row_group_), "bands_of_blocks"),
      bands_of_pixels_(build(context, row_group_), "bands_of_pixels"),
      sum_rows_(build(context, row_group_), "sum_rows"),
      full_range_(build(context, row_group_), "full_range") {
  for (ocl::Buffer<shared::BlockRange>* ranges : {&block_ranges_, &none_}) {
    ranges->write(context, std::vector(ranges->size(), shared::BlockRange{}));
  }
}

void SearchBand::narrow(const StereoMaps& predicted, const Map* coarse, SearchBands& bands, Views views) {
  context_.enter("SearchBand");
  const int pixels = row_group_ == 1 ? 2 * EGOSGM_BLOCK : 1;
  const ocl::Range blocks = ocl::every_pixels(context_, blocks_, pixels, count(views));
  if (coarse)
    gather_coarse_(context_, ocl::every_pixel(context_, blocks_, count(views)), size_, *coarse, coarse_ranges_);
  if (options_.from_neighbours) gather_blocks_(context_, blocks, size_, predicted.disparity, block_ranges_);
  bands_of_blocks_(context_, blocks, size_, range_, options_.from_neighbours, options_.neighbour_margin_px,
                   options_.neighbour_min_count, options_.coarse_margin_px, block_ranges_,
                   coarse ? coarse_ranges_ : none_, found_, block_bands_);
  bands_of_pixels_(context_, ocl::every_pixels(context_, size_, pixels, count(views)), size_, range_, options_.sigmas,
                   options_.min_half_width_px, predicted.disparity, predicted.variance, options_.coarse_tolerance_px,
                   options_.coarse_margin_px, found_, block_bands_, bands.bands, bands.cell_offsets, bands.row_sums);
  if (pixels == 1) sum_rows(predicted.disparity, bands, views);
}

void SearchBand::full_range(SearchBands& bands, Views views) {
  context_.enter("SearchBand");
  full_range_(context_, ocl::every_pixel(context_, size_, count(views)), size_, whole(range_), bands.bands,
              bands.cell_offsets, bands.row_sums);
}

void SearchBand::full_range(const Map& predicted, SearchBands& bands, Views views) {
  full_range(bands, views);
  sum_rows(predicted, bands, views);
}

void SearchBand::sum_rows(const Map& predicted, SearchBands& bands, Views views) {
  sum_rows_(context_, ocl::group_a_row(size_, row_group_, count(views)), size_, predicted, bands.bands,
            bands.cell_offsets, bands.row_sums);
}

}  // namespace egosgm
