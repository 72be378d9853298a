// SPDX-License-Identifier: Apache-2.0
#include "host/stages/textureless_regions.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/reference/textureless_regions.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::HostMaps;

std::vector<float> run(shared::ImageSize size, PixelType type, const std::vector<int>& images, Views views,
                       const std::vector<float>& disparity, int pixels = 0) {
  ocl::Context& context = testing::shared_context();
  TexturelessRegions stage(context, size, type, pixels);
  Map left = testing::upload(context, size, {disparity, disparity}).disparity;
  stage.leave_out(testing::images_of(context, images, type).pixels, left, views);
  return left.read(context);
}

EGOSGM_TEST_AT_ALL_SIZES(TexturelessRegionsTest);

// Regions of all forms, as three of four blocks have no texture; nothing, little or most of them has a disparity.
TEST_P(TexturelessRegionsTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  for (const PixelType type : {PixelType::kU8, PixelType::kU16}) {
    const int step = type == PixelType::kU16 ? 257 : 1;
    for (const int row_step : {1, 2}) {
      std::mt19937 random(43);
      const HostMaps maps = testing::random_maps(size, 0, 60, 0.5, 44);
      std::vector<int> images(maps.disparity.size());
      for (int y = 0; y < 2 * size.height; y += 4) {
        for (int x = 0; x < size.width; x += 4) {
          const int range = random() % 4 == 0 ? 30 : 3;
          for (int i = 0; i < 16; ++i) {
            const int u = x + i % 4, v = y + i / 4;
            if (u < size.width && v < 2 * size.height)
              images[v * size.width + u] = step * (100 + static_cast<int>(random() % (range + 1)));
          }
        }
      }
      std::vector<float> expected = reference::textureless_regions(size, images, row_step, maps.disparity);
      for (const int pixels : {1, 16}) {
        EXPECT_TRUE(testing::same_bits(run(size, type, images, {2, row_step}, maps.disparity, pixels), expected, size))
            << "by " << pixels << ", rows " << row_step;
      }
    }
  }
}

/// A region without texture above a row of blocks with texture, in both views: W x 8 of W x 12 pixels.
struct Sky {
  shared::ImageSize size{64, 12};
  std::vector<int> images = std::vector(2 * 64 * 12, 200);
  std::vector<float> disparity = std::vector(2 * 64 * 12, EGOSGM_INVALID_DISPARITY);

  Sky() {
    for (int i = 0; i < 2 * 64 * 12; ++i) {
      if (i / 64 % 12 >= 8) images[i] = i % 2 * 90, disparity[i] = 5;
    }
  }
  /// Of the left view's region, its first `count` pixels have a disparity. Returns how many have one afterwards.
  int left_of(int count) {
    for (int i = 0; i < count; ++i) disparity[i] = 5;
    const std::vector<float> result = run(size, PixelType::kU8, images, Views::kBoth, disparity);
    for (int i = 8 * 64; i < 12 * 64; ++i) EXPECT_EQ(result[i], 5.0f) << "what has texture stays, " << i;
    return static_cast<int>(std::count(result.begin(), result.begin() + 8 * 64, 5.0f));
  }
};

TEST(TexturelessRegions, AreLeftOutWhereFewerThanThreeQuartersOfTheirPixelsHaveADisparity) {
  EXPECT_EQ(Sky().left_of(383), 0);
  EXPECT_EQ(Sky().left_of(384), 384);
}

TEST(TexturelessRegions, StayWhereTheyDoNotRunOutOfTheImageAtItsTop) {
  Sky sky;
  for (int i = 0; i < 4 * 64; ++i) sky.images[i] = i % 2 * 90;
  sky.disparity[5 * 64] = 5;
  EXPECT_EQ(run(sky.size, PixelType::kU8, sky.images, Views::kBoth, sky.disparity)[5 * 64], 5.0f);
}

TEST(TexturelessRegions, EachIsJudgedByItself) {
  Sky sky;
  for (int i = 0; i < 8 * 64; ++i) {
    if (i % 64 / 4 == 8) sky.images[i] = i % 2 * 90;  // a post parts it
    if (i % 64 >= 36) sky.disparity[i] = 5;
  }
  sky.disparity[0] = 5;
  const std::vector<float> result = run(sky.size, PixelType::kU8, sky.images, Views::kBoth, sky.disparity);
  EXPECT_EQ(result[0], EGOSGM_INVALID_DISPARITY);
  EXPECT_EQ(result[40], 5.0f);
}

TEST(TexturelessRegions, ReachBehindWhatHangsIntoThem) {
  Sky sky;
  for (int i = 0; i < 4 * 64; ++i) {
    if (i % 64 / 4 != 3) sky.images[i] = i % 2 * 90;  // open at the top in one place
  }
  sky.disparity[7 * 64 + 60] = 5;
  EXPECT_EQ(run(sky.size, PixelType::kU8, sky.images, Views::kBoth, sky.disparity)[7 * 64 + 60],
            EGOSGM_INVALID_DISPARITY);
}

TEST(TexturelessRegions, AreBrightForTheirRange) {
  Sky sky;
  sky.disparity[0] = 5;
  const auto after = [&] { return run(sky.size, PixelType::kU8, sky.images, Views::kBoth, sky.disparity)[0]; };
  for (int i = 1; i < 8 * 64; i += 4) sky.images[i] = 208;  // 12 times 17 is less than it
  EXPECT_EQ(after(), EGOSGM_INVALID_DISPARITY);
  for (int i = 2; i < 8 * 64; i += 4) sky.images[i] = 190;  // but 12 times 18 is not
  EXPECT_EQ(after(), 5.0f);
}

// An outline lends its disparity to the pixels around, some of which lie in its own blocks.
TEST(TexturelessRegions, TakeThePixelsOfTheBlocksBesideThemThatAreAsBright) {
  Sky sky;
  const auto after = [&](int x, int y) {
    return run(sky.size, PixelType::kU8, sky.images, Views::kBoth, sky.disparity)[y * 64 + x];
  };
  sky.images[8 * 64 + 20] = 200;
  EXPECT_EQ(after(20, 8), EGOSGM_INVALID_DISPARITY);
  EXPECT_EQ(after(21, 8), 5.0f) << "is darker";
  sky.images[8 * 64 + 20] = 219;  // 12 times 19 is not less than it
  EXPECT_EQ(after(20, 8), 5.0f);
  for (int i = 0; i < 400; ++i) sky.disparity[i] = 5;
  sky.images[8 * 64 + 20] = 200;
  EXPECT_EQ(after(20, 8), 5.0f) << "beside a region that stays";
}

TEST(TexturelessRegions, AreNotTheBlackEdgesOfARectifiedImage) {
  Sky sky;
  sky.disparity[0] = 5;
  for (int i = 0; i < 8 * 64; ++i) sky.images[i] = 0;
  EXPECT_EQ(run(sky.size, PixelType::kU8, sky.images, Views::kBoth, sky.disparity)[0], 5.0f);
}

}  // namespace
}  // namespace egosgm
