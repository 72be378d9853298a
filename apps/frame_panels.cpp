// SPDX-License-Identifier: Apache-2.0
#include "apps/frame_panels.h"

#include <algorithm>

#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/image_io.h"

namespace egosgm::app {
namespace {

constexpr int kOverviewCellWidth = 800;

cv::Mat above(const cv::Mat& picture, const cv::Mat& bar) {
  cv::Mat both;
  cv::vconcat(picture, bar, both);
  return both;
}

vision::CaptionedPicture variance_panel(const ShownFrame& shown) {
  return {above(vision::color_variance(shown.variance, shown.disparity),
                vision::color_bar(shown.left.cols, vision::kVarianceRange, "px^2")),
          "variance"};
}

vision::CaptionedPicture error_panel(const ShownFrame& shown) {
  const cv::Mat truth = vision::read_disparity(shown.frame.truth_noc);
  return {above(vision::color_error(shown.disparity, truth), vision::error_bar(shown.left.cols)), "error [px]"};
}

}  // namespace

const vision::ColorRange& FramePanels::disparity_range(const cv::Mat& disparity) {
  if (!range_) range_ = vision::disparity_range(disparity);
  return *range_;
}

cv::Mat FramePanels::disparity(const cv::Mat& disparity) {
  return vision::color_disparity(disparity, disparity_range(disparity));
}

vision::CaptionedPicture FramePanels::disparity_panel(const ShownFrame& shown) {
  return {above(disparity(shown.disparity), vision::color_bar(shown.left.cols, disparity_range(shown.disparity), "px")),
          "disparity"};
}

vision::CaptionedPicture FramePanels::search_panel(const ShownFrame& shown) const {
  cv::Mat searched;
  shown.search_width.convertTo(searched, CV_32F);
  const vision::ColorRange widths{1, std::max(2.0, static_cast<double>(disparities_)), true};
  return {above(vision::color_map(searched, widths), vision::color_bar(shown.left.cols, widths, "")),
          "disparities searched"};
}

cv::Mat FramePanels::overview(const ShownFrame& shown) {
  const bool truth = !shown.frame.truth_noc.empty();
  return vision::compose({{vision::color_grey(shown.left), "left image, frame " + shown.frame.name},
                          disparity_panel(shown),
                          search_panel(shown),
                          truth ? error_panel(shown) : variance_panel(shown)},
                         2, kOverviewCellWidth);
}

cv::Mat FramePanels::all(const ShownFrame& shown, int cell_width) {
  std::vector<vision::CaptionedPicture> pictures{
      {vision::read_color_png(shown.frame.left), "left image, frame " + shown.frame.name},
      disparity_panel(shown),
      variance_panel(shown),
      search_panel(shown)};
  if (!shown.frame.truth_noc.empty()) pictures.push_back(error_panel(shown));
  return vision::compose(pictures, 2, cell_width);
}

}  // namespace egosgm::app
