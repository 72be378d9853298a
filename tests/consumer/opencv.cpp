// SPDX-License-Identifier: Apache-2.0
// A project that has OpenCV.
#include <egosgm/vision/matcher.h>
#include <egosgm/vision/synthetic.h>

int main() {
  egosgm::vision::SyntheticOptions options;
  options.frames = options.supersampling = 1;
  options.width = 64;
  options.height = 32;
  const egosgm::vision::SyntheticFrame frame = egosgm::vision::SyntheticSequence(options).render(0);
  const cv::Mat left = egosgm::vision::mat_of(frame.left), right = egosgm::vision::mat_of(frame.right);
  const cv::Ptr<cv::StereoMatcher> matcher = cv::makePtr<egosgm::vision::Matcher>();  // without OpenCV's calib3d
  cv::Mat steps;
  matcher->compute(left, right, steps);
  return cv::countNonZero(steps > 0) > 0 ? 0 : 1;
}
