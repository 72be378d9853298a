// SPDX-License-Identifier: Apache-2.0
// The table of contents: a frame, a line a step.
#include "host/method/method.h"

namespace egosgm {

FrameResults Method::frame(const Plan& plan, const FrameImages& uploaded, const Belief& before, Belief& after,
                           const OutputMaps& output) {
  Workspace& w = work_;
  StereoMaps measured = plan.fuses ? w.measured : after.maps;
  VerticalOffset offset = before.offset.is_known ? before.offset : unknown_;
  FrameImages images = uploaded;

  in(Step::kPredict, [&] { predict(plan, before, w.prediction); });
  for (int match = 1; match <= plan.matches; ++match) {
    if (match > 1) offset = w.first_offset;
    VerticalOffset& refined = match < plan.matches ? w.first_offset : after.offset;
    in(Step::kAlign, [&] { images = align(uploaded, offset, w.aligned); });
    in(Step::kSearch, [&] { search_.plan_bands(plan, images, w.prediction, w.coarse, w.bands); });
    in(Step::kMatch, [&] { match_.measure(plan, images, w.bands, w.matching, measured); });
    in(Step::kRefineAlignment, [&] { refine(images, measured, offset, refined); });
  }
  in(Step::kFuse, [&] { fuse(plan, images, w.prediction, measured, w.fusion, after); });
  StereoMaps result{after.maps.disparity, output.variance};
  in(Step::kPublish, [&] {
    result.disparity = confirmed(plan, images, after, output.disparity);
    publish_.complete(plan, w.prediction, after.maps, measured, result);
    const Prediction* prediction = plan.predicts() ? &w.prediction : nullptr;
    publish_.write(plan,
                   {{images, match_.matcher().codes(), plan.grey_step, measured, match_.speckle_runs(plan)},
                    prediction,
                    {after.maps, result.disparity, w.fusion.doubtful, evidence_of(after), w.fusion.evidence.evidence}},
                   before, after, w.published);
  });
  return {result, measured, offset, images};
}

void Method::predict(const Plan& plan, const Belief& belief, Prediction& prediction) {
  if (plan.predicts()) {
    predict_->predict(plan, belief, prediction);
  } else if (plan.fuses) {
    prediction.fill_with_nothing(context_);
  }
}

FrameImages Method::align(const FrameImages& uploaded, const VerticalOffset& offset, FrameImages& aligned) {
  if (!offset.is_known) return uploaded;
  alignment_[uploaded.type].resample(uploaded, offset, aligned);
  return aligned;
}

void Method::refine(const FrameImages& images, const StereoMaps& measured, const VerticalOffset& offset,
                    VerticalOffset& refined) {
  if (options_.vertical_alignment.enabled) {
    alignment_[images.type].estimate(images, measured.disparity, offset, refined);
  }
}

void Method::fuse(const Plan& plan, const FrameImages& images, const Prediction& prediction, const StereoMaps& measured,
                  Fusion& fusion, Belief& belief) {
  if (plan.fuses) {
    std::optional<CoarseView> coarse;
    if (plan.has_coarse_match) coarse.emplace(CoarseView{search_.coarse_images(), work_.coarse});
    fuse_->update(plan, {images, match_.matcher().codes(), coarse ? &*coarse : nullptr}, prediction, measured, fusion,
                  belief);
  }
  belief.why_not.reset();
  if (!options_.temporal) belief.forget(Unpredicted::kNotTemporal);  // a frame alone leaves nothing to the next one
}

/// Null where all of a belief is published: the method has no evidence.
const FlagMap* Method::evidence_of(const Belief& belief) const {
  return fuse_ && fuse_->has_evidence() ? &belief.evidence : nullptr;
}

Map Method::confirmed(const Plan& plan, const FrameImages& images, const Belief& belief, Map& confirmed) {
  if (!evidence_of(belief)) return belief.maps.disparity;
  fuse_->publish(plan, images, belief, confirmed);
  return confirmed;
}

Workspace::Workspace(ocl::Context& context, shared::ImageSize size, const MethodOptions& options)
    : prediction(context, size),
      aligned{ocl::Buffer<cl_uchar>(context, options.vertical_alignment.enabled ? 2 * 2 * pixel_count(size) : 0)},
      first_offset(context),
      coarse(context, 2 * pixel_count(shared::coarse_size(size))),
      bands(context, size, range_of(options)),
      matching(context, size),
      measured(context, size),
      fusion(context, size),
      published(context, size) {}

Method::Method(ocl::Context& context, shared::ImageSize size, const Calibration& calibration,
               const MethodOptions& options, const Tuning& tuning)
    : context_(context),
      options_(options),
      work_(context, size, options),
      unknown_(context),
      alignment_([=, &context, sums = VerticalAlignment::Sums(context, size),
                  alignment = options.vertical_alignment](PixelType type) {
        return VerticalAlignment(context, size, type, alignment, sums, tuning.row_group);
      }),
      match_(context, size, options, tuning),
      search_(context, size, options, tuning),
      publish_(context, size, calibration, options) {
  if (options.temporal) predict_.emplace(context, size, calibration, options, tuning);
  if (may_fuse(options)) fuse_.emplace(context, size, options);
}

void Method::prepare(PixelType type, const Wanted& wanted) {
  if (options_.vertical_alignment.enabled) alignment_.prepare(type);
  search_.prepare(type);
  match_.prepare(type);
  if (fuse_) fuse_->prepare(type);
  publish_.prepare(type, wanted);
}

}  // namespace egosgm
