// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/options.h"
#include "host/maps.h"
#include "host/ocl/kernel.h"

namespace egosgm {

/// Says for every pixel of both views which disparities are searched, and where their cells lie.
///
/// A predicted pixel searches d +- max(min_half_width_px, sigmas * sqrt(p)), another one the range that the predictions
/// around it span, one with none near everything. Where CoarseMatch found disparities beyond that by more than
/// coarse_tolerance_px, as on an object that moves by itself, the band reaches there too; and to ridges above and
/// below, things of a few pixels' width, which CoarseMatch hardly sees. Bands hold one chunk of EGOSGM_LANES lanes, or
/// an even number of chunks; lanes outside of the disparity range, which there may be at its end, do not exist for
/// BandedSgm.
class SearchBand {
 public:
  /// `row_group`: work-items that share a row when chunks are summed up; 0: one on a CPU, many elsewhere. Same bits.
  SearchBand(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
             const SearchBandOptions& options, int row_group = 0);

  /// Bands from the prediction, from ridges of it before anything was dropped (`warped`), and from what CoarseMatch
  /// found, where there are these; the whole range where `last`, what PredictionCheck said of the frame before, says
  /// that its predictions were wrong. `views`: 1 searches the left view only, here and below.
  void operator()(const StereoMaps& predicted, const StereoMaps* warped = nullptr, const StereoMaps* coarse = nullptr,
                  const ocl::Buffer<shared::PredictionState>* last = nullptr, int views = 2);
  /// Every pixel searches everything.
  void full_range(int views = 2);
  /// The same where there is a prediction that is not searched by: `row_sums` counts its pixels.
  void full_range(const StereoMaps& predicted, int views = 2);

  /// One a pixel and view.
  const ocl::Buffer<shared::Band>& bands() const { return bands_; }
  /// One a pixel and view: the chunks of the pixels to the left of it in its row.
  const ocl::Buffer<cl_uint>& cell_offsets() const { return cell_offsets_; }
  /// One a row and view: index view * height + y. Those of `searched_views()` count.
  const ocl::Buffer<shared::RowSum>& row_sums() const { return row_sums_; }
  /// By the last call: 1 or 2.
  int searched_views() const { return searched_views_; }

  /// No pixel has more chunks than this.
  static int max_chunks(shared::DisparityRange range) {
    return range.count <= EGOSGM_LANES ? 1 : (range.count + 2 * EGOSGM_LANES - 1) / (2 * EGOSGM_LANES) * 2;
  }
  /// What a device that goes on after a kernel that failed must find: bands that fit the range, and offsets below a
  /// row's end. Waits.
  static void clear(ocl::Context& context, shared::DisparityRange range, ocl::Buffer<shared::Band>& bands,
                    ocl::Buffer<cl_uint>& cell_offsets);

 private:
  void sum_rows(const StereoMaps& predicted);

  using Disparities = const ocl::Buffer<float>;
  using Ranges = ocl::Buffer<shared::BlockRange>;

  ocl::Context& context_;
  const shared::ImageSize size_, blocks_;
  const shared::DisparityRange range_;
  const SearchBandOptions options_;
  const int row_group_;
  int searched_views_ = 2;
  Ranges block_ranges_, coarse_ranges_, ridges_, ridges_with_coarse_, none_, found_;
  ocl::Buffer<shared::Band> block_bands_;
  ocl::Buffer<shared::Band> bands_;
  ocl::Buffer<cl_uint> cell_offsets_;
  ocl::Buffer<shared::RowSum> row_sums_;
  ocl::Kernel<const shared::ImageSize, Disparities, Ranges> gather_blocks_;
  ocl::Kernel<const shared::ImageSize, const float, Disparities, Ranges> gather_ridges_;
  ocl::Kernel<const shared::ImageSize, const float, Disparities, const Ranges, Ranges, Ranges> gather_coarse_;
  ocl::Kernel<const shared::ImageSize, const shared::DisparityRange, const cl_int, const float, const cl_int,
              const float, const Ranges, const Ranges, const cl_int, const Ranges, Ranges, ocl::Buffer<shared::Band>>
      bands_of_blocks_;
  ocl::Kernel<const shared::ImageSize, const shared::DisparityRange, const float, const float, Disparities, Disparities,
              const float, const float, const Ranges, const ocl::Buffer<shared::Band>, ocl::Buffer<shared::Band>>
      bands_of_pixels_;
  ocl::Kernel<const shared::ImageSize, const shared::Band, const ocl::Buffer<shared::PredictionState>,
              ocl::Buffer<shared::Band>>
      widen_;
  ocl::Kernel<const shared::ImageSize, Disparities, const ocl::Buffer<shared::Band>, ocl::Buffer<cl_uint>,
              ocl::Buffer<shared::RowSum>>
      sum_rows_;
  ocl::Kernel<const shared::ImageSize, const shared::Band, ocl::Buffer<shared::Band>, ocl::Buffer<cl_uint>,
              ocl::Buffer<shared::RowSum>>
      full_range_;
};

}  // namespace egosgm
