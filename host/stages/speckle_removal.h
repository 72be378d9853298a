// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"
#include "host/tuning_defaults.h"

namespace egosgm {

/// Drops small regions: 4-connected valid pixels whose disparities differ by at most `max_difference_px` from one to
/// the next, in all at most `max_size_px` of them.
///
/// Regions are found by union-find over runs of connected pixels in a row; the root of a region is its first run.
class SpeckleRemoval {
 public:
  using Runs = ocl::Buffer<cl_ushort>;

  /// `strip_rows`: rows that one work-item joins on its own before strips are joined by atomics; 0: by the device (many
  /// on a CPU, one elsewhere). `row_group`: work-items that share a row in search of its runs; 0: by the device. Same
  /// bits.
  SpeckleRemoval(ocl::Context& context, shared::ImageSize size, const SpeckleRemovalOptions& options,
                 int strip_rows = 0, int row_group = 0);

  /// In place. With `max_size_px` 0 nothing is launched. `views`: 1 looks at the left view only.
  void remove(Map& disparity, Views views);

  /// Runs of the last maps, before anything was dropped: the column where each pixel's run begins, 65535 without one.
  const Runs& runs() const { return runs_; }

 private:
  using Disparities = const Map;
  using Indices = ocl::Buffer<cl_uint>;

  ocl::Stage stage_;
  const SpeckleRemovalOptions options_;
  const cl_uint max_size_;
  const int strip_rows_;
  Runs runs_;                        // column where the pixel's run begins
  Indices parents_, roots_, sizes_;  // of runs, at the index of their first pixel
  ocl::Kernel<const shared::ImageSize, const float, Disparities, Runs, Indices, Indices> find_runs_;
  ocl::Kernel<const shared::ImageSize, const float, const cl_int, Disparities, const Runs, Indices> join_strips_;
  ocl::Kernel<const shared::ImageSize, const float, const cl_int, Disparities, const Runs, Indices> join_seams_;
  ocl::Kernel<const shared::ImageSize, const Runs, const Indices, Indices, Indices> measure_;
  ocl::Kernel<const shared::ImageSize, const cl_uint, const Runs, const Indices, const Indices, Map> drop_;
};

}  // namespace egosgm
