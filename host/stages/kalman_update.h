// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/evidence.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Fuses prediction and measurement, pixel by pixel: K = p' / (p' + r), d = d' + K (z - d'), p = (1 - K) p'. Where the
/// two differ by more than the gate, or only the measurement is there, the measurement is taken. Where most pixels
/// around are off to one side, as on what moves by itself, their mean innovation moves the prediction first. Without a
/// gate, as in the paper, all that is predicted and measured is averaged, and nothing hides it.
class KalmanUpdate {
 public:
  /// The evidence that a frame has before it is fused.
  struct FrameEvidence {
    const FlagMap& before;        // that moved with the prediction
    const BlockEvidence& blocks;  // of this frame's images
    bool repeats;                 // they are those of the frame before, and make nobody surer
    bool sees_again;              // the camera stands: what has no prediction was turned down a frame before
  };

  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  KalmanUpdate(ocl::Context& context, shared::ImageSize size, const KalmanUpdateOptions& options, int pixels = 0);

  /// Nothing is believed of what is `hidden`. `doubtful`: 1 where the measurement was taken although the prediction
  /// speaks against it. `evidence` is null where the method has none: then all that is updated has
  /// the most of it. REQUIRES: `updated` is neither `predicted` nor `measured`.
  void update(const FlagMap& hidden, const StereoMaps& predicted, const StereoMaps& measured,
              const FrameEvidence* evidence, StereoMaps& updated, FlagMap& doubtful, FlagMap& updated_evidence,
              Views views);

 private:
  ocl::Stage stage_;
  const shared::KalmanParameters parameters_;
  const bool ask_neighbours_;
  const shared::ImageSize blocks_;
  ocl::Buffer<cl_int> sums_, counts_;
  Map drifts_;
  ocl::Kernel<const shared::ImageSize, const float, const Map, const Map, ocl::Buffer<cl_int>, ocl::Buffer<cl_int>>
      sum_;
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<cl_int>, const ocl::Buffer<cl_int>, Map> find_drift_;
  ocl::Kernel<const shared::KalmanParameters, const FlagMap, const Map, const Map, const Map, const Map, const FlagMap,
              const ocl::Buffer<cl_int>, const Map, const Map, Map, Map, FlagMap, FlagMap>
      update_;
  const BlockEvidence none_;
};

}  // namespace egosgm
