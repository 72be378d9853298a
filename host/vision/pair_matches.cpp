// SPDX-License-Identifier: Apache-2.0
#include "host/vision/pair_matches.h"

#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/video/tracking.hpp>

#include "egosgm/error.h"
#include "host/vision/grey_bytes.h"

namespace egosgm::vision {
namespace {

constexpr int kFeatures = 3000;
constexpr int kFastThreshold = 12;
constexpr float kMaxDescriptorDistance = 50;  // of 256 bits
constexpr std::size_t kFewest = 16;           // below this a fundamental matrix says nothing
constexpr double kEpipolarTolerance_px = 1.5;
constexpr float kMaxReturn_px = 0.3f;  // a refined point leads back to where it came from

struct Points {
  std::vector<cv::Point2f> left, right;

  void keep(const std::vector<std::uint8_t>& kept) {
    Points some;
    for (std::size_t i = 0; i < left.size(); ++i) {
      if (!kept[i]) continue;
      some.left.push_back(left[i]);
      some.right.push_back(right[i]);
    }
    *this = std::move(some);
  }
};

Points match_descriptors(const cv::Mat& left, const cv::Mat& right) {
  const auto detector = cv::ORB::create(kFeatures, 1.2f, 4, 31, 0, 2, cv::ORB::HARRIS_SCORE, 31, kFastThreshold);
  std::vector<cv::KeyPoint> left_points, right_points;
  cv::Mat left_descriptors, right_descriptors;
  detector->detectAndCompute(left, {}, left_points, left_descriptors);
  detector->detectAndCompute(right, {}, right_points, right_descriptors);
  if (left_points.empty() || right_points.empty()) return {};
  std::vector<cv::DMatch> matches;
  cv::BFMatcher(cv::NORM_HAMMING, /*crossCheck=*/true).match(left_descriptors, right_descriptors, matches);
  Points points;
  for (const cv::DMatch& match : matches) {
    if (match.distance > kMaxDescriptorDistance) continue;
    points.left.push_back(left_points[static_cast<std::size_t>(match.queryIdx)].pt);
    points.right.push_back(right_points[static_cast<std::size_t>(match.trainIdx)].pt);
  }
  return points;
}

void drop_outliers(Points& points) {
  std::vector<std::uint8_t> inliers;
  cv::findFundamentalMat(points.left, points.right, cv::FM_RANSAC, kEpipolarTolerance_px, 0.999, inliers);
  inliers.resize(points.left.size(), 0);
  points.keep(inliers);
}

void refine(const cv::Mat& left, const cv::Mat& right, Points& points) {
  const cv::Size window(15, 15);
  const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 30, 0.005);
  std::vector<std::uint8_t> found, found_back;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(left, right, points.left, points.right, found, error, window, 0, stop,
                           cv::OPTFLOW_USE_INITIAL_FLOW);
  std::vector<cv::Point2f> back = points.left;
  cv::calcOpticalFlowPyrLK(right, left, points.right, back, found_back, error, window, 0, stop,
                           cv::OPTFLOW_USE_INITIAL_FLOW);
  for (std::size_t i = 0; i < found.size(); ++i) {
    found[i] = found[i] && found_back[i] && cv::norm(back[i] - points.left[i]) <= kMaxReturn_px;
  }
  points.keep(found);
}

}  // namespace

std::vector<PairMatch> match_pair(const cv::Mat& left, const cv::Mat& right) {
  if (left.size() != right.size() || left.type() != right.type() ||
      (left.type() != CV_8UC1 && left.type() != CV_16UC1)) {
    throw InvalidArgument("the pair: give grey images of 8 or 16 bits, both of one size and depth");
  }
  const auto [left_bytes, right_bytes] = bytes_of(left, right);
  Points points = match_descriptors(left_bytes, right_bytes);
  if (points.left.size() < kFewest) return {};
  drop_outliers(points);
  if (points.left.size() < kFewest) return {};
  refine(left_bytes, right_bytes, points);
  std::vector<PairMatch> matches;
  for (std::size_t i = 0; i < points.left.size(); ++i) matches.push_back({points.left[i], points.right[i]});
  return matches;
}

}  // namespace egosgm::vision
