// SPDX-License-Identifier: Apache-2.0
// A project that has OpenCV, whose matcher is the lines of docs/use/coming-from.md.
#include <egosgm/vision/synthetic.h>

#include "page_includes.h"

int main() {
  egosgm::vision::SyntheticOptions options;
  options.frames = options.supersampling = 1;
  options.width = 64;
  options.height = 32;
  const egosgm::vision::SyntheticFrame frame = egosgm::vision::SyntheticSequence(options).render(0);
  const cv::Mat left = egosgm::vision::mat_of(frame.left), right = egosgm::vision::mat_of(frame.right);
  cv::Mat disparity;
#include "page_lines.inc"
  return matcher->getNumDisparities() == 128 && cv::countNonZero(disparity > 0) > 0 ? 0 : 1;
}
