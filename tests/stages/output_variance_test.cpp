// SPDX-License-Identifier: Apache-2.0
#include "host/stages/output_variance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/reference/method.h"
#include "tests/reference/output_variance.h"
#include "tests/reference/present_rows.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::kNone;
constexpr float kUntouched = -77;

std::vector<float> output_variance(shared::ImageSize size, const std::vector<float>& output,
                                   const testing::HostMaps& in, const testing::HostMaps& measured_in,
                                   const OutputVarianceOptions& options, int pixels = 0, Views views = Views::kBoth) {
  ocl::Context& context = testing::shared_context();
  OutputVariance stage(context, size, options, pixels);
  const StereoMaps maps = testing::upload(context, size, in);
  StereoMaps measured = testing::upload(context, size, measured_in);
  // Not NaN where nothing was measured: the kernel cuts it to what it puts there.
  measured.variance.write(context, measured_in.variance);
  Map variance = testing::on_device(context, in.variance.size(), kUntouched);
  stage.compute(testing::on_device(context, output), maps, measured, variance, views);
  const testing::HostMaps after = testing::download(context, maps);
  EXPECT_EQ(after.disparity, in.disparity);
  EXPECT_EQ(after.variance, testing::masked(in).variance);
  return variance.read(context);
}

/// Of what was just measured, as in the first frame.
std::vector<float> output_variance(shared::ImageSize size, const testing::HostMaps& measured,
                                   const OutputVarianceOptions& options) {
  return output_variance(size, measured.disparity, measured, measured, options);
}

EGOSGM_TEST_AT_ALL_SIZES(OutputVarianceTest);

TEST_P(OutputVarianceTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  for (const double holes : {0.0, 0.3, 0.98}) {
    const testing::HostMaps belief = testing::random_maps(size, -40, 90, holes, 7);
    const testing::HostMaps measured = testing::random_maps(size, -40, 90, 0.3, 8);
    std::vector<float> output = belief.disparity;
    for (std::size_t i = 0; i < output.size(); i += 3) output[i] = kNone;
    for (const OutputVarianceOptions& options : {OutputVarianceOptions{}, {.enabled = false}}) {
      for (const int step : {1, 2}) {
        const std::vector<float> expected = reference::output_variance(size, step, options, output, belief, measured);
        const std::vector<float> before(expected.size(), kUntouched);
        const auto present = [&](const std::vector<float>& map) {
          return reference::without_absent_rows(size, step, map, kUntouched);
        };
        for (const int pixels : {1, 16}) {
          SCOPED_TRACE(std::to_string(holes) + " holes, by " + std::to_string(pixels));
          const auto of = [&](int views) {
            return output_variance(size, output, belief, measured, options, pixels, {views, step});
          };
          EXPECT_TRUE(testing::same_bits(of(2), present(expected), size)) << "every " << step << " rows";
          EXPECT_TRUE(testing::same_bits(of(1), testing::left_and_right(present(expected), before), size));
        }
      }
    }
  }
}

/// What is published for a sum of squares.
float given_for(float sum) {
  return 0.36f * sum * sum / (sum * sum + 0.07f) + 2.52f * std::pow(sum, 5.5f) / (std::pow(sum, 5.0f) + 0.8f);
}

void expect_given_for(const std::vector<float>& sums, const std::vector<float>& variances, const char* what = "") {
  ASSERT_EQ(variances.size(), sums.size());
  for (std::size_t i = 0; i < sums.size(); ++i) EXPECT_FLOAT_EQ(variances[i], given_for(sums[i])) << i << " " << what;
}

/// Both views alike.
template <typename Disparity, typename Variance>
testing::HostMaps maps_of(shared::ImageSize size, Disparity&& disparity, Variance&& variance) {
  testing::HostMaps maps;
  for (int view = 0; view < 2; ++view) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        maps.disparity.push_back(disparity(x, y));
        maps.variance.push_back(variance(x, y));
      }
    }
  }
  return maps;
}

TEST(OutputVariance, IsTheFiltersToThePowerOneAndAHalfOnAPlane) {
  const shared::ImageSize size{37, 21};
  const auto slanted = [](int x, int y) { return 20 + 0.25f * static_cast<float>(x) - 0.5f * static_cast<float>(y); };
  const testing::HostMaps maps = maps_of(size, slanted, [](int, int) { return 0.25f; });
  const std::vector<float> out =
      output_variance(size, maps, {.scale = 0.5f, .roughness_weight = 100, .jump_weight = 0});
  for (int y = 4; y < size.height - 4; ++y) {  // at the image's edge a slant is no plane: the outside repeats it
    for (int x = 4; x < size.width - 4; ++x)
      ASSERT_FLOAT_EQ(out[y * size.width + x], given_for(0.0625f)) << x << ", " << y;
  }
}

TEST(OutputVariance, GrowsThreePixelsAroundWhatIsNoPlane) {
  const shared::ImageSize size{25, 11};
  const auto step = [](int x, int) { return x < 12 ? 10.0f : 10.75f; };
  const testing::HostMaps maps = maps_of(size, step, [](int, int) { return 1.0f; });
  const std::vector<float> out = output_variance(size, maps, {.scale = 1, .roughness_weight = 1, .jump_weight = 0});
  const float* row = out.data() + static_cast<std::ptrdiff_t>(5) * size.width;
  EXPECT_FLOAT_EQ(row[7], given_for(1));  // columns 11 and 12 have second differences of 0.75
  const auto near = [](float mean) { return given_for(1 + mean * mean); };
  EXPECT_FLOAT_EQ(row[8], near(0.75f / 7));
  EXPECT_FLOAT_EQ(row[9], near(1.5f / 7));
  EXPECT_FLOAT_EQ(row[14], near(1.5f / 7));
  EXPECT_FLOAT_EQ(row[15], near(0.75f / 7));
  EXPECT_FLOAT_EQ(row[16], given_for(1));
}

TEST(OutputVariance, TakesAHoleForRough) {
  const shared::ImageSize size{25, 25};
  const auto is_hole = [](int x, int y) { return x == 12 && y == 12; };
  const testing::HostMaps maps = maps_of(
      size, [&](int x, int y) { return is_hole(x, y) ? kNone : 10.0f; },
      [&](int x, int y) { return is_hole(x, y) ? 0.0f : 1.0f; });
  const std::vector<float> out = output_variance(size, maps, {.scale = 0, .roughness_weight = 1, .jump_weight = 0});
  EXPECT_EQ(out[12 * 25 + 12], 0) << "the hole itself";
  EXPECT_EQ(out[12 * 25 + 7], 0) << "far from it";
  const float mean =
      (2 * reference::kMaxRoughnessPx + 4 * reference::kMaxRoughnessPx) / 49;  // its own, and its neighbours'
  EXPECT_FLOAT_EQ(out[12 * 25 + 11], given_for(mean * mean));
}

TEST(OutputVariance, GrowsTwoPixelsToEitherSideOfAJump) {
  const shared::ImageSize size{25, 9};
  const OutputVarianceOptions only_jumps{.scale = 0, .roughness_weight = 0, .jump_weight = 2};
  const auto middle_row_beside = [&](float disparity, float low, float high) {
    const auto step = [=](int x, int y) { return x == 8 && y == 4 ? disparity : x < 12 ? low : high; };
    const testing::HostMaps maps = maps_of(size, step, [](int, int) { return 1.0f; });
    const std::vector<float> out = output_variance(size, maps, only_jumps);
    return std::vector<float>(out.begin() + 4 * size.width + 9, out.begin() + 4 * size.width + 15);
  };
  expect_given_for({0, 18, 18, 18, 18, 0}, middle_row_beside(10, 10, 13));
  expect_given_for({0, 200, 200, 200, 200, 0}, middle_row_beside(10, 10, 90), "cut at 10 px");
  expect_given_for({0, 0, 0, 0, 0, 0}, middle_row_beside(kNone, 10, 10), "a hole is no jump");
  expect_given_for({0, 32, 0, 0, 0, 0}, middle_row_beside(14, 10, 10), "two to the right of the speck");
}

TEST(OutputVariance, CutsAVarianceThatSaysOnlyThatItIsLarge) {
  const testing::HostMaps maps = maps_of(
      {1, 1}, [](int, int) { return 5.0f; }, [](int, int) { return reference::kDoubtfulVariancePx2; });
  const float most = reference::kMaxMeanVariancePx2;
  EXPECT_FLOAT_EQ(output_variance({1, 1}, maps, {.scale = 1})[0], given_for(most * std::sqrt(most)));
}

TEST(OutputVariance, RestsOnTheMeasurementMoreThanOnTheFilter) {
  const auto row_of = [](float disparity, float variance) {
    return maps_of(
        {9, 1}, [=](int, int) { return disparity; }, [=](int, int) { return variance; });
  };
  const auto expect_mean = [&](float mean, const testing::HostMaps& measured, const char* what) {
    const testing::HostMaps filter = row_of(5, 1.0f / 16);
    const std::vector<float> out = output_variance({9, 1}, filter.disparity, filter, measured, {.scale = 1});
    EXPECT_FLOAT_EQ(out[0], given_for(std::pow(mean, 1.5f))) << what;
  };
  expect_mean(0.5f, row_of(7, 1), "(1/16 * 1^3)^(1/4)");
  const float most = reference::kMaxMeanVariancePx2;
  const float of_the_most = std::pow(most * most * most / 16, 0.25f);
  expect_mean(of_the_most, row_of(7, reference::kDoubtfulVariancePx2), "cut");
  expect_mean(of_the_most, row_of(kNone, 0), "nothing measured");
}

TEST(OutputVariance, RestsOnABeliefThatIsNotPublished) {
  const testing::HostMaps belief{{5, 5, 5, 5, 5, kNone, kNone, kNone, kNone, kNone}, std::vector<float>(10, 0.25f)};
  std::vector<float> output(10, kNone);
  output[4] = 5;
  const OutputVarianceOptions only_filter{.scale = 1, .roughness_weight = 0, .jump_weight = 0};
  EXPECT_FLOAT_EQ(output_variance({5, 1}, output, belief, belief, only_filter)[4], given_for(0.125f));
}

TEST(OutputVariance, KnowsNoSumThatIsTooSmallOrTooLarge) {
  const testing::HostMaps maps = maps_of(
      {1, 1}, [](int, int) { return 5.0f; }, [](int, int) { return 1.0f; });
  const float all = std::numeric_limits<float>::max();
  EXPECT_FLOAT_EQ(output_variance({1, 1}, maps, {.scale = all})[0], 0.36f + 2.52f * std::sqrt(all));
  EXPECT_EQ(output_variance({1, 1}, maps, {.scale = 0})[0], 0);
}

TEST(OutputVariance, DoesNotMixTheViews) {
  // The last rows of the left view lie above the first ones of the right one.
  const testing::HostMaps maps{{5, 5, 5, 90, 90, 90}, {0.25f, 0.25f, 0.25f, 1, 1, 1}};
  expect_given_for({0.125f, 0.125f, 0.125f, 1, 1, 1}, output_variance({1, 3}, maps, {.scale = 1}));
}

}  // namespace
}  // namespace egosgm
