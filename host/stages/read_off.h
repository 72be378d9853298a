// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// The right view's disparities, whole ones, by the ranks that BandedSgm leaves there while it matches the left view
/// (see kernels/sgm/sgm_cells.h).
class ReadOff {
 public:
  /// `code_padding`: of the rows of ranks.
  ReadOff(ocl::Context& context, shared::ImageSize size, int code_padding);

  static std::size_t bytes(shared::ImageSize size, int code_padding);

  /// For no left pixel to have been there.
  void clear() { ranks_.fill(stage_.enter(), ~cl_uint{0}); }
  ocl::Buffer<cl_uint>& ranks() { return ranks_; }

  /// Writes the right half of both maps.
  void read_off(const shared::SgmParameters& parameters, StereoMaps& measured);

 private:
  ocl::Stage stage_;
  ocl::Buffer<cl_uint> ranks_;
  ocl::Kernel<const shared::SgmParameters, const ocl::Buffer<cl_uint>, Map, Map> read_off_;
};

}  // namespace egosgm
