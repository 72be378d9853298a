// SPDX-License-Identifier: Apache-2.0
#include "host/stages/dynamic_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "host/stages/forward_warp.h"
#include "tests/reference/dynamic_map.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::kNone;
const Calibration kCalibration{.fx = 100, .fy = 100, .cx = 50, .cy = 30, .baseline_m = 0.5};  // Z = 50 / d

Motion ahead(double metres) {
  Motion motion;
  motion.current_from_previous.translation() = Eigen::Vector3d(0.01, 0, -metres);
  return motion;
}

using View = reference::LeftView;

struct OnDevice {
  OnDevice(ocl::Context& context, shared::ImageSize size, const View& view, DynamicMap& stage)
      : halved(context, pixel_count(DynamicMap::half(size))), disparity(testing::on_device(context, view.disparity)) {
    stage.keep(testing::images_of(context, view.greys, view.bits == 8 ? PixelType::kU8 : PixelType::kU16), halved);
    context.wait();
  }
  ocl::Buffer<cl_ushort> halved;
  Map disparity;
};

std::vector<cl_uchar> marks_of(shared::ImageSize size, const View& last, const View& current, const Motion& motion,
                               int pixels = 0) {
  ocl::Context& context = testing::shared_context();
  DynamicMap stage(context, size, kCalibration, DynamicMap::levels(context, size), pixels);
  const OnDevice first(context, size, last, stage), second(context, size, current, stage);
  ocl::Buffer<cl_uchar> marks = testing::on_device<cl_uchar>(context, pixel_count(size), 99);
  stage.mark({first.halved, first.disparity}, {second.halved, second.disparity}, motion, marks);
  return marks.read(context);
}

std::vector<std::uint8_t> reference_marks(shared::ImageSize size, const View& last, const View& current,
                                          const Motion& motion) {
  Motion back;
  back.current_from_previous = motion.current_from_previous.inverse();
  return reference::dynamic_map(size, last, current, disparity_motion(kCalibration, back, EGOSGM_LEFT));
}

/// Squares of 5x5 pixels of random grey values, which the coarsest images still show.
int texture(int x, int y) {
  std::mt19937 random(static_cast<unsigned>(977 * ((x + 500) / 5) + (y + 500) / 5));
  random.discard(3);
  return static_cast<int>(random() % 200) + 20;
}

constexpr shared::ImageSize kSize{200, 120};
struct Box {
  int left, top, right, bottom;
  bool has(int x, int y) const { return x >= left && x < right && y >= top && y < bottom; }
};
constexpr Box kObject{60, 40, 120, 90};

/// A wall at 10 px, and an object in front of it that has moved by (dx, dy) and is at `near_px`; uniform noise.
View scene(int dx, int dy, float near_px, int noise, unsigned seed) {
  View view{{}, 8, {}};
  std::mt19937 random(seed);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      const bool is_object = kObject.has(x - dx, y - dy);
      const int grey = is_object ? texture(x - dx + 333, y - dy + 77) : texture(x, y);
      const int more = noise > 0 ? static_cast<int>(random() % (2 * noise + 1)) - noise : 0;
      view.greys.push_back(std::clamp(grey + more, 0, 255));
      view.disparity.push_back(is_object ? near_px : 10.0f);
    }
  }
  return view;
}

/// Parts of the object's pixels and of the others that are marked.
std::pair<double, double> parts_marked(const View& last, const View& current, int dx, int dy) {
  const std::vector<cl_uchar> marks = marks_of(kSize, last, current, Motion());
  EXPECT_TRUE(testing::same_bits(marks, reference_marks(kSize, last, current, Motion()), kSize));
  int counts[2] = {}, marked[2] = {};
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      const bool is_object = kObject.has(x - dx, y - dy);
      ++counts[is_object];
      marked[is_object] += marks[static_cast<std::size_t>(y) * kSize.width + x] == 255;
    }
  }
  return {static_cast<double>(marked[1]) / counts[1], static_cast<double>(marked[0]) / counts[0]};
}

EGOSGM_TEST_AT_ALL_SIZES(DynamicMapTest);

TEST_P(DynamicMapTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  std::mt19937 random(23);
  for (const auto& [bits, holes] : {std::pair(8, 0.0), {16, 0.3}}) {
    View views[2];
    const int shift = bits - 8;
    for (int i = 0; i < 2; ++i) {
      views[i].bits = bits;
      for (int y = 0; y < size.height; ++y) {
        for (int x = 0; x < size.width; ++x) {
          const int moved = x + (y < size.height / 2 ? 9 * i : 2 * i);
          views[i].greys.push_back((texture(moved, y) << shift) + static_cast<int>(random() % (5u << shift)));
        }
      }
      std::vector<float> both = testing::random_maps(size, 0, 3, holes, 31 + i).disparity;
      both.resize(pixel_count(size));
      views[i].disparity = std::move(both);
    }
    for (const Motion& motion : {Motion(), ahead(0.4)}) {
      const std::vector<std::uint8_t> expected = reference_marks(size, views[0], views[1], motion);
      if (size.width > 300) {
        EXPECT_GT(std::count(expected.begin(), expected.end(), 255), 500) << "it compares something";
      }
      for (const int pixels : {1, 16}) {
        EXPECT_TRUE(testing::same_bits(marks_of(size, views[0], views[1], motion, pixels), expected, size))
            << bits << " bits, " << holes << " holes, by " << pixels;
      }
    }
  }
}

TEST(DynamicMap, MarksWhatMovesSidewaysByLittleAndByMuch) {
  for (const int shift : {3, 7, 14, 26}) {
    const auto [object, others] = parts_marked(scene(0, 0, 20, 3, 1), scene(shift, 0, 20, 3, 2), shift, 0);
    EXPECT_GT(object, 0.6) << shift << ": but for its outline";
    EXPECT_LT(others, 0.04) << shift << ": uncovered pixels are not asked";
  }
}

TEST(DynamicMap, MarksNothingWhereNothingMovesButNoiseDoes) {
  for (const int noise : {0, 10}) {
    const auto [object, others] = parts_marked(scene(0, 0, 20, noise, 3), scene(0, 0, 20, noise, 4), 0, 0);
    EXPECT_EQ(object, 0) << noise;
    EXPECT_EQ(others, 0) << noise;
  }
}

TEST(DynamicMap, MarksByMapsWhatImagesDoNotShow) {
  for (const float change : {-3.5f, -2.0f, 2.0f, 3.5f}) {
    const auto [object, others] = parts_marked(scene(0, 0, 20, 0, 5), scene(0, 0, 20 + change, 0, 6), 0, 0);
    EXPECT_GT(object, 0.6) << change << ": but for its outline";
    EXPECT_EQ(others, 0) << change;
  }
  for (const float change : {0.8f, 4.5f}) {
    const auto [object, others] = parts_marked(scene(0, 0, 20, 0, 5), scene(0, 0, 20 + change, 0, 6), 0, 0);
    EXPECT_EQ(object, 0) << change << ": within the noise of maps, or a surface that was uncovered";
  }
}

TEST(DynamicMap, DoesNotAskWithoutAMapOrOutsideOfTheImage) {
  View last = scene(0, 0, 20, 0, 1);
  const View current = scene(7, 0, 20, 0, 2);
  std::fill(last.disparity.begin(), last.disparity.end(), kNone);
  EXPECT_EQ(parts_marked(last, current, 7, 0).first, 0);
  const std::vector<cl_uchar> marks = marks_of(kSize, scene(0, 0, 20, 0, 1), current, ahead(1e4));
  EXPECT_EQ(std::count(marks.begin(), marks.end(), 255), 0);
}

}  // namespace
}  // namespace egosgm
