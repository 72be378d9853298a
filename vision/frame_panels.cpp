// SPDX-License-Identifier: Apache-2.0
#include "vision/frame_panels.h"

#include <algorithm>

#include "egosgm/error.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/image_io.h"
#include "vision/drawing.h"
#include "vision/image_values.h"
#include "vision/picture_sheet.h"

namespace egosgm::vision {
namespace {

constexpr int kOverviewCellWidth = 800;

void expect_size(const std::filesystem::path& truth, Size of_truth, Size of_images) {
  if (of_truth == of_images) return;
  throw InvalidArgument(truth.string() +
                        ": is of another size than the frame's images: remove it, or write no overview");
}

CaptionedPicture panel(const Layer& layer) {
  if (layer.bar.empty()) return {layer.picture, layer.name};
  return {stacked(layer.picture, layer.bar), layer.name};
}

Layer variance_layer(const ShownFrame& shown) {
  return {"variance", color_variance(shown.variance, shown.disparity),
          color_bar(shown.variance.cols, kVarianceRange, "px^2")};
}

Layer error_layer(const ShownFrame& shown) {
  const Image truth = read_disparity(shown.frame.truth_noc);
  expect_size(shown.frame.truth_noc, truth.size(), shown.disparity.size());
  return {"error [px]", color_error(shown.disparity, truth), error_bar(truth.cols)};
}

}  // namespace

void expect_truth_of_size(const StereoFrame& frame, Size images) {
  if (!frame.truth_noc.empty()) expect_size(frame.truth_noc, read_image_size(frame.truth_noc), images);
}

const ColorRange& FramePanels::disparity_range(const Image& disparity) {
  if (!range_) range_ = vision::disparity_range(disparity);
  return *range_;
}

Image FramePanels::disparity(const Image& disparity) { return color_disparity(disparity, disparity_range(disparity)); }

Layer FramePanels::disparity_layer(const ShownFrame& shown) {
  return {"disparity", disparity(shown.disparity),
          color_bar(shown.disparity.cols, disparity_range(shown.disparity), "px")};
}

Layer FramePanels::search_layer(const ShownFrame& shown) const {
  const Image searched = as_floats(shown.search_width);
  const ColorRange widths{1, std::max(2.0, static_cast<double>(disparities_)), true};
  return {"disparities searched", color_map(searched, widths), color_bar(searched.cols, widths, "")};
}

Image FramePanels::overview(const ShownFrame& shown) {
  const bool truth = !shown.frame.truth_noc.empty();
  return compose({{color_grey(shown.left), "left image, frame " + shown.frame.name},
                  panel(disparity_layer(shown)),
                  panel(search_layer(shown)),
                  panel(truth ? error_layer(shown) : variance_layer(shown))},
                 2, kOverviewCellWidth);
}

std::vector<Layer> FramePanels::layers(const ShownFrame& shown) {
  std::vector<Layer> layers;
  if (!shown.frame.left.empty()) layers.push_back({"left image", read_color_image(shown.frame.left), {}});
  layers.push_back(disparity_layer(shown));
  if (!shown.variance.empty()) layers.push_back(variance_layer(shown));
  if (!shown.search_width.empty()) layers.push_back(search_layer(shown));
  if (!shown.reasons.empty()) {
    layers.push_back({"reason", color_reasons(shown.reasons), reason_bar(shown.reasons.cols)});
  }
  if (!shown.frame.truth_noc.empty()) layers.push_back(error_layer(shown));
  return layers;
}

}  // namespace egosgm::vision
