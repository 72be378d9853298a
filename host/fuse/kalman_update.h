// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/maps.h"
#include "host/method_options.h"
#include "host/ocl/kernel.h"
#include "host/predict/predict_room.h"

namespace egosgm {

/// Fuses prediction and measurement, pixel by pixel: K = p' / (p' + r), d = d' + K (z - d'), p = (1 - K) p'. Where the
/// two differ by more than the gate, or to the same side as most around (something moves by itself), or only the
/// measurement is there, the measurement is taken. Without a gate, as in the paper, all that is predicted and measured
/// is averaged, and nothing hides it.
///
/// Tells, too, whether a frame's predictions were right, by the left view: they were wrong where less than three quarters
/// as many pixels have one as a frame before, or where the share of those that differ from the measurement is more than
/// twice as large, and 2.5 % of them. SearchBand then lets the next frame search everything: what a wrong prediction
/// left must not hide what is there.
class KalmanUpdate {
 public:
  /// `row_group`: work-items that share a row; `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  KalmanUpdate(ocl::Context& context, shared::ImageSize size, const KalmanUpdateOptions& options, int row_group = 0,
               int pixels = 0);

  /// Nothing is believed of what is hidden. `before`: of the frame before. `doubtful`: 1 where the measurement was taken
  /// although the prediction, or its own path sums, speak against it.
  /// REQUIRES: `updated` is neither `predicted` nor `measured`.
  void operator()(const Prediction& predicted, const Measurement& measured, const Agreement& before,
                  StereoMaps& updated, FlagMap& doubtful, Agreement& after, Views views);
  /// For a frame without predictions: nothing speaks against the next one's.
  void begin(Agreement& after);

 private:
  ocl::Context& context_;
  const shared::ImageSize size_;
  const int row_group_, pixels_;
  const cl_int has_gate_;
  const float gate_px_;
  const cl_int keep_predicted_, ask_neighbours_;
  const float min_variance_px2_;
  const cl_int rows_;  // by which predictions are judged
  ocl::Buffer<shared::PredictionCounts> row_counts_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const float, const cl_int, const cl_int, const float,
              const FlagMap, const Map, const Map, const Map, const Map, const Map, const FlagMap, Map, Map, FlagMap,
              ocl::Buffer<shared::PredictionCounts>>
      update_;
  ocl::Kernel<const cl_int, const ocl::Buffer<shared::PredictionCounts>, const Agreement, Agreement> judge_;
};

}  // namespace egosgm
