// SPDX-License-Identifier: Apache-2.0
#include "host/stages/coarse_match.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/reference/coarse_match.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

/// Blotches of some pixels' size; the right view is the left one moved by `disparity`.
std::vector<int> blotches(shared::ImageSize size, int disparity, int bits) {
  std::mt19937 random(41);
  std::vector<int> cells(4096);
  for (int& cell : cells) cell = static_cast<int>(random() % (1u << bits));
  std::vector<int> images;
  for (int view = 0; view < 2; ++view) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const int u = x + (view == EGOSGM_RIGHT ? disparity : 0) + 4096;
        images.push_back(cells[(y / 5 * 67 + u / 5) % 4096]);
      }
    }
  }
  return images;
}

std::vector<float> run(shared::ImageSize size, const MethodOptions& options, const std::vector<int>& images,
                       PixelType type) {
  ocl::Context& context = testing::shared_context();
  CoarseMatch stage(context, size, options);
  Map found(context, 2 * pixel_count(shared::coarse_size(size)));
  stage.prepare(type);
  stage.match(testing::images_of(context, images, type), found);
  return found.read(context);
}

using Case = std::tuple<shared::ImageSize, PixelType>;

std::string name(const ::testing::TestParamInfo<Case>& info) {
  return testing::name_of(std::get<0>(info.param), std::get<1>(info.param));
}

class CoarseMatchTest : public ::testing::TestWithParam<Case> {};

TEST_P(CoarseMatchTest, EqualsReference) {
  const auto [size, type] = GetParam();
  const int bits = type == PixelType::kU8 ? 8 : 16;
  for (const auto& [min, count] : {std::pair{0, 1}, {0, 64}, {-22, 37}}) {
    SCOPED_TRACE("min " + std::to_string(min) + ", count " + std::to_string(count));
    MethodOptions options;
    options.min_disparity = min;
    options.disparities = count;
    const std::vector<int> images = blotches(size, 12, bits);
    EXPECT_TRUE(testing::same_bits(run(size, options, images, type),
                                   reference::coarse_match(size, options, images, bits), shared::coarse_size(size)));
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, CoarseMatchTest,
                         ::testing::Combine(::testing::ValuesIn(testing::kSizes),
                                            ::testing::Values(PixelType::kU8, PixelType::kU16)),
                         name);

TEST(CoarseMatch, FindsAQuarterOfTheDisparity) {
  const shared::ImageSize size{200, 60};
  MethodOptions options;
  options.disparities = 64;
  const std::vector<float> found = run(size, options, blotches(size, 24, 8), PixelType::kU8);
  int near = 0;
  for (int x = 10; x < 40; ++x) near += std::abs(found[7 * 50 + x] - 6) < 0.25f;
  EXPECT_GE(near, 28);
}

}  // namespace
}  // namespace egosgm
