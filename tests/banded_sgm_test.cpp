// SPDX-License-Identifier: Apache-2.0
#include "host/banded_sgm.h"

#include <gtest/gtest.h>

#include <optional>
#include <random>

#include "tests/reference/banded_sgm.h"
#include "tests/reference/census.h"
#include "tests/reference/step_penalties.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace egosgm {
namespace {

struct Case {
  shared::ImageSize size;
  shared::DisparityRange range;
  MatchingCost cost = MatchingCost::kPairs32;
  int paths = 8;
  bool banded = true;
  Scheduling scheduling = Scheduling::kWavefront;
  std::optional<BandedSgmPaths::Group> group = {};
};

std::string name(const ::testing::TestParamInfo<Case>& info) {
  const Case& c = info.param;
  std::string text = std::to_string(c.size.width) + "x" + std::to_string(c.size.height) + "_D" +
                     std::to_string(c.range.count) + "_from" + (c.range.min < 0 ? "minus" : "") +
                     std::to_string(std::abs(c.range.min)) + "_paths" + std::to_string(c.paths);
  if (c.cost == MatchingCost::kSad3x3) text += "_sad";
  if (c.cost == MatchingCost::kCensus9x7) text += "_census9x7";
  text += c.banded ? "_banded" : "_full";
  if (c.group) text += "_lanes" + std::to_string(c.group->lanes) + "_lines" + std::to_string(c.group->lines);
  return text;
}

/// Codes with some structure: the right view's are the left's, shifted by a few pixels, with noise.
void random_codes(const Case& c, std::mt19937& random, std::vector<std::uint64_t> (&codes)[2]) {
  const bool sad = c.cost == MatchingCost::kSad3x3;
  const std::uint64_t bits = c.cost == MatchingCost::kCensus9x7 ? (1ull << 62) - 1 : 0xffffffffu;
  const auto code = [&] {
    return sad ? random() & 255 : (std::uint64_t{random()} << 32 | random()) & random() * 0x100000001ull & bits;
  };
  const std::size_t pixels = pixel_count(c.size);
  for (std::size_t i = 0; i < pixels; ++i) codes[0].push_back(code());
  for (std::size_t i = 0; i < pixels; ++i) {
    const std::size_t shift = c.range.min + static_cast<int>(i / 50 % std::max(1, c.range.count));
    codes[1].push_back(random() % 4 ? codes[0][(i + shift) % pixels] : code());
  }
}

/// Half-banded predictions: smooth, with jumps and holes, so that bands of all widths meet.
testing::HostMaps predictions(const Case& c) {
  const float min = static_cast<float>(c.range.min), max = static_cast<float>(c.range.min + c.range.count - 1);
  testing::HostMaps maps = testing::random_maps(c.size, min, max, 0.1, 5);
  for (float& p : maps.variance) p = std::min(p, 1.5f);
  return maps;
}

class BandedSgmTest : public ::testing::TestWithParam<Case> {};

TEST_P(BandedSgmTest, EqualsReference) {
  const Case c = GetParam();
  std::mt19937 random(1);
  std::vector<std::uint64_t> codes[2];
  random_codes(c, random, codes);
  std::vector<std::uint16_t> grey;
  for (std::size_t i = 0; i < 2 * pixel_count(c.size); ++i) grey.push_back(static_cast<std::uint16_t>(random() & 127));

  ocl::Context context(testing::any_device());
  const int padding = BandedSgm::code_padding(c.range);
  const BandedSgmOptions options{.cost = c.cost, .paths = c.paths, .scheduling = c.scheduling};
  SearchBand band(context, c.size, c.range, {.min_half_width_px = 1});
  BandedSgm sgm(context, c.size, c.range, options, c.group);
  const auto padded = reference::padded_codes(c.size, codes[0], codes[1], padding, c.cost);
  ocl::Buffer<cl_uint> device_codes(context, padded.size());
  device_codes.write(context, {padded.begin(), padded.end()});
  StereoMaps predicted(context, c.size), measured(context, c.size);
  if (c.banded) {
    const testing::HostMaps maps = predictions(c);
    predicted.disparity.write(context, maps.disparity);
    predicted.variance.write(context, maps.variance);
    band(predicted);
  } else {
    band.full_range();
  }
  const auto planes = reference::step_penalties(c.size, grey, 8, options);
  ocl::Buffer<cl_uchar> penalties(context, planes.size());
  penalties.write(context, {planes.begin(), planes.end()});
  sgm(device_codes, penalties, band, measured);

  const shared::SgmParameters parameters{c.size.width,
                                         c.size.height,
                                         c.range.min,
                                         c.range.count,
                                         padding,
                                         options.p1,
                                         options.s_max,
                                         options.variance_floor_px2,
                                         options.variance_per_step_px2,
                                         options.variance_per_square_px2};
  const auto expected = reference::banded_sgm(parameters, options, codes, grey, band.bands().read(context));
  EXPECT_TRUE(testing::same_bits(measured.disparity.read(context), expected.disparity, c.size));
  EXPECT_TRUE(testing::same_bits(measured.variance.read(context), expected.variance, c.size));
}

const std::vector<Case> kBanded{{{1, 1}, {0, 1}},
                                {{1, 1}, {0, 128}},
                                {{7, 5}, {0, 16}},
                                {{7, 5}, {-3, 37}},
                                {{65, 3}, {0, 37}},
                                {{3, 65}, {0, 16}},
                                {{127, 33}, {0, 1}},
                                {{127, 33}, {0, 16}},
                                {{127, 33}, {-20, 37}},
                                {{127, 97}, {0, 128}},
                                {{127, 97}, {0, 128}, MatchingCost::kCensus9x7},
                                {{127, 33}, {0, 128}, MatchingCost::kSad3x3},
                                {{127, 33}, {-7, 37}, MatchingCost::kCensus9x7, 4},
                                {{127, 33}, {0, 64}, MatchingCost::kSad3x3, 4},
                                {{320, 97}, {0, 37}},
                                {{320, 97}, {-50, 128}},
                                {{40, 30}, {0, 1024}},
                                {{1242, 375}, {0, 128}}};

const std::vector<Case> kFullRange{{.size = {1, 1}, .range = {0, 16}, .banded = false},
                                   {.size = {65, 3}, .range = {-9, 37}, .banded = false},
                                   {.size = {127, 33}, .range = {0, 1}, .banded = false},
                                   {.size = {127, 97}, .range = {0, 128}, .banded = false},
                                   {.size = {320, 97}, .range = {0, 16}, .banded = false},
                                   {.size = {127, 33}, .range = {0, 64}, .paths = 4, .banded = false}};

/// The same cases along paths; the largest is left to the wavefronts, work-items of a CPU being slow at this.
std::vector<Case> along_paths(const std::vector<Case>& cases) {
  std::vector<Case> found;
  for (Case c : cases) {
    if (pixel_count(c.size) > 100000) continue;
    c.scheduling = Scheduling::kPaths;
    found.push_back(c);
  }
  return found;
}

/// Groups of other shapes than the default: single work-items, paths that do not share out evenly, more lanes than
/// quads, a minimum in one, two and three steps.
std::vector<Case> in_groups() {
  std::vector<Case> cases;
  for (const auto& [lanes, lines] : {std::pair{1, 1}, {1, 5}, {2, 3}, {16, 1}, {32, 2}, {128, 1}}) {
    for (const shared::DisparityRange range : {shared::DisparityRange{-3, 37}, {0, 128}}) {
      for (const shared::ImageSize size : {shared::ImageSize{7, 5}, {50, 21}}) {
        cases.push_back({.size = size, .range = range, .scheduling = Scheduling::kPaths, .group = {{lanes, lines}}});
      }
    }
  }
  return cases;
}

using ::testing::ValuesIn;
INSTANTIATE_TEST_SUITE_P(Banded, BandedSgmTest, ValuesIn(kBanded), name);
INSTANTIATE_TEST_SUITE_P(FullRange, BandedSgmTest, ValuesIn(kFullRange), name);
INSTANTIATE_TEST_SUITE_P(BandedPaths, BandedSgmTest, ValuesIn(along_paths(kBanded)), name);
INSTANTIATE_TEST_SUITE_P(FullRangePaths, BandedSgmTest, ValuesIn(along_paths(kFullRange)), name);
INSTANTIATE_TEST_SUITE_P(GroupedPaths, BandedSgmTest, ValuesIn(in_groups()), name);

}  // namespace
}  // namespace egosgm
