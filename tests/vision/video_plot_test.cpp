// SPDX-License-Identifier: Apache-2.0
#include "host/vision/video_plot.h"

#include <gtest/gtest.h>

#include "tests/support/expect_refused.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t times = 0;
  for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++times;
  return times;
}

VideoCounts with_flicker(double px) {
  VideoCounts counts;
  counts.flicker.pixels = 1;
  counts.flicker.sum_px = px;
  return counts;
}

TEST(VideoPlot, ACurveBreaksWhereAFrameHasNoFigure) {
  const std::vector<VideoCounts> frames = {VideoCounts{}, with_flicker(1), with_flicker(2), VideoCounts{},
                                           with_flicker(1)};
  const std::string svg = over_frames_svg(frames);
  EXPECT_EQ(count(svg, "stroke=\"#d62728\""), 3u) << "the legend, two frames, one frame";
  EXPECT_EQ(count(svg, ">flicker<"), 1u);
  EXPECT_EQ(count(svg, "TEPE"), 0u) << "nothing is known of it";
  // 2 px lie at 1 / 1.05 of the height of 300 px, from the third of five frames' place.
  EXPECT_EQ(count(svg, "372.00,70.29"), 1u) << svg;
  EXPECT_GT(draw_over_frames(frames).cols, 600);
}

TEST(VideoPlot, DensityShowsTheOracleBelow) {
  DensityCounts counts;
  for (int k = 0; k < DensityCounts::kShares; ++k) {
    counts.kept[k] = 20 * (k + 1);
    counts.bad[k] = 4 * (k + 1);
    counts.oracle_bad[k] = k == 49 ? 200 : 0;
  }
  const std::string svg = density_svg(counts);
  EXPECT_EQ(count(svg, ">oracle<"), 1u);
  EXPECT_EQ(count(svg, "682.00,70.29"), 3u) << "both curves end with all pixels, as does the line of 20 %";
  EXPECT_GT(draw_density(counts).rows, 300);
}

TEST(VideoPlot, NothingToShowIsRefused) {
  expect_refused([] { over_frames_svg({VideoCounts{}}); }, {"two"});
  expect_refused([] { over_frames_svg({VideoCounts{}, VideoCounts{}}); }, {"nothing to plot"});
  expect_refused([] { density_svg(DensityCounts{}); }, {"variance"});
}

}  // namespace
}  // namespace egosgm::vision
