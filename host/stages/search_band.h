// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Which disparities are searched, and where their cells lie, of both views.
struct SearchBands {
  ocl::Buffer<shared::Band> bands;       // one a pixel and view
  ocl::Buffer<cl_uint> cell_offsets;     // one a pixel and view: the chunks of the pixels to the left of it in its row
  ocl::Buffer<shared::RowSum> row_sums;  // one a row and view: index view * height + y

  /// Each pixel searches the whole range, until SearchBand says otherwise.
  SearchBands(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range);
};

/// Says for every pixel of both views which disparities are searched, and where their cells lie.
///
/// A predicted pixel searches d +- max(min_half_width_px, sigmas * sqrt(p)), another one the range that the predictions
/// around it span, one with none near everything. Where CoarseMatch found disparities beyond that by more than
/// coarse_tolerance_px, as on an object that moves by itself, the band reaches there too. Bands hold one chunk of
/// EGOSGM_LANES lanes, or an even number of chunks; lanes outside of the disparity range, which there may be at its
/// end, do not exist for BandedSgm.
class SearchBand {
 public:
  /// `row_group`: work-items that share a row when chunks are summed up; 0: one on a CPU, many elsewhere. Same bits.
  SearchBand(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
             const SearchBandOptions& options, int row_group = 0);

  /// Bands from the prediction and, unless null, the disparities that CoarseMatch found.
  void narrow(const StereoMaps& predicted, const Map* coarse, SearchBands& bands, Views views);
  /// Every pixel searches everything.
  void full_range(SearchBands& bands, Views views);
  /// Searches the full range although there are predicted disparities: `row_sums` counts them.
  void full_range(const Map& predicted, SearchBands& bands, Views views);

  /// No pixel has more chunks than this.
  static int max_chunks(shared::DisparityRange range) {
    return range.count <= EGOSGM_LANES ? 1 : (range.count + 2 * EGOSGM_LANES - 1) / (2 * EGOSGM_LANES) * 2;
  }

 private:
  void sum_rows(const Map& predicted, SearchBands& bands, Views views);

  using Disparities = const ocl::Buffer<float>;
  using Ranges = ocl::Buffer<shared::BlockRange>;

  ocl::Stage stage_;
  const shared::ImageSize blocks_;
  const shared::DisparityRange range_;
  const SearchBandOptions options_;
  Ranges block_ranges_, coarse_ranges_, none_, found_;
  ocl::Buffer<shared::Band> block_bands_;
  ocl::Kernel<const shared::ImageSize, const cl_int, Disparities, Ranges> gather_blocks_;
  ocl::Kernel<const shared::ImageSize, Disparities, Ranges> gather_coarse_;
  ocl::Kernel<const shared::ImageSize, const shared::DisparityRange, const cl_int, const float, const cl_int,
              const float, const Ranges, const Ranges, Ranges, ocl::Buffer<shared::Band>>
      bands_of_blocks_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const shared::DisparityRange, const float, const float,
              Disparities, Disparities, const float, const float, const Ranges, const ocl::Buffer<shared::Band>,
              ocl::Buffer<shared::Band>, ocl::Buffer<cl_uint>, ocl::Buffer<shared::RowSum>>
      bands_of_pixels_;
  ocl::Kernel<const shared::ImageSize, const cl_int, Disparities, const ocl::Buffer<shared::Band>, ocl::Buffer<cl_uint>,
              ocl::Buffer<shared::RowSum>>
      sum_rows_;
  ocl::Kernel<const shared::ImageSize, const shared::Band, ocl::Buffer<shared::Band>, ocl::Buffer<cl_uint>,
              ocl::Buffer<shared::RowSum>>
      full_range_;
};

}  // namespace egosgm
