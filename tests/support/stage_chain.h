// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "host/banded_sgm.h"
#include "host/census.h"
#include "host/coarse_match.h"
#include "host/consistency_check.h"
#include "host/dynamic_map.h"
#include "host/edge_rejection.h"
#include "host/forward_warp.h"
#include "host/frame_transfer.h"
#include "host/hole_fill.h"
#include "host/kalman_update.h"
#include "host/median_filter.h"
#include "host/output_variance.h"
#include "host/prediction_check.h"
#include "host/right_map.h"
#include "host/sad_check.h"
#include "host/search_band.h"
#include "host/speckle_removal.h"
#include "host/step_penalties.h"
#include "host/vertical_alignment.h"
#include "tests/reference/pipeline.h"
#include "tests/support/device.h"
#include "tests/support/device_maps.h"

namespace egosgm::testing {

inline shared::DisparityRange range_of(const PipelineOptions& options) {
  return {options.min_disparity, options.disparities};
}

/// The device's stages, wired as in host/pipeline.cpp, and read back after every one of them.
class StageChain {
 public:
  StageChain(const Calibration& calibration, shared::ImageSize size, const PipelineOptions& options, PixelType type)
      : options_(options),
        size_(size),
        type_(type),
        forward_warp_(context_, size, calibration, options.forward_warp, range_of(options)),
        edge_rejection_(context_, size, options.edge_rejection),
        hole_fill_(context_, size, options.hole_fill),
        consistency_(context_, size),
        vertical_alignment_(context_, size, options.vertical_alignment),
        coarse_match_(context_, size, options),
        search_band_(context_, size, range_of(options), options.search_band),
        census_(context_, size, type, options.banded_sgm.cost, code_padding()),
        step_penalties_(context_, size, type, options.banded_sgm),
        banded_sgm_(context_, size, range_of(options), options.banded_sgm),
        median_filter_(context_, size, options.median_filter),
        speckle_removal_(context_, size, options.speckle_removal),
        kalman_update_(context_, size, options.kalman_update),
        prediction_check_(context_, size, options.prediction_check),
        right_map_(context_, size, range_of(options)),
        output_variance_(context_, size, options.output_variance),
        dynamic_map_(context_, size, options.dynamic_map),
        sad_check_(context_, size, type, options.sad_check),
        transfer_(context_, size, range_of(options)),
        codes_(context_, Census::words(options.banded_sgm.cost, size, code_padding())),
        penalties_(context_, StepPenalties::count(size)) {}

  reference::Frame process(const ImageView& left, const ImageView& right, const std::optional<Motion>& motion) {
    reference::Frame frame;
    const FrameImages& uploaded = transfer_.upload(left, right);
    const bool has_prediction = options_.temporal && has_belief_ && motion;
    if (has_prediction) predict(*motion, frame);
    frame.passes.push_back(match(vertical_alignment_.align(uploaded), has_prediction));
    if (options_.vertical_alignment.enabled && frames_ == 0) {
      frame.passes.push_back(match(vertical_alignment_.realign(uploaded), has_prediction));
    }
    vertical_alignment_.commit();
    prediction_check_(has_prediction ? &prediction_states_[frames_ % 2] : nullptr, updated_, predicted_, measured_,
                      prediction_states_[(frames_ + 1) % 2]);
    ++frames_;
    if (has_prediction) update(frame);
    StereoMaps& result = has_prediction ? updated_ : measured_;
    frame.result = download(context_, result);
    frame.dynamic = dynamic_map_(has_prediction ? &predicted_ : nullptr, measured_, scratch_).read(context_);
    output_variance_(result, measured_, 2, scratch_, transfer_.output_variance());
    frame.output_variance =
        options_.output_variance.enabled ? transfer_.output_variance().read(context_) : frame.result.variance;
    std::swap(belief_, result);
    has_belief_ = true;
    return frame;
  }

 private:
  int tracked_views() const { return options_.track_right ? 2 : 1; }
  int code_padding() const { return BandedSgm::code_padding(range_of(options_)); }

  void predict(const Motion& motion, reference::Frame& frame) {
    forward_warp_(belief_, motion, updated_, tracked_views());
    if (!options_.track_right) right_map_(options_.consistency.prediction_px, updated_);
    frame.warped = download(context_, updated_);
    edge_rejection_(updated_, predicted_);
    frame.without_edges = download(context_, predicted_);
    hole_fill_(predicted_, scratch_);
    frame.filled = download(context_, scratch_);
    consistency_(scratch_, options_.consistency.prediction_px, OutsideView::kKeep, predicted_);
    frame.predicted = download(context_, predicted_);
  }

  reference::Pass match(const FrameImages& images, bool has_prediction) {
    images_ = &images;
    const bool reads_off = has_prediction && !options_.track_right;
    const int views = reads_off ? 1 : 2;
    reference::Pass pass;
    pass.images = greys(images);
    if (has_prediction && options_.search == SearchMode::kBand) {
      const StereoMaps* coarse = options_.coarse_match.enabled ? &coarse_match_(images) : nullptr;
      if (coarse) pass.coarse = coarse->disparity.read(context_);
      search_band_(predicted_, &updated_, coarse, &prediction_states_[frames_ % 2], views);
    } else {
      has_prediction ? search_band_.full_range(predicted_, views) : search_band_.full_range();
    }
    pass.band = {search_band_.bands().read(context_), search_band_.cell_offsets().read(context_),
                 search_band_.row_sums().read(context_)};
    census_(images.pixels, codes_);
    const std::vector<cl_uint> codes = codes_.read(context_);
    pass.codes.assign(codes.begin(), codes.end());
    step_penalties_(images.pixels, penalties_, views);
    const std::vector<cl_uchar> penalties = penalties_.read(context_);
    pass.penalties.assign(penalties.begin(), penalties.end());
    banded_sgm_(codes_, penalties_, search_band_, scratch_, reads_off ? RightView::kReadOff : RightView::kMatched);
    pass.matched = download(context_, scratch_);
    median_filter_(scratch_, Holes::kLeave);
    pass.smoothed = download(context_, scratch_);
    const ConsistencyCheckOptions& check = options_.consistency;
    if (reads_off) {
      consistency_(scratch_, check.read_off_px, check.measurement_px, prediction_states_[frames_ % 2],
                   OutsideView::kDrop, measured_);
    } else {
      consistency_(scratch_, check.measurement_px, OutsideView::kDrop, measured_);
    }
    pass.consistent = download(context_, measured_);
    speckle_removal_(measured_, views);
    pass.measured = download(context_, measured_);
    vertical_alignment_.estimate(images, measured_);
    return pass;
  }

  void update(reference::Frame& frame) {
    kalman_update_(prediction_states_[frames_ % 2], updated_, predicted_, measured_, updated_, tracked_views());
    frame.fused = download(context_, updated_);
    median_filter_(updated_, Holes::kFill, tracked_views());
    if (!options_.track_right) right_map_(measured_, options_.consistency.update_px, updated_);
    frame.fused_smoothed = download(context_, updated_);
    consistency_(updated_, options_.consistency.update_px, OutsideView::kKeep, scratch_);
    frame.fused_consistent = download(context_, scratch_);
    sad_check_(images_->pixels, scratch_, updated_);
    frame.updated = download(context_, updated_);
  }

  std::vector<int> greys(const FrameImages& images) {
    const std::vector<cl_uchar> bytes = images.pixels.read(context_);
    std::vector<int> greys(2 * pixel_count(size_));
    for (std::size_t i = 0; i < greys.size(); ++i) {
      greys[i] = type_ == PixelType::kU8 ? bytes[i] : bytes[2 * i] | bytes[2 * i + 1] << 8;
    }
    return greys;
  }

  const PipelineOptions options_;
  const shared::ImageSize size_;
  const PixelType type_;
  ocl::Context context_{any_device()};
  ForwardWarp forward_warp_;
  EdgeRejection edge_rejection_;
  HoleFill hole_fill_;
  ConsistencyCheck consistency_;
  VerticalAlignment vertical_alignment_;
  CoarseMatch coarse_match_;
  SearchBand search_band_;
  Census census_;
  StepPenalties step_penalties_;
  BandedSgm banded_sgm_;
  MedianFilter median_filter_;
  SpeckleRemoval speckle_removal_;
  KalmanUpdate kalman_update_;
  PredictionCheck prediction_check_;
  RightMap right_map_;
  OutputVariance output_variance_;
  DynamicMap dynamic_map_;
  SadCheck sad_check_;
  FrameTransfer transfer_;
  ocl::Buffer<cl_uint> codes_;
  ocl::Buffer<cl_uchar> penalties_;
  StereoMaps predicted_{context_, size_}, measured_{context_, size_}, scratch_{context_, size_},
      updated_{context_, size_}, belief_{context_, size_};
  PredictionCheck::State prediction_states_[2]{{context_, 1}, {context_, 1}};
  const FrameImages* images_ = nullptr;
  bool has_belief_ = false;
  int frames_ = 0;
};

}  // namespace egosgm::testing
