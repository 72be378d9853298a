// SPDX-License-Identifier: Apache-2.0
#include "host/stages/reasons.h"

#include "host/stages/banded_sgm.h"
#include "host/stages/census.h"
#include "kernels/method.h"

namespace egosgm {
namespace {

static_assert(static_cast<int>(Reason::kTrusted) == EGOSGM_REASON_TRUSTED &&
              static_cast<int>(Reason::kUnconfirmed) == EGOSGM_REASON_UNCONFIRMED &&
              static_cast<int>(Reason::kUncovered) == EGOSGM_REASON_UNCOVERED &&
              static_cast<int>(Reason::kContradicted) == EGOSGM_REASON_CONTRADICTED &&
              static_cast<int>(Reason::kNearer) == EGOSGM_REASON_NEARER &&
              static_cast<int>(Reason::kAmbiguous) == EGOSGM_REASON_AMBIGUOUS &&
              static_cast<int>(Reason::kFlat) == EGOSGM_REASON_FLAT &&
              static_cast<int>(Reason::kSaturated) == EGOSGM_REASON_SATURATED &&
              static_cast<int>(Reason::kSpeckle) == EGOSGM_REASON_SPECKLE &&
              static_cast<int>(Reason::kPredicted) == EGOSGM_REASON_PREDICTED &&
              static_cast<int>(Reason::kPredicted) + 1 == kReasonCount);

}  // namespace

const char* to_string(Reason reason) {
  switch (reason) {
    case Reason::kTrusted:
      return "trusted";
    case Reason::kUnconfirmed:
      return "unconfirmed";
    case Reason::kUncovered:
      return "uncovered";
    case Reason::kContradicted:
      return "contradicted";
    case Reason::kNearer:
      return "nearer";
    case Reason::kAmbiguous:
      return "ambiguous";
    case Reason::kFlat:
      return "flat";
    case Reason::kSaturated:
      return "saturated";
    case Reason::kSpeckle:
      return "speckle";
    case Reason::kPredicted:
      return "predicted";
  }
  return "";
}

Reasons::Bytes Reasons::repeats(ocl::Context& context, shared::ImageSize size) {
  return Bytes(context, pixel_count(shared::coarse_size(size)));
}

Reasons::Reasons(ocl::Context& context, shared::ImageSize size, PixelType type, const MethodOptions& options,
                 const Bytes& repeats, int pixels)
    : stage_(context, "Reasons", "reasons.cl", size, pixels,
             pixel_define(type).set("CODE_BYTES", 4 * Census::words(options.banded_sgm.cost))),
      disparities_(options.disparities),
      has_census_(options.banded_sgm.cost != MatchingCost::kSad3x3),
      padding_(BandedSgm::code_padding(range_of(options))),
      repeats_(repeats),
      find_repeats_(stage_, "find_repeats"),
      explain_(stage_, "explain") {}

void Reasons::explain(const Inputs& inputs, cl_int row_step, Bytes& reasons) {
  const auto& [match, prediction, fused] = inputs;
  const cl_int has_prediction = prediction ? 1 : 0, has_runs = match.runs ? 1 : 0;
  const Bytes& bytes = match.images.pixels;  // in place of what there is not
  const ocl::Buffer<cl_ushort> no_runs(bytes.get(), 1);
  if (has_census_) {
    const ocl::Range each_block =
        ocl::every_pixels(stage_.enter(), shared::coarse_size(stage_.size()), stage_.pixels(), /*views=*/1);
    stage_.launch(find_repeats_, each_block, stage_.size(), disparities_, padding_, match.codes,
                  match.measured.disparity, repeats_);
  }
  stage_.launch_pixels(explain_, /*views=*/1, row_step, EGOSGM_LEAST_CHANGE * match.grey_step, bytes, has_census_,
                       repeats_, has_prediction, prediction ? prediction->warped.disparity : match.measured.disparity,
                       prediction ? prediction->hidden : bytes, match.measured.disparity, has_runs,
                       match.runs ? *match.runs : no_runs, fused.output, fused.doubtful, fused.evidence != nullptr,
                       fused.evidence ? *fused.evidence : fused.doubtful, fused.block_evidence, reasons);
}

}  // namespace egosgm
