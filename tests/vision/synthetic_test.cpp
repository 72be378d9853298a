// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/synthetic.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <numeric>
#include <set>
#include <sstream>
#include <string>

#include "egosgm/error.h"
#include "egosgm/image.h"
#include "egosgm/vision/calibration_io.h"
#include "egosgm/vision/dataset.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/poses_io.h"
#include "tests/support/expect_refused.h"
#include "tests/support/files.h"
#include "tests/vision/images.h"

namespace egosgm::vision {
namespace {

SyntheticOptions small_options() { return {.frames = 12, .width = 320, .height = 120}; }

bool same_bits(const Image& a, const Image& b) { return largest_difference(a, b) == 0; }

struct Range {
  float low, high;
};
/// Over the pixels whose centres surround (x, y); REQUIRES them to be in the map.
Range around(const Image& map, double x, double y) {
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
  const int x1 = std::min(x0 + 1, map.cols - 1), y1 = std::min(y0 + 1, map.rows - 1);
  const auto [low, high] =
      std::minmax({map.at<float>(y0, x0), map.at<float>(y0, x1), map.at<float>(y1, x0), map.at<float>(y1, x1)});
  return {low, high};
}

double linear(const Image& image, double x, double y) {
  const int x0 = std::min(static_cast<int>(x), image.cols - 2), y0 = std::min(static_cast<int>(y), image.rows - 2);
  const double a = x - x0, b = y - y0;
  return (1 - b) * ((1 - a) * image.at<uint8_t>(y0, x0) + a * image.at<uint8_t>(y0, x0 + 1)) +
         b * ((1 - a) * image.at<uint8_t>(y0 + 1, x0) + a * image.at<uint8_t>(y0 + 1, x0 + 1));
}

/// How a map, moved by the camera's motion alone, agrees with a later frame's map.
struct WarpCounts {
  int moved = 0, agree = 0, seen_through = 0;  // seen_through: nothing is there where a surface must be
  double grey_difference = 0;                  // mean over the pixels that agree
};
WarpCounts warp_left(const SyntheticSequence& sequence, int first, int second, bool moving_pixels) {
  const Calibration c = sequence.calibration();
  const SyntheticFrame from = sequence.render(first), to = sequence.render(second);
  const Eigen::Isometry3d motion = sequence.world_from_camera(second).inverse() * sequence.world_from_camera(first);
  const double fb = c.fx * c.baseline_m;
  WarpCounts counts;
  for_each_pixel(from.left.size(), [&](int x, int y) {
    if ((from.left_moving.at<uint8_t>(y, x) != 0) != moving_pixels) return;
    const double depth = fb / from.left_disparity.at<float>(y, x);
    const Eigen::Vector3d p = motion * (depth * Eigen::Vector3d((x - c.cx) / c.fx, (y - c.cy) / c.fy, 1));
    const double u = c.cx + c.fx * p.x() / p.z(), v = c.cy + c.fy * p.y() / p.z(), d = fb / p.z();
    if (p.z() <= 0 || u < 0 || v < 0 || u > from.left.cols - 1 || v > from.left.rows - 1) return;
    const Range there = around(to.left_disparity, u, v);
    ++counts.moved;
    if (d > there.low - 0.02 && d < there.high + 0.02) {
      ++counts.agree;
      counts.grey_difference += std::abs(from.left.at<uint8_t>(y, x) - linear(to.left, u, v));
    }
    counts.seen_through += d > there.high + 0.02;
  });
  counts.grey_difference /= std::max(1, counts.agree);
  return counts;
}

TEST(Synthetic, MotionCarriesDisparityIntoLaterFrames) {
  SyntheticOptions options = small_options();
  options.turn_deg = 2.7, options.noise_grey = 0;
  const SyntheticSequence sequence(options);
  for (const auto& [first, second, moved, agree] :
       {std::tuple{0, 1, 20000, 0.97}, {5, 6, 20000, 0.97}, {10, 11, 20000, 0.97}, {0, 8, 10000, 0.9}}) {
    SCOPED_TRACE(std::to_string(first) + " to " + std::to_string(second));
    const WarpCounts counts = warp_left(sequence, first, second, false);
    EXPECT_GT(counts.moved, moved);
    EXPECT_GT(counts.agree, agree * counts.moved);
    EXPECT_LT(counts.seen_through, 0.005 * counts.moved);
    EXPECT_LT(counts.grey_difference, 7);
    EXPECT_TRUE(sequence.motion(second).current_from_previous.isApprox(
        sequence.world_from_camera(second).inverse() * sequence.world_from_camera(second - 1), 1e-9));
  }
}

TEST(Synthetic, MovingVehiclesContradictTheCamerasMotionAndTheRestDoesNot) {
  SyntheticOptions options = small_options();
  options.moving_object = true;
  const SyntheticSequence sequence(options);
  const WarpCounts moving = warp_left(sequence, 7, 8, true), still = warp_left(sequence, 7, 8, false);
  EXPECT_GT(moving.moved, 200);
  EXPECT_LT(moving.agree, 0.5 * moving.moved);
  EXPECT_GT(still.agree, 0.95 * still.moved);
}

TEST(Synthetic, MovingMaskIsEmptyWithoutTheOption) {
  SyntheticOptions options = small_options();
  const auto moving = [&](int frame) {
    const SyntheticFrame rendered = SyntheticSequence(options).render(frame);
    return std::pair{count_nonzero(rendered.left_moving), count_nonzero(rendered.right_moving)};
  };
  EXPECT_EQ(moving(4), (std::pair<std::ptrdiff_t, std::ptrdiff_t>{0, 0}));
  options.moving_object = true;
  EXPECT_GT(std::min(moving(4).first, moving(4).second), 200);
  options.frames = 100;  // one of them stays ahead of the camera
  for (const int frame : {29, 60, 99}) EXPECT_GT(moving(frame).first, 200) << "frame " << frame;
  options.moving_object_scale = 5;
  EXPECT_GT(moving(4).first, 0.3 * options.width * options.height);
}

TEST(Synthetic, SceneFlowLeadsToTheNextFrameAndSaysWhatIsSeenThere) {
  SyntheticOptions options = small_options();
  options.turn_deg = 2.7, options.noise_grey = 0;
  options.moving_object_scale = 5;  // so wide that its turn of 1.9 degrees shows
  for (const bool plain : {false, true}) {
    options.plain = plain, options.moving_object = true;
    const SyntheticSequence sequence(options);
    const SyntheticFrame frame = sequence.render(3), next = sequence.render(4);
    const SyntheticSceneFlow flow = sequence.scene_flow(3), then = sequence.scene_flow(4);
    int counts[2] = {}, agree[2] = {}, hidden = 0, behind = 0, same = 0;
    double grey_difference = 0;
    for_each_pixel(frame.left.size(), [&](int x, int y) {
      const int id = flow.objects.at<uint8_t>(y, x), moves = id != 0;
      ASSERT_EQ(moves, frame.left_moving.at<uint8_t>(y, x) != 0) << "at " << x << ", " << y;
      const float *uv = flow.flow.row<float>(y) + 2 * x, d = flow.next_disparity.at<float>(y, x);
      const double u = x + uv[0], v = y + uv[1];
      const bool seen = flow.seen_next.at<uint8_t>(y, x) != 0;
      if (u < -0.5 || v < -0.5 || u > frame.left.cols - 0.5 || v > frame.left.rows - 0.5) {
        ASSERT_FALSE(seen) << "at " << x << ", " << y;
      }
      if (!(u >= 0 && v >= 0 && u <= frame.left.cols - 1 && v <= frame.left.rows - 1)) return;
      const Range there = around(next.left_disparity, u, v);
      hidden += !seen, behind += !seen && there.high > d;
      if (!seen) return;
      ++counts[moves];
      agree[moves] += d > there.low - 0.03 && d < there.high + 0.03;
      same += then.objects.at<uint8_t>(static_cast<int>(std::lround(v)), static_cast<int>(std::lround(u))) == id;
      grey_difference += std::abs(frame.left.at<uint8_t>(y, x) - linear(next.left, u, v));
    });
    const int all = counts[0] + counts[1];
    EXPECT_GT(counts[0], 15000) << "plain " << plain;
    EXPECT_GT(counts[1], plain ? 50 : 500) << "plain " << plain;
    for (const int moves : {0, 1}) EXPECT_GT(agree[moves], 0.98 * counts[moves]) << "plain " << plain << moves;
    EXPECT_GT(behind, 0.95 * hidden) << "plain " << plain;
    EXPECT_GT(same, 0.99 * all) << "plain " << plain;
    EXPECT_LT(grey_difference, 7.0 * all) << "plain " << plain;
  }
}

// A vehicle comes, one turns and somebody walks.
TEST(Synthetic, ObjectsMoveAsTheirMotionsSay) {
  SyntheticOptions options = small_options();
  options.frames = 30, options.moving_object = true, options.traffic = true;
  const SyntheticSequence sequence(options);
  int crossing = 0;
  bool comes = false, turns = false, walks = false;
  std::set<int> ids;
  for (int k = 0; k < 29; ++k) {
    const SyntheticSceneFlow flow = sequence.scene_flow(k), then = sequence.scene_flow(k + 1);
    Image uncounted = flow.objects.clone();
    const Eigen::Isometry3d of_camera = sequence.motion(k + 1).current_from_previous;
    for (const SyntheticObject& object : flow.moving) {
      crossing += object.id > 1;
      ids.insert(object.id);
      const Eigen::AngleAxisd turn((of_camera.inverse() * object.next_from_current).linear());
      const double speed = object.velocity_m.norm();
      comes |= object.id == 128 && object.velocity_m.z() < -0.6;
      turns |= object.id == 129 && turn.angle() > 0.02;
      walks |= object.id == 130 && speed > 0.05 && speed < 0.2 && turn.angle() < 1e-6;
      for (const SyntheticObject& next : then.moving) {
        if (next.id != object.id) continue;
        EXPECT_TRUE((object.next_from_current * object.centre_m).isApprox(next.centre_m, 1e-9)) << object.id;
        EXPECT_TRUE((of_camera * (object.centre_m + object.velocity_m)).isApprox(next.centre_m, 1e-9)) << object.id;
      }
      bool touches[4] = {};
      for (int y = object.top; y <= object.bottom; ++y) {
        for (int x = object.left; x <= object.right; ++x) {
          uint8_t& id = uncounted.at<uint8_t>(y, x);
          if (id != object.id) continue;
          touches[0] |= x == object.left, touches[1] |= x == object.right;
          touches[2] |= y == object.top, touches[3] |= y == object.bottom;
          id = 0;
        }
      }
      EXPECT_TRUE(touches[0] && touches[1] && touches[2] && touches[3]) << "frame " << k << ", " << object.id;
    }
    EXPECT_TRUE(k == 24 || count_nonzero(uncounted) == 0) << "frame " << k << ": then a vehicle leaves the street";
  }
  EXPECT_GT(crossing, 10);
  EXPECT_TRUE(comes && turns && walks) << comes << turns << walks;
  for (const int id : {1, 2, 128, 129, 130}) EXPECT_EQ(ids.count(id), 1u) << id;
}

/// Mean |left(x) - right(x - d - error)| over pixels that both cameras see, right linearly interpolated.
double photometric_difference(const SyntheticFrame& frame, int first_row, int last_row, double error_px) {
  double sum = 0;
  int count = 0;
  for (int y = first_row; y < last_row; ++y) {
    for (int x = 0; x < frame.left.cols; ++x) {
      const double there = x - frame.left_disparity.at<float>(y, x) - error_px;
      if (!frame.left_noc.at<uint8_t>(y, x) || there < 0 || there >= frame.left.cols - 1) continue;
      sum += std::abs(frame.left.at<uint8_t>(y, x) - linear(frame.right, there, y));
      ++count;
    }
  }
  return sum / count;
}

TEST(Synthetic, ImagesAgreeAtTheTrueDisparity) {
  SyntheticOptions options = small_options();
  options.noise_grey = 0;
  const SyntheticFrame frame = SyntheticSequence(options).render(3);
  for (const int row : {0, 40, 80}) {  // sky and roofs, the far street, the road
    const double at_truth = photometric_difference(frame, row, row + 40, 0);
    EXPECT_LT(at_truth, 7.0) << "from row " << row;
    for (const double error_px : {-3, -1, 1, 3}) {
      EXPECT_GT(photometric_difference(frame, row, row + 40, error_px), 1.25 * at_truth)
          << "row " << row << ", " << error_px;
    }
  }
}

void expect_views_agree(const Image& map, const Image& noc, const Image& other, int towards_other) {
  int seen = 0, agree = 0, hidden = 0, behind = 0;
  for_each_pixel(map.size(), [&](int x, int y) {
    const float d = map.at<float>(y, x);
    const double there = x + towards_other * d;
    if (there < 0 || there > map.cols - 1) {
      if (there < -0.5 || there >= map.cols - 0.5) {
        ASSERT_EQ(noc.at<uint8_t>(y, x), 0) << "at " << x << ", " << y;
      }
      return;
    }
    const Range range = around(other, there, y);
    const bool noc_here = noc.at<uint8_t>(y, x) != 0;
    seen += noc_here, agree += noc_here && d > range.low - 0.02 && d < range.high + 0.02;
    hidden += !noc_here, behind += !noc_here && range.high > d;
  });
  EXPECT_GT(seen, 0.8 * map.pixels());
  EXPECT_GT(agree, 0.995 * seen);
  EXPECT_GT(hidden, 100);
  EXPECT_GT(behind, 0.97 * hidden);
}

TEST(Synthetic, LeftAndRightTruthAgreeWhereBothSeeThePoint) {
  const SyntheticFrame frame = SyntheticSequence(small_options()).render(5);
  expect_views_agree(frame.left_disparity, frame.left_noc, frame.right_disparity, -1);
  expect_views_agree(frame.right_disparity, frame.right_noc, frame.left_disparity, 1);
}

/// Runs of `low` to `high` pixels in a row that stand out from both sides by more than 2 px of disparity.
int thin_runs(const Image& map, int low, int high) {
  int count = 0;
  for (int y = 0; y < map.rows; ++y) {
    const float* row = map.row<float>(y);
    for (int x = 1; x < map.cols; ++x) {
      if (row[x] < row[x - 1] + 2) continue;
      int end = x;
      while (end < map.cols && std::abs(row[end] - row[x]) < 1) ++end;
      if (end < map.cols && row[end] < row[end - 1] - 2) count += end - x >= low && end - x <= high;
    }
  }
  return count;
}

TEST(Synthetic, ThinPolesStandBeforeTheBackground) {
  SyntheticOptions options;
  options.supersampling = 1;  // of the intensity only
  const SyntheticSequence sequence(options);
  options.pole_spacing_m = 1000;
  const SyntheticSequence bare(options);
  for (const int frame : {0, 10, 19}) {
    const int with_poles = thin_runs(sequence.render(frame).left_disparity, 2, 4);
    EXPECT_GT(with_poles, 60) << "frame " << frame;
    EXPECT_LT(thin_runs(bare.render(frame).left_disparity, 2, 4), 0.3 * with_poles) << "frame " << frame;
  }
  const SyntheticSequence plain({.plain = true, .pole_width_px = 5, .pole_spacing_m = 4, .supersampling = 1});
  EXPECT_GT(thin_runs(plain.render(0).left_disparity, 3, 8), 200);
}

TEST(Synthetic, DisparityIsPositiveAndFitsTheDefaultRange) {
  const SyntheticSequence sequence({.width = 1242, .height = 375, .supersampling = 1});
  for (const int frame : {0, 7, 19}) {
    const SyntheticFrame rendered = sequence.render(frame);
    for (const Image& map : {rendered.left_disparity, rendered.right_disparity}) {
      const std::vector<double> values = values_of(map);
      const auto [low, high] = std::minmax_element(values.begin(), values.end());
      EXPECT_GT(*low, 1.0 / 256);
      EXPECT_LT(*high, 110);
    }
  }
}

TEST(Synthetic, SameOptionsGiveTheSameBitsAndLengthDoesNotMatter) {
  SyntheticOptions options = small_options();
  const SyntheticFrame first = SyntheticSequence(options).render(7);
  options.frames = 100;
  const SyntheticFrame second = SyntheticSequence(options).render(7);
  EXPECT_TRUE(same_bits(first.left, second.left));
  EXPECT_TRUE(same_bits(first.right, second.right));
  EXPECT_EQ(largest_difference(first.left_disparity, second.left_disparity), 0);
  EXPECT_EQ(largest_difference(first.right_disparity, second.right_disparity), 0);
  EXPECT_TRUE(same_bits(first.left_noc, second.left_noc));
  options.seed = 2;
  EXPECT_FALSE(same_bits(first.left, SyntheticSequence(options).render(7).left));
}

std::vector<double> differences(const Image& a, const Image& b, double scale_of_b = 1) {
  std::vector<double> of_a = values_of(a);
  const std::vector<double> of_b = values_of(b);
  for (std::size_t i = 0; i < of_a.size(); ++i) of_a[i] -= scale_of_b * of_b[i];
  return of_a;
}

double mean_product(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0) / static_cast<double>(a.size());
}

TEST(Synthetic, NoiseHasItsStandardDeviationAndDiffersBetweenTheImages) {
  SyntheticOptions options = small_options();
  options.noise_grey = 0;
  const SyntheticFrame clean = SyntheticSequence(options).render(0);
  options.noise_grey = 4;
  const SyntheticFrame noisy = SyntheticSequence(options).render(0);
  const std::vector<double> left = differences(noisy.left, clean.left), right = differences(noisy.right, clean.right);
  EXPECT_NEAR(mean_product(left, std::vector<double>(left.size(), 1)), 0, 0.1);
  EXPECT_NEAR(std::sqrt(mean_product(left, left)), 4, 0.2);
  EXPECT_LT(std::abs(mean_product(left, right)) / 16.0, 0.03);
}

TEST(Synthetic, ExposureScalesTheGreyValuesAndNotTheNoise) {
  SyntheticOptions options = small_options();
  options.noise_grey = 0;
  const SyntheticFrame day = SyntheticSequence(options).render(0);
  options.exposure = 0.1;
  const SyntheticFrame night = SyntheticSequence(options).render(0);
  options.noise_grey = 4;
  const SyntheticFrame noisy = SyntheticSequence(options).render(0);
  for (const double difference : differences(night.right, day.right, 0.1)) {
    ASSERT_LE(std::abs(difference), 0.5 + 0.05 + 1e-3);  // both are rounded
  }
  EXPECT_EQ(largest_difference(night.left_disparity, day.left_disparity), 0);
  const std::vector<double> dark = values_of(night.right), all = differences(noisy.right, night.right);
  std::vector<double> uncut;  // noise cuts darker ones at black
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (dark[i] >= 14) uncut.push_back(all[i]);
  }
  EXPECT_NEAR(std::sqrt(mean_product(uncut, uncut)), 4, 0.2);
}

TEST(Synthetic, PosesAreRigidStartAtIdentityAndFollowSpeedAndTurn) {
  SyntheticOptions options = small_options();
  options.frames = 100, options.turn_deg = 2, options.wobble = 0;
  const SyntheticSequence sequence(options);
  EXPECT_TRUE(sequence.world_from_camera(0).isApprox(Eigen::Isometry3d::Identity(), 0));
  double largest_turn_deg = 0;
  for (int k = 1; k < options.frames; ++k) {
    const Eigen::Isometry3d pose = sequence.world_from_camera(k), motion = sequence.motion(k).current_from_previous;
    ASSERT_LT((pose.linear() * pose.linear().transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    ASSERT_GT(pose.linear().determinant(), 0);
    ASSERT_TRUE((pose * motion).isApprox(sequence.world_from_camera(k - 1), 1e-9));
    ASSERT_NEAR(motion.translation().norm(), options.speed_m, 0.01);
    ASSERT_LT(motion.translation().z(), 0);
    largest_turn_deg = std::max(largest_turn_deg, Eigen::AngleAxisd(motion.linear()).angle() * 57.29577951308232);
  }
  options.speed_m = 0;
  EXPECT_TRUE(SyntheticSequence(options).motion(5).current_from_previous.isApprox(Eigen::Isometry3d::Identity(), 0));
  EXPECT_LE(largest_turn_deg, 2.0);
  EXPECT_GT(largest_turn_deg, 1.4);
}

TEST(Synthetic, AnySizeRenders) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 5}, {7, 1}, {7, 5}, {65, 3}, {33, 127}}) {
    const SyntheticFrame frame =
        SyntheticSequence({.frames = 2, .width = width, .height = height, .moving_object = true}).render(1);
    const Size size{width, height};
    EXPECT_EQ(frame.left.size(), size);
    EXPECT_EQ(frame.right_noc.size(), size);
    for (const double d : values_of(frame.left_disparity)) {
      EXPECT_TRUE(d > 0 && std::isfinite(d)) << width << "x" << height;
    }
  }
}

TEST(Synthetic, BadOptionsAreRefusedByName) {
  const std::pair<const char*, SyntheticOptions> cases[] = {{"frames", {.frames = 0}},
                                                            {"width", {.width = 0}},
                                                            {"width", {.width = 8193}},
                                                            {"height", {.height = -3}},
                                                            {"speed_m", {.speed_m = std::nan("")}},
                                                            {"turn_deg", {.turn_deg = 90}},
                                                            {"turn_deg", {.speed_m = 0.2, .turn_deg = 3}},
                                                            {"noise_grey", {.noise_grey = -1}},
                                                            {"exposure", {.exposure = 0}},
                                                            {"wobble", {.wobble = 1e9}},
                                                            {"pole_width_px", {.pole_width_px = 0}},
                                                            {"pole_spacing_m", {.pole_spacing_m = 0}},
                                                            {"supersampling", {.supersampling = 0}},
                                                            {"moving_object_scale", {.moving_object_scale = 0}},
                                                            {"traffic", {.traffic = true}}};
  for (const auto& [name, options] : cases) {
    testing::expect_refused([&, options = options] { SyntheticSequence{options}; }, {name});
  }
  const SyntheticSequence sequence(small_options());
  EXPECT_THROW(sequence.render(-1), InvalidArgument);
  EXPECT_THROW(sequence.motion(12), InvalidArgument);
}

class SyntheticFiles : public ::testing::Test {
 protected:
  const TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_ / "street";
};

TEST_F(SyntheticFiles, SequenceReadsBackAsItWasRendered) {
  const SyntheticOptions options{.frames = 2, .width = 97, .height = 41, .moving_object = true};
  int done = 0;
  write_sequence(options, folder_, [&](int count, int) { done = count; });
  EXPECT_EQ(done, 2);

  const SyntheticSequence sequence(options);
  const SyntheticFrame frame = sequence.render(1);
  const std::string name = "000001.png";
  EXPECT_TRUE(same_bits(read_stored_image(folder_ / "image_0" / name), frame.left));
  EXPECT_TRUE(same_bits(read_stored_image(folder_ / "image_1" / name), frame.right));
  EXPECT_TRUE(same_bits(read_stored_image(folder_ / "truth/left_moving" / name), frame.left_moving));
  const Image occ = read_disparity(folder_ / "truth/right_disp_occ" / name);
  const Image noc = read_disparity(folder_ / "truth/right_disp_noc" / name);
  EXPECT_LE(largest_difference(occ, frame.right_disparity), 1.0 / 256);
  for_each_pixel(noc.size(), [&](int x, int y) {
    const float expected = frame.right_noc.at<uint8_t>(y, x) ? occ.at<float>(y, x) : kInvalidDisparity;
    ASSERT_EQ(noc.at<float>(y, x), expected) << "at " << x << ", " << y;
  });

  const SyntheticSceneFlow next = sequence.scene_flow(0);
  const Image flow = read_stored_image(folder_ / "truth/flow/000000.png");
  ASSERT_EQ(flow.type, kBgr16);
  for (int x = 0; x < flow.cols; ++x) {
    const uint16_t* stored = flow.row<uint16_t>(30) + 3 * x;
    const float* truth = next.flow.row<float>(30) + 2 * x;
    EXPECT_EQ(stored[0], 1);
    EXPECT_NEAR((stored[2] - 32768) / 64.0, truth[0], 0.5 / 64 + 1e-4);
    EXPECT_NEAR((stored[1] - 32768) / 64.0, truth[1], 0.5 / 64 + 1e-4);
  }
  EXPECT_LE(largest_difference(read_disparity(folder_ / "truth/disp_1/000000.png"), next.next_disparity), 1.0 / 256);
  EXPECT_TRUE(same_bits(read_stored_image(folder_ / "truth/seen_next/000000.png"), next.seen_next));
  EXPECT_TRUE(same_bits(read_stored_image(folder_ / "truth/objects" / name), sequence.scene_flow(1).objects));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "truth/flow" / name)) << "no frame follows it";
  std::ifstream csv(folder_ / "truth/objects.csv");
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line.substr(0, 9), "frame,id,");
  for (const SyntheticObject& object : next.moving) {
    std::getline(csv, line);
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream numbers(line);
    const std::vector<double> row{std::istream_iterator<double>(numbers), {}};
    ASSERT_EQ(row.size(), 24u);
    EXPECT_EQ(std::vector<double>(row.begin(), row.begin() + 3),
              std::vector<double>({0, 1.0 * object.id, 1.0 * object.left}));
    EXPECT_NEAR(row[8], object.centre_m.z(), 1e-6);
    EXPECT_NEAR(row[23], object.next_from_current(2, 3), 1e-6);
  }
  EXPECT_FALSE(std::getline(csv, line)) << line;

  const Calibration read = read_calibration(folder_ / "calib.txt"), truth = sequence.calibration();
  EXPECT_NEAR(read.fx, truth.fx, 1e-9);
  EXPECT_NEAR(read.cy, truth.cy, 1e-9);
  EXPECT_NEAR(read.baseline_m, truth.baseline_m, 1e-9);
  EXPECT_NEAR(read.doffs_px, 0, 1e-9);
  const std::vector<Isometry> poses = read_poses(folder_ / "poses.txt");
  ASSERT_EQ(poses.size(), 2u);
  EXPECT_TRUE(poses[1].isApprox(sequence.world_from_camera(1), 1e-8));
}

TEST_F(SyntheticFiles, AProgressThatThrowsLeavesAShorterSequence) {
  const auto stop = [](int done, int) {
    if (done == 2) throw std::runtime_error("stopped");
  };
  EXPECT_THROW(write_sequence({.frames = 4, .width = 16, .height = 9}, folder_, stop), std::runtime_error);
  const StereoSequence found = open_folder(folder_);
  EXPECT_EQ(found.frames.size(), 2u);
  EXPECT_EQ(poses_of_frames(found, found.poses_file).size(), 2u);
}

TEST_F(SyntheticFiles, FolderHoldsWhatIsPromisedAndNothingElse) {
  write_sequence({.frames = 1, .width = 16, .height = 9}, folder_);
  std::set<std::string> names, expected = {"calib.txt", "poses.txt", "times.txt"};
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_)) {
    if (entry.is_regular_file()) names.insert(std::filesystem::relative(entry.path(), folder_).string());
  }
  for (const std::string folder : {"image_0", "image_1", "truth/left_disp_noc", "truth/left_disp_occ",
                                   "truth/right_disp_noc", "truth/right_disp_occ"}) {
    expected.insert(folder + "/000000.png");
  }
  EXPECT_EQ(names, expected);
}

}  // namespace
}  // namespace egosgm::vision
