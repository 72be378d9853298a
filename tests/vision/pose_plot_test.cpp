// SPDX-License-Identifier: Apache-2.0
#include "host/vision/pose_plot.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <regex>
#include <sstream>

#include "host/vision/plot.h"
#include "tests/support/expect_refused.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

using Poses = std::vector<Eigen::Isometry3d>;

/// A right angle: `ahead_m` forward, then `right_m` to the right, in steps of a metre, from somewhere in the world.
Poses corner(int ahead_m, int right_m, double scale = 1) {
  const Eigen::Isometry3d start =
      Eigen::Translation3d(40, 2, -7) * Eigen::Isometry3d(Eigen::AngleAxisd(0.8, Eigen::Vector3d::UnitY()));
  Poses poses;
  for (int k = 0; k <= ahead_m + right_m; ++k) {
    const double z = std::min(k, ahead_m), x = std::max(0, k - ahead_m);
    poses.push_back(start * Eigen::Translation3d(scale * x, 0, scale * z));
  }
  return poses;
}

/// Points of the polylines with that colour and width, longest first.
std::vector<cv::Point2d> path_of(const std::string& svg, const std::string& color) {
  const std::regex polyline("<polyline[^>]*stroke=\"" + color + "\"[^>]*points=\"([^\"]*)\"");
  std::string longest;
  for (std::sregex_iterator match(svg.begin(), svg.end(), polyline), end; match != end; ++match) {
    if ((*match)[1].length() > static_cast<long>(longest.size())) longest = (*match)[1];
  }
  std::vector<cv::Point2d> points;
  std::istringstream text(longest);
  for (double x, y; text >> x && text.ignore() && text >> y;) points.emplace_back(x, y);
  return points;
}

double distance(cv::Point2d a, cv::Point2d b) { return std::hypot(a.x - b.x, a.y - b.y); }

TEST(PosePlot, SvgDrawsBothPathsAtOneScaleAheadIsUp) {
  const std::string svg = path_svg(corner(40, 20, 1.1), corner(40, 20));
  const auto truth = path_of(svg, "#1f77b4"), estimate = path_of(svg, "#d62728");
  ASSERT_EQ(truth.size(), 61u);
  ASSERT_EQ(estimate.size(), 61u);
  EXPECT_LT(distance(truth.front(), estimate.front()), 0.02) << "both start at one point";
  EXPECT_NEAR(truth[40].x, truth[0].x, 0.02);
  EXPECT_LT(truth[40].y, truth[0].y);
  EXPECT_NEAR(truth[60].y, truth[40].y, 0.02);
  EXPECT_GT(truth[60].x, truth[40].x);
  const double px_per_m = distance(truth[0], truth[40]) / 40;
  EXPECT_NEAR(distance(truth[40], truth[60]) / 20, px_per_m, 0.01);
  EXPECT_NEAR(distance(estimate[0], estimate[40]) / 44, px_per_m, 0.01);
  for (const char* text : {">truth<", ">estimate<", ">x [m]<", ">z [m]<", ">end drift 7.45 % of 60.0 m<", ">40<"}) {
    EXPECT_NE(svg.find(text), std::string::npos) << text;
  }
}

TEST(PosePlot, PictureShowsTheSameLines) {
  const Poses truth = corner(40, 20), estimate = corner(40, 20, 1.1);
  const cv::Mat picture = draw_path(estimate, truth);
  ASSERT_EQ(picture.type(), CV_8UC3);
  const std::string svg = path_svg(estimate, truth);
  const auto expect_ink = [&](const char* color, const cv::Vec3b& bgr, const std::vector<std::size_t>& at_poses) {
    const auto path = path_of(svg, color);
    for (const std::size_t k : at_poses) {
      const cv::Point2d middle = 0.5 * (path[k] + path[k + 1]);
      double nearest = 1e9;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const auto at = picture.at<cv::Vec3b>(cvRound(middle.y) + dy, cvRound(middle.x) + dx);
          nearest = std::min(nearest, cv::norm(at, bgr, cv::NORM_INF));
        }
      }
      EXPECT_LT(nearest, 40) << color << " at pose " << k;
    }
  };
  expect_ink("#d62728", {40, 39, 214}, {5, 20, 55});
  expect_ink("#1f77b4", {180, 119, 31}, {55});  // before the corner, below the estimate
}

TEST(PosePlot, LettersAreWhole) {
  const auto ink = [](bool upwards, const char* text) {
    const cv::Mat picture =
        draw_plot({.size = {80, 80}, .lines = {}, .labels = {{{40, 40}, text, Anchor::kMiddle, upwards}}});
    cv::Mat grey;
    cv::extractChannel(picture, grey, 0);
    return cv::boundingRect(grey < 200).size();
  };
  // A bracket is taller than a letter, above and below the line.
  EXPECT_GE(ink(false, "[").height, ink(false, "x").height + 8);
  EXPECT_EQ(ink(true, "[").width, ink(false, "[").height);
}

TEST(PosePlot, StandingStillHasAPicture) {
  const Poses still(5, Eigen::Isometry3d::Identity());
  EXPECT_FALSE(draw_path(still, still).empty());
  EXPECT_NE(path_svg(still, still).find("end drift 0.000 m"), std::string::npos);
  EXPECT_EQ(path_svg(still, still).find("nan"), std::string::npos);
}

TEST(PosePlot, LongPathsFitThePicture) {
  const cv::Mat picture = draw_path(corner(4000, 2), corner(4000, 1 + 1));
  EXPECT_LT(picture.rows, 1000);
  EXPECT_LT(picture.cols, 1000);
}

TEST(PosePlot, NumbersOfPosesMustFit) {
  expect_refused([] { path_svg(corner(2, 0), corner(3, 0)); }, {"3 estimated and 4 true"});
}

}  // namespace
}  // namespace egosgm::vision
