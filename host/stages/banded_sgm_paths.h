// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "host/ocl/defines.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"
#include "host/stages/stripes.h"

namespace egosgm {

/// Defines of the programs of both forms of BandedSgm.
ocl::Defines sgm_defines(int max_chunks, int code_words, const BandedSgmOptions& options);

/// The form of BandedSgm for GPUs: a few work-items follow each path across the image (see
/// kernels/sgm/banded_sgm_paths.cl).
class BandedSgmPaths {
 public:
  /// Work-items that share a path, a power of two, and paths that share a work-group.
  struct Group {
    int lanes, lines;
  };

  BandedSgmPaths(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
                 const BandedSgmOptions& options, Group group);

  /// See BandedSgm.
  void match(const shared::SgmParameters& parameters, const MatchInputs& inputs, StereoMaps& measured,
             ocl::Buffer<cl_uint>& ranks, Views views);

  /// On GPUs eight lanes of four disparities, as many as a predicted pixel's band holds, and a group of 64, as far as
  /// the device allows it; elsewhere a work-item.
  static Group default_group(const ocl::Context& context, shared::DisparityRange range);
  /// The size of one of the four buffers of partial sums on the device that needs the most, so that stripes, and with
  /// them bits, depend on no device's vectors.
  static std::size_t most_sum_bytes(shared::ImageSize size, shared::DisparityRange range);

 private:
  using Parameters = const shared::SgmParameters;
  using Codes = const ocl::Buffer<cl_uint>;
  using Penalties = const ocl::Buffer<cl_uchar>;
  using Bands = const ocl::Buffer<shared::Band>;
  using Offsets = const ocl::Buffer<cl_uint>;
  using Sums = ocl::Buffer<cl_uchar>;
  using Maps = ocl::Buffer<float>;

  void follow(int pass, const shared::SgmParameters& parameters, const MatchInputs& inputs, Views views);

  ocl::Stage stage_;
  const int paths_;
  const Group group_;
  Sums forward_first_, forward_second_, backward_first_, backward_second_;  // partial sums of paths
  ocl::Kernel<Parameters, const cl_int, const cl_int, Codes, Penalties, Bands, Offsets, Sums, Sums, Sums, Sums>
      follow_paths_;
  ocl::Kernel<Parameters, Codes, Bands, Offsets, const Sums, const Sums, const Sums, const Sums, Maps, Maps,
              ocl::Buffer<cl_uint>>
      find_winners_;
};

}  // namespace egosgm
