// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/reason.h"
#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Says of each left pixel why it has no value, or a doubtful one (egosgm/reason.h).
class Reasons {
 public:
  using Bytes = ocl::Buffer<cl_uchar>;

  /// Results of the match.
  struct Match {
    const FrameImages& images;          // that were matched
    const ocl::Buffer<cl_uint>& codes;  // of both views (Census)
    const float grey_step;              // Plan's
    const StereoMaps& measured;
    const ocl::Buffer<cl_ushort>* runs;  // of SpeckleRemoval; null: it is off
  };
  /// Results of fusion.
  struct Fused {
    const StereoMaps& belief;
    const Map& output;                          // of its disparities
    const FlagMap& doubtful;                    // what KalmanUpdate says; not read without a prediction
    const FlagMap* evidence;                    // the same; null: the method has none
    const ocl::Buffer<cl_int>& block_evidence;  // of Evidence; not read without evidence
  };
  struct Inputs {
    const Match match;
    const Prediction* prediction;  // null: there is none
    const Fused fused;
  };

  /// A byte for each block of EGOSGM_COARSE x EGOSGM_COARSE pixels: whether its texture repeats.
  static Bytes repeats(ocl::Context& context, shared::ImageSize size);

  /// `repeats`: memory that this type of pixels may share with others. `pixels` of a work-item, 1 or 16; 0: by the
  /// device. Same bits.
  Reasons(ocl::Context& context, shared::ImageSize size, PixelType type, const MethodOptions& options,
          const Bytes& repeats, int pixels = 0);

  /// `row_step`: every so many-th row was predicted, measured and fused. A row between has what is known of the one
  /// above it.
  void explain(const Inputs& inputs, cl_int row_step, Bytes& reasons);

 private:
  using In = const ocl::Buffer<float>;

  ocl::Stage stage_;
  const cl_int disparities_, has_census_, padding_;
  Bytes repeats_;  // of blocks
  ocl::Kernel<const shared::ImageSize, const cl_int, const cl_int, const ocl::Buffer<cl_uint>, In, Bytes> find_repeats_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const float, const Bytes, const cl_int, const Bytes, const cl_int,
              In, const FlagMap, In, const cl_int, const ocl::Buffer<cl_ushort>, In, const FlagMap, const cl_int,
              const FlagMap, const ocl::Buffer<cl_int>, Bytes>
      explain_;
};

}  // namespace egosgm
