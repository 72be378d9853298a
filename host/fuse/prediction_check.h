// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "host/maps.h"
#include "host/ocl/kernel.h"

namespace egosgm {

/// Whether a frame's predictions were right, by the left view: they were wrong where less than three quarters as many
/// pixels have one as a frame before, or where the share of those that differ from the measurement by more than 1 px is
/// more than twice as large, and 2.5 % of them; predictions that only fill gaps do not count for that. KalmanUpdate
/// then does not ask the neighbours and believes the predictions less, in this frame and the next, and SearchBand lets
/// the next one search everything: what a wrong prediction left must not hide what is there.
class PredictionCheck {
 public:
  /// What is known of a frame's predictions: one element.
  using State = ocl::Buffer<shared::PredictionState>;

  /// `row_group`: work-items that share a row; 0: by the device. Same bits.
  PredictionCheck(ocl::Context& context, shared::ImageSize size, const PredictionCheckOptions& options,
                  int row_group = 0);

  /// `before`: of the frame before. The disparities `warped`, before any was dropped, `predicted` and `measured`.
  void operator()(const State& before, const Map& warped, const Map& predicted, const Map& measured, State& after);
  /// For a frame without predictions: nothing speaks against the next one's.
  void begin(State& after);

 private:
  ocl::Context& context_;
  const shared::ImageSize size_;
  const bool is_enabled_;
  const int row_group_;
  const State nothing_;
  ocl::Buffer<shared::PredictionCounts> row_counts_;
  ocl::Kernel<const cl_int, const ocl::Buffer<float>, const ocl::Buffer<float>, const ocl::Buffer<float>,
              ocl::Buffer<shared::PredictionCounts>>
      count_predictions_;
  ocl::Kernel<const cl_int, const ocl::Buffer<shared::PredictionCounts>, const State, State> judge_;
};

}  // namespace egosgm
