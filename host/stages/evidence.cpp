// SPDX-License-Identifier: Apache-2.0
#include "host/stages/evidence.h"

#include <limits>

#include "host/stages/banded_sgm.h"
#include "host/stages/coarse_match.h"
#include "kernels/method.h"

namespace egosgm {
namespace {

std::size_t places(shared::ImageSize size) {
  return 2 * static_cast<std::size_t>(EGOSGM_EVIDENCE_STRIDE(size.width)) * shared::coarse_size(size).height;
}

}  // namespace

BlockEvidence::BlockEvidence(ocl::Context& context, shared::ImageSize size)
    : evidence(context, places(size)), found(context, places(size)) {}

bool Evidence::is_of(const MethodOptions& options) {
  return options.evidence.enabled && Census::words(options.banded_sgm.cost) == 2;
}

Evidence::Evidence(ocl::Context& context, shared::ImageSize size, const MethodOptions& options, int pixels)
    : stage_(context, "Evidence", "evidence.cl", size, pixels, ocl::Defines().set("CODE_BYTES", 8)),
      coarse_(shared::coarse_size(size)),
      gate_px_(options.kalman_update.gate_px > 0 ? options.kalman_update.gate_px
                                                 : std::numeric_limits<float>::infinity()),
      padding_(BandedSgm::code_padding(range_of(options))),
      coarse_padding_(BandedSgm::code_padding(CoarseMatch::coarse_range(range_of(options)))),
      coarse_census_(context, coarse_, PixelType::kU16, MatchingCost::kCensus9x7, coarse_padding_, pixels),
      coarse_codes_(context, Census::words(MatchingCost::kCensus9x7, coarse_, coarse_padding_)),
      alike_(context, Census::words(MatchingCost::kCensus9x7, coarse_, coarse_padding_)),
      sums_(context, 2 * pixel_count(coarse_)),
      compare_(stage_, "compare"),
      gather_(stage_, "gather_evidence"),
      publish_(stage_, "publish_confirmed") {}

void Evidence::operator()(const ocl::Buffer<cl_uint>& codes, const CoarseView* coarse, const Map& predicted,
                          const Map& measured, BlockEvidence& blocks, Views views) {
  const ocl::Context::Within within(stage_.enter(), "Evidence");
  if (coarse) {
    coarse_census_.encode(coarse->images, coarse_codes_);
    coarse_census_.encode_alike(coarse->images, alike_);
  }
  const ocl::Range each = ocl::every_pixels(stage_.enter(), coarse_, stage_.pixels(), views.count);
  stage_.launch(compare_, each, stage_.size(), gate_px_, padding_, codes, coarse != nullptr, coarse_padding_,
                coarse_codes_, alike_, predicted, measured, sums_);
  stage_.launch(gather_, each, stage_.size(), coarse != nullptr, coarse_padding_,
                coarse ? coarse->disparity : blocks.found, alike_, sums_, blocks.evidence, blocks.found);
}

void Evidence::publish(const Map& disparity, const FlagMap& evidence, Map& confirmed, Views views, Views tracked) {
  stage_.launch_pixels(publish_, views.count, views.row_step, tracked.count == 1, disparity, evidence, confirmed);
}

}  // namespace egosgm
