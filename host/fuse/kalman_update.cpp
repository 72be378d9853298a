// SPDX-License-Identifier: Apache-2.0
#include "host/fuse/kalman_update.h"

#include "kernels/method.h"

namespace egosgm {
namespace {

const cl::Program& build(ocl::Context& context, int pixels, int row_group) {
  context.enter("KalmanUpdate");
  return context.program("kalman_update.cl", ocl::Defines().set("PIXELS", pixels).set("ROW_GROUP", row_group));
}

int checked_rows(shared::ImageSize size) { return (size.height + EGOSGM_CHECKED_ROWS - 1) / EGOSGM_CHECKED_ROWS; }

}  // namespace

KalmanUpdate::KalmanUpdate(ocl::Context& context, shared::ImageSize size, const KalmanUpdateOptions& options,
                           int row_group, int pixels)
    : context_((context.enter("KalmanUpdate"), context)),
      size_(size),
      row_group_(row_group > 0 ? row_group : ocl::row_group(context)),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      has_gate_(options.gate_px > 0),
      gate_px_(options.gate_px),
      keep_predicted_(options.keep_predicted),
      ask_neighbours_(options.ask_neighbours),
      min_variance_px2_(options.min_variance_px2),
      rows_(options.check_predictions ? checked_rows(size) : 0),
      row_counts_(context, checked_rows(size)),
      update_(build(context, pixels_, row_group_), "update"),
      judge_(build(context, pixels_, row_group_), "judge") {}

void KalmanUpdate::operator()(const Prediction& predicted, const Measurement& measured, const Agreement& before,
                              StereoMaps& updated, FlagMap& doubtful, Agreement& after, Views views) {
  context_.enter("KalmanUpdate");
  update_(context_, ocl::group_a_row(size_, row_group_, count(views)), size_, has_gate_, gate_px_, keep_predicted_,
          ask_neighbours_, min_variance_px2_, predicted.hidden, predicted.warped.disparity, predicted.maps.disparity,
          predicted.maps.variance, measured.disparity, measured.variance, measured.doubtful, updated.disparity,
          updated.variance, doubtful, row_counts_);
  judge_(context_, ocl::group_a_row({size_.width, 1}, row_group_, /*views=*/1), rows_, row_counts_, before, after);
}

void KalmanUpdate::begin(Agreement& after) {
  context_.enter("KalmanUpdate");
  after.fill(context_, {});
}

}  // namespace egosgm
