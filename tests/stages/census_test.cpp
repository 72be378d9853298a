// SPDX-License-Identifier: Apache-2.0
#include "host/stages/census.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/reference/census.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using Case = std::tuple<shared::ImageSize, PixelType, MatchingCost, int>;

std::string name(const ::testing::TestParamInfo<Case>& info) {
  const auto [size, type, cost, pixels] = info.param;
  return testing::name_of(size, type) +
         (cost == MatchingCost::kCensus9x7   ? "_census9x7"
          : cost == MatchingCost::kCensus5x5 ? "_census5x5"
                                             : "_grey") +
         "_by_" + std::to_string(pixels);
}

ocl::Buffer<cl_uchar> both(ocl::Context& context, const std::vector<std::uint16_t> (&views)[2], PixelType type) {
  std::vector<std::uint16_t> greys = views[0];
  greys.insert(greys.end(), views[1].begin(), views[1].end());
  return testing::images_of(context, greys, type).pixels;
}

class CensusTest : public ::testing::TestWithParam<Case> {};

TEST_P(CensusTest, EqualsReference) {
  const auto [size, type, cost, pixels] = GetParam();
  const int padding = 19, bytes = type == PixelType::kU8 ? 1 : 2;
  std::mt19937 random(1);
  std::uniform_int_distribution<int> grey(0, type == PixelType::kU8 ? 255 : 65535);
  std::vector<std::uint16_t> views[2];
  for (auto& view : views) {
    for (std::size_t i = 0; i < pixel_count(size); ++i) view.push_back(static_cast<std::uint16_t>(grey(random)));
  }

  ocl::Context& context = testing::shared_context();
  Census census(context, size, type, cost, padding, pixels);
  ocl::Buffer<cl_uint> codes(context, Census::words(cost, size, padding));
  const auto images = both(context, views, type);
  census.encode(images, codes);

  auto expected = reference::padded_codes(size, reference::codes(size, views[0], 8 * bytes, cost),
                                          reference::codes(size, views[1], 8 * bytes, cost), padding, cost);
  const shared::ImageSize rows_of_words{(size.width + 2 * padding) * Census::words(cost), size.height};
  const auto read = [&] {
    const auto words = codes.read(context);
    return std::vector<std::uint32_t>(words.begin(), words.end());
  };
  EXPECT_TRUE(testing::same_bits(read(), expected, rows_of_words));

  codes.write(context, std::vector<cl_uint>(expected.size(), 7));
  census.encode(images, codes, 3);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const int row = static_cast<int>(i / rows_of_words.width);
    if (row % size.height % 3 != 0) expected[i] = 7;
  }
  EXPECT_TRUE(testing::same_bits(read(), expected, rows_of_words));
}

using AlikeCase = std::tuple<shared::ImageSize, int>;

std::string alike_name(const ::testing::TestParamInfo<AlikeCase>& info) {
  const auto [size, pixels] = info.param;
  return testing::name_of(size) + "_by_" + std::to_string(pixels);
}

class AlikeTest : public ::testing::TestWithParam<AlikeCase> {};

TEST_P(AlikeTest, EqualsReference) {
  const auto [size, pixels] = GetParam();
  std::mt19937 random(3);
  std::vector<std::uint16_t> views[2];
  for (auto& view : views) {
    for (std::size_t i = 0; i < pixel_count(size); ++i) {  // a wall, noise, and all that 16 bits can be
      const unsigned x = i % size.width, kind = x * 3 / size.width;
      view.push_back(static_cast<std::uint16_t>(kind == 0   ? 30000 + random() % 300
                                                : kind == 1 ? random() % 2 * 65535
                                                            : random() % 65536));
    }
  }
  ocl::Context& context = testing::shared_context();
  const int padding = 19;
  Census census(context, size, PixelType::kU16, MatchingCost::kCensus9x7, padding, pixels);
  ocl::Buffer<cl_uint> codes(context, Census::words(MatchingCost::kCensus9x7, size, padding));
  census.encode_alike(both(context, views, PixelType::kU16), codes);
  const auto expected =
      reference::padded_codes(size, reference::alike_codes(size, views[0]), reference::alike_codes(size, views[1]),
                              padding, MatchingCost::kCensus9x7);
  const auto actual = codes.read(context);
  EXPECT_TRUE(testing::same_bits(std::vector<std::uint32_t>(actual.begin(), actual.end()), expected,
                                 {2 * (size.width + 2 * padding), size.height}));
}

INSTANTIATE_TEST_SUITE_P(Sizes, AlikeTest,
                         ::testing::Combine(::testing::ValuesIn(testing::kSizes), ::testing::Values(1, 16)),
                         alike_name);
INSTANTIATE_TEST_SUITE_P(
    Sizes, CensusTest,
    ::testing::Combine(::testing::ValuesIn(testing::kSizes), ::testing::Values(PixelType::kU8, PixelType::kU16),
                       ::testing::Values(MatchingCost::kCensus9x7, MatchingCost::kCensus5x5, MatchingCost::kSad3x3),
                       ::testing::Values(1, 16)),
    name);
INSTANTIATE_TEST_SUITE_P(Large, CensusTest,
                         ::testing::Values(std::tuple{testing::kLargest, PixelType::kU8, MatchingCost::kCensus9x7, 16}),
                         name);

}  // namespace
}  // namespace egosgm
