// SPDX-License-Identifier: Apache-2.0
#include "host/fuse/prediction_check.h"

#include "kernels/method.h"

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context, int row_group) {
  context.enter("PredictionCheck");
  return context.program("prediction_check.cl", ocl::Defines().set("ROW_GROUP", row_group));
}

int checked_rows(shared::ImageSize size) { return (size.height + EGOSGM_CHECKED_ROWS - 1) / EGOSGM_CHECKED_ROWS; }

PredictionCheck::State none(ocl::Context& context) {
  PredictionCheck::State state(context, 1);
  state.write(context, {{}});
  return state;
}

}  // namespace

PredictionCheck::PredictionCheck(ocl::Context& context, shared::ImageSize size, const PredictionCheckOptions& options,
                                 int row_group)
    : context_((context.enter("PredictionCheck"), context)),
      size_(size),
      is_enabled_(options.enabled),
      row_group_(row_group > 0 ? row_group : ocl::row_group(context)),
      nothing_(none(context)),
      row_counts_(context, checked_rows(size)),
      count_predictions_(build(context, row_group_), "count_predictions"),
      judge_(build(context, row_group_), "judge") {}

void PredictionCheck::operator()(const State& before, const Map& warped, const Map& predicted, const Map& measured,
                                 State& after) {
  context_.enter("PredictionCheck");
  const cl_int rows = is_enabled_ ? checked_rows(size_) : 0;
  if (rows > 0) {
    count_predictions_(context_, ocl::group_a_row({size_.width, rows}, row_group_, /*views=*/1), size_.width, warped,
                       predicted, measured, row_counts_);
  }
  judge_(context_, ocl::group_a_row({size_.width, 1}, row_group_, /*views=*/1), rows, row_counts_, before, after);
}

void PredictionCheck::begin(State& after) {
  context_.enter("PredictionCheck");
  const cl_int no_rows = 0;
  judge_(context_, ocl::group_a_row({size_.width, 1}, row_group_, /*views=*/1), no_rows, row_counts_, nothing_, after);
}

}  // namespace egosgm
