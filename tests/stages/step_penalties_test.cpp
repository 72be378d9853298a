// SPDX-License-Identifier: Apache-2.0
#include "host/stages/step_penalties.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/reference/present_rows.h"
#include "tests/reference/step_penalties.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

constexpr cl_uchar kUntouched = 7;

std::vector<std::uint8_t> penalties(shared::ImageSize size, const std::vector<std::uint16_t>& grey, PixelType type,
                                    const BandedSgmOptions& options, int pixels = 0, Views views = Views::kBoth) {
  ocl::Context& context = testing::shared_context();
  StepPenalties penalties(context, size, type, options, pixels);
  auto steps = testing::on_device(context, StepPenalties::bytes(size), kUntouched);
  penalties.compute(testing::images_of(context, grey, type).pixels, steps, views);
  return steps.read(context);
}

constexpr BandedSgmOptions kOptions{.p2 = 180, .p2_at_edges = 33, .p2_slope = 2};

std::vector<std::uint16_t> random_grey(shared::ImageSize size, int bits) {
  std::mt19937 random(1);
  std::vector<std::uint16_t> grey;
  for (std::size_t i = 0; i < 2 * pixel_count(size); ++i)
    grey.push_back(static_cast<std::uint16_t>(random() & ((1u << bits) - 1)));
  return grey;
}

EGOSGM_TEST_AT_ALL_SIZES(StepPenaltiesTest);

TEST_P(StepPenaltiesTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  for (const PixelType type : {PixelType::kU8, PixelType::kU16}) {
    const int bits = type == PixelType::kU8 ? 8 : 16;
    const std::vector<std::uint16_t> grey = random_grey(size, bits);
    const shared::ImageSize of_steps{4 * size.width, size.height};
    const std::vector<std::uint8_t> of_all = reference::step_penalties(size, grey, bits, kOptions);
    const std::vector<std::uint8_t> before(StepPenalties::bytes(size), kUntouched);
    for (const int pixels : {1, 16}) {
      for (const int rows : {1, 2}) {
        const auto present = [&](const std::vector<std::uint8_t>& steps) {
          return reference::without_absent_rows(of_steps, rows, steps, std::uint8_t{0});
        };
        EXPECT_TRUE(testing::same_bits(present(penalties(size, grey, type, kOptions, pixels, {2, rows})),
                                       present(reference::step_penalties(size, grey, bits, kOptions, rows)), of_steps))
            << "by " << pixels << ", row step " << rows;
      }
      EXPECT_TRUE(testing::same_bits(penalties(size, grey, type, kOptions, pixels, Views::kLeft),
                                     testing::left_and_right(of_all, before), of_steps))
          << "the left view alone, by " << pixels;
    }
  }
}

TEST(StepPenalties, FallWithTheStepInGrey) {
  const std::vector<std::uint8_t> steps = penalties({3, 2}, {10, 40, 240, 10, 30, 35, 0, 0, 0, 0, 0, 0}, PixelType::kU8,
                                                    {.p2 = 100, .p2_at_edges = 20, .p2_slope = 2});
  // To the left, to above, to the upper left and to the upper right; outside of the image there is none.
  using Steps = std::vector<std::uint8_t>;
  const auto at = [&](int pixel) { return Steps(steps.begin() + 4 * pixel, steps.begin() + 4 * pixel + 4); };
  EXPECT_EQ(at(0), (Steps{100, 100, 100, 40})) << "the row above is the first one itself";
  EXPECT_EQ(at(1), (Steps{40, 100, 40, 20}));
  EXPECT_EQ(at(3), (Steps{100, 100, 100, 40}));
  EXPECT_EQ(at(4), (Steps{60, 80, 60, 20}));
  EXPECT_EQ(at(5), (Steps{90, 20, 90, 20}));
  EXPECT_EQ(at(6), (Steps{100, 100, 100, 100})) << "of the right view";
  // A lower p2 alone is a lower penalty everywhere.
  EXPECT_EQ(penalties({1, 1}, {10, 10}, PixelType::kU8, {.p2 = 50, .p2_at_edges = 100}),
            std::vector<std::uint8_t>(8, 50));
}

}  // namespace
}  // namespace egosgm
