// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "host/method/belief.h"
#include "host/method/fuse_step.h"
#include "host/method/match_step.h"
#include "host/method/predict_step.h"
#include "host/method/publish_step.h"
#include "host/method/search_step.h"

namespace egosgm {

/// The steps of a frame, in its order.
enum class Step { kPredict, kAlign, kSearch, kMatch, kRefineAlignment, kFuse, kPublish };

/// Intermediate maps of a frame. The next frame overwrites them.
struct Workspace {
  Prediction prediction;
  FrameImages aligned;
  VerticalOffset first_offset;  // found by the first of two matches
  Map coarse;                   // disparities that CoarseMatch found
  SearchBands bands;
  Matching matching;
  StereoMaps measured;  // where it is fused; else the belief's memory
  Fusion fusion;
  Published published;

  Workspace(ocl::Context& context, shared::ImageSize size, const MethodOptions& options);
};

/// Results of a frame on the device. These are handles: a later frame overwrites their memory.
struct FrameResults {
  StereoMaps output;
  StereoMaps measured;
  VerticalOffset offset;  // by which the right image was resampled for the last match
  FrameImages images;     // that were matched
};

/// The method: from a pair of images and the belief of the frame before to the belief of this one.
class Method {
 public:
  Method(ocl::Context& context, shared::ImageSize size, const Calibration& calibration, const MethodOptions& options,
         const Tuning& tuning);

  /// Builds what images of `type` need, and what is wanted of them. Enqueues nothing.
  void prepare(PixelType type, const Wanted& wanted = {});

  /// Enqueues a frame. Writes `after` and `output`, which share no memory with `before`.
  /// REQUIRES: the images' type was prepared, with what the plan wants.
  FrameResults frame(const Plan& plan, const FrameImages& uploaded, const Belief& before, Belief& after,
                     const OutputMaps& output);

  /// Called after each step of each frame; null: nobody looks on.
  std::function<void(Step)> observer;

  const Workspace& workspace() const { return work_; }
  const Matcher& matcher() const { return match_.matcher(); }
  const SearchStep& search() const { return search_; }

 private:
  template <typename F>
  void in(Step step, F&& enqueue) {
    enqueue();
    if (observer) observer(step);
  }
  void predict(const Plan& plan, const Belief& belief, Prediction& prediction);
  FrameImages align(const FrameImages& uploaded, const VerticalOffset& offset, FrameImages& aligned);
  void refine(const FrameImages& images, const StereoMaps& measured, const VerticalOffset& offset,
              VerticalOffset& refined);
  void fuse(const Plan& plan, const FrameImages& images, const Prediction& prediction, const StereoMaps& measured,
            Fusion& fusion, Belief& belief);
  Map confirmed(const Plan& plan, const FrameImages& images, const Belief& belief, Map& confirmed);
  const FlagMap* evidence_of(const Belief& belief) const;

  ocl::Context& context_;
  const MethodOptions options_;
  Workspace work_;
  const VerticalOffset unknown_;
  std::optional<PredictStep> predict_;
  OfEachType<VerticalAlignment> alignment_;
  MatchStep match_;  // before SearchStep: what it allocates is large enough for the coarse match, too
  SearchStep search_;
  std::optional<FuseStep> fuse_;
  PublishStep publish_;
};

}  // namespace egosgm
