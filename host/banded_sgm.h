// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/options.h"
#include "host/maps.h"
#include "host/ocl/kernel.h"
#include "host/search_band.h"

namespace egosgm {

/// Semi-global matching of both views in their bands: disparity and matching variance (see kernels/banded_sgm.cl).
class BandedSgm {
 public:
  BandedSgm(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range, const BandedSgmOptions& options);

  /// `codes`: what Census makes with a padding of `code_padding(range)`. `views`: 1 matches the left view only.
  /// `penalties`: what StepPenalties makes.
  void operator()(const ocl::Buffer<cl_uint>& codes, const ocl::Buffer<cl_uchar>& penalties, const SearchBand& band, StereoMaps& measured,
                  int views = 2);

  static int code_padding(shared::DisparityRange range);

  using Forward = ocl::Kernel<const shared::SgmParameters, const cl_int, const cl_int, const ocl::Buffer<cl_uint>,
                              const ocl::Buffer<shared::Band>, const ocl::Buffer<cl_uint>, const ocl::Buffer<cl_uchar>, ocl::Buffer<cl_uchar>,
                              ocl::Buffer<cl_uchar>>;
  using Backward = ocl::Kernel<const shared::SgmParameters, const cl_int, const cl_int, const ocl::Buffer<cl_uint>,
                               const ocl::Buffer<shared::Band>, const ocl::Buffer<cl_uint>, const ocl::Buffer<cl_uchar>, ocl::Buffer<cl_uchar>, const ocl::Buffer<cl_uchar>,
                               ocl::Buffer<cl_ulong>>;
  using Refine = ocl::Kernel<const shared::SgmParameters, const ocl::Buffer<cl_ulong>, ocl::Buffer<float>, ocl::Buffer<float>>;

 private:
  ocl::Context& context_;
  const shared::ImageSize size_;
  const shared::SgmParameters parameters_;
  ocl::Buffer<cl_uchar> slots_;  // path costs under way, one row of disparities a path and view
  ocl::Buffer<cl_uchar> sums_;   // the forward sweep's sums, 8 bits a cell
  ocl::Buffer<cl_ulong> winners_;
  Forward forward_;
  Backward backward_;
  Refine refine_;
};

}  // namespace egosgm
