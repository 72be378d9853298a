// SPDX-License-Identifier: Apache-2.0
#include "host/vision/pair_matches.h"

#include <gtest/gtest.h>

#include "egosgm/error.h"
#include "egosgm/vision/synthetic.h"

namespace egosgm::vision {
namespace {

TEST(PairMatches, LieInTheRowsOfRectifiedImages) {
  const SyntheticSequence street({.frames = 1, .width = 320, .height = 128, .seed = 5});
  const SyntheticFrame frame = street.render(0);
  const std::vector<PairMatch> matches = match_pair(frame.left, frame.right);
  ASSERT_GT(matches.size(), 50u);
  std::size_t in_row = 0;
  for (const PairMatch& match : matches) in_row += std::abs(match.left.y - match.right.y) < 0.5;
  EXPECT_GT(in_row, matches.size() * 9 / 10);
  EXPECT_TRUE(match_pair(cv::Mat::zeros(128, 320, CV_8UC1), frame.right).empty());
  EXPECT_THROW(match_pair(frame.left, frame.right.colRange(0, 300)), InvalidArgument);
}

}  // namespace
}  // namespace egosgm::vision
