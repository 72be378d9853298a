// SPDX-License-Identifier: Apache-2.0
#include "host/stages/sad_check.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/reference/sad_check.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::HostMaps;
using testing::same_bits;

std::vector<float> run(shared::ImageSize size, PixelType type, const SadCheckOptions& options,
                       const std::vector<int>& images, const HostMaps& maps, int pixels = 0) {
  ocl::Context& context = testing::shared_context();
  SadCheck stage(context, size, type, options, pixels);
  Map checked = testing::upload(context, size, maps).disparity;
  stage.check(testing::images_of(context, images, type).pixels, checked);
  return checked.read(context);
}

EGOSGM_TEST_AT_ALL_SIZES(SadCheckTest);

TEST_P(SadCheckTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  for (const PixelType type : {PixelType::kU8, PixelType::kU16}) {
    const int steps = type == PixelType::kU16 ? 257 : 1;
    // Disparities of either sign, many of which lead out of the image, halves among them.
    HostMaps maps = testing::random_maps(size, -20, 60, 0.2, 41);
    std::mt19937 random(42);
    for (float& d : maps.disparity) {
      if (random() % 4 == 0 && d > EGOSGM_INVALID_DISPARITY) d = static_cast<float>(random() % 80) / 2 - 10;
    }
    std::vector<int> images(maps.disparity.size());
    std::generate(images.begin(), images.end(), [&] { return static_cast<int>(random() % (255 * steps + 1)); });
    const SadCheckOptions options{.max_difference = 80};
    const HostMaps expected = reference::sad_check(size, options, images, steps, maps);
    for (const int pixels : {1, 16}) {
      EXPECT_TRUE(same_bits(run(size, type, options, images, maps, pixels), expected.disparity, size))
          << "by " << pixels;
    }
  }
}

/// A ramp of `step` a column, the same scene in both views with disparity 3.
struct Scene {
  shared::ImageSize size{16, 4};
  std::vector<int> images;
  HostMaps maps{std::vector(128, 3.0f), std::vector(128, 1.0f)};

  explicit Scene(int step) {
    for (int i = 0; i < 128; ++i) images.push_back(step * (i % 16 + (i < 64 ? 0 : 3)));
  }
};

TEST(SadCheck, KeepsWhatLooksAlikeAndDropsWhatDoesNot) {
  Scene scene(10);
  scene.maps.disparity[24] = 5.0f;  // two columns off: 20 grey values
  auto kept = run(scene.size, PixelType::kU8, {.max_difference = 19.5f}, scene.images, scene.maps);
  EXPECT_EQ(kept[21], 3.0f);
  EXPECT_EQ(kept[24], EGOSGM_INVALID_DISPARITY);
  EXPECT_EQ(kept[1], EGOSGM_INVALID_DISPARITY) << "its match lies outside of the right image";
  EXPECT_EQ(kept[64 + 12], 3.0f);
  EXPECT_EQ(kept[64 + 13], EGOSGM_INVALID_DISPARITY);
  kept = run(scene.size, PixelType::kU8, {.max_difference = 20}, scene.images, scene.maps);
  EXPECT_EQ(kept[24], 5.0f);
}

TEST(SadCheck, DifferenceIsOnTheEightBitScale) {
  Scene scene(10 * 257);
  scene.maps.disparity[24] = 5.0f;
  EXPECT_EQ(run(scene.size, PixelType::kU16, {.max_difference = 19.5f}, scene.images, scene.maps)[24],
            EGOSGM_INVALID_DISPARITY);
  EXPECT_EQ(run(scene.size, PixelType::kU16, {.max_difference = 20}, scene.images, scene.maps)[24], 5.0f);
}

}  // namespace
}  // namespace egosgm
