// SPDX-License-Identifier: Apache-2.0
// What `egosgm synth --plain` renders.
#include <gtest/gtest.h>

#include <cmath>

#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/synthetic.h"
#include "tests/support/files.h"
#include "tests/vision/images.h"

namespace egosgm::vision {
namespace {

SyntheticOptions small_options() { return {.frames = 12, .width = 320, .height = 120, .plain = true}; }

TEST(PlainStreet, HasNothingInItsSkyAndNoTexture) {
  SyntheticOptions options = small_options();
  options.noise_grey = 0, options.wobble = 0, options.height = 240;
  const SyntheticSequence sequence(options);
  const SyntheticFrame frame = sequence.render(3);
  const double horizon = sequence.calibration().cy, ground_px_per_row = sequence.calibration().baseline_m / 1.65;
  int sky = 0, seen = 0, ground = 0, uneven = 0;
  for (int y = 0; y < frame.left.rows; ++y) {
    const auto is_plain = [&](int x) {
      const float d = frame.left_disparity.at<float>(y, x);
      return y < horizon ? d == 0 : std::abs(d - ground_px_per_row * (y - horizon)) < 1e-3;
    };
    for (int x = 3; x < frame.left.cols - 3; ++x) {
      if (!is_plain(x - 3) || !is_plain(x) || !is_plain(x + 3)) continue;
      (y < horizon ? sky : ground) += 1;
      seen += y < horizon && frame.left_noc.at<uint8_t>(y, x) != 0;
      uneven += std::abs(frame.left.at<uint8_t>(y, x) - frame.left.at<uint8_t>(y, x - 1)) > 1;
    }
  }
  EXPECT_GT(sky, 0.25 * frame.left.pixels());
  EXPECT_GT(seen, 0.9 * sky);
  EXPECT_GT(ground, 0.3 * frame.left.pixels());
  EXPECT_LT(uneven, 0.01 * (sky + ground)) << "but for the edges of what stands before it";
}

TEST(PlainStreet, PeopleWalkWhereObjectsMove) {
  SyntheticOptions options = small_options();
  options.speed_m = 0, options.turn_deg = 0, options.wobble = 0;
  const SyntheticSequence still(options);
  const SyntheticFrame first = still.render(0);
  EXPECT_EQ(count_nonzero(first.left_moving), 0);
  EXPECT_EQ(largest_difference(first.left_disparity, still.render(9).left_disparity), 0);
  options.moving_object = true;
  const SyntheticSequence walking(options);
  const SyntheticFrame before = walking.render(0), after = walking.render(9);
  EXPECT_EQ(largest_difference(first.left_disparity, before.left_disparity), 0) << "they start where they stood";
  EXPECT_GT(count_nonzero(before.left_moving), 200);
  const std::vector<double> then = values_of(before.left_disparity), now = values_of(after.left_disparity),
                            moving = values_of(before.left_moving), moved = values_of(after.left_moving);
  int differ = 0, differ_elsewhere = 0;
  for (std::size_t i = 0; i < then.size(); ++i) {
    differ += then[i] != now[i];
    differ_elsewhere += then[i] != now[i] && moving[i] == 0 && moved[i] == 0;
  }
  EXPECT_GT(differ, 200);
  EXPECT_EQ(differ_elsewhere, 0) << "nothing else moves";
}

TEST(PlainStreet, TheSkyIsReadBackAsNothing) {
  SyntheticOptions options = small_options();
  options.frames = 1;
  const TemporaryFolder folder;
  write_sequence(options, folder / "street");
  const SyntheticFrame frame = SyntheticSequence(options).render(0);
  const Image truth = read_disparity(folder / "street/truth/left_disp_occ/000000.png");
  int sky = 0;
  for_each_pixel(truth.size(), [&](int x, int y) {
    const float d = frame.left_disparity.at<float>(y, x);
    ASSERT_EQ(is_sky(truth.at<float>(y, x)), d < 2.0f / 256) << "at " << x << ", " << y << ": " << d;
    sky += d == 0;
  });
  EXPECT_GT(sky, 1000);
}

}  // namespace
}  // namespace egosgm::vision
