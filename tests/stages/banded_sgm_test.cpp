// SPDX-License-Identifier: Apache-2.0
#include "host/stages/banded_sgm.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <random>

#include "tests/reference/banded_sgm.h"
#include "tests/reference/census.h"
#include "tests/reference/present_rows.h"
#include "tests/reference/step_penalties.h"
#include "tests/support/expect_refused.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::expect_refused;

struct Case {
  shared::ImageSize size;
  shared::DisparityRange range;
  MatchingCost cost = MatchingCost::kCensus5x5;
  int paths = 8;
  bool banded = true;
  Scheduling scheduling = Scheduling::kWavefront;
  std::optional<BandedSgmPaths::Group> group = {};
  BandedSgm::Launches launches = BandedSgm::Launches::kWaves;
  BandedSgm::Tile tile = {};
  bool reads_off = false;
  int patch = 1;  // pixels a side of what has one prediction
  cl_int row_step = 1;
};

std::string name(const ::testing::TestParamInfo<Case>& info) {
  const Case& c = info.param;
  std::string text = std::to_string(c.size.width) + "x" + std::to_string(c.size.height) + "_D" +
                     std::to_string(c.range.count) + "_from" + (c.range.min < 0 ? "minus" : "") +
                     std::to_string(std::abs(c.range.min)) + "_paths" + std::to_string(c.paths);
  if (c.cost == MatchingCost::kSad3x3) text += "_sad";
  if (c.cost == MatchingCost::kCensus9x7) text += "_census9x7";
  text += c.banded ? "_banded" : "_full";
  if (c.patch > 1) text += "_patches" + std::to_string(c.patch);
  if (c.tile.width != BandedSgm::Tile().width) {
    text += "_tiles" + std::to_string(c.tile.width) + "x" + std::to_string(c.tile.height);
  }
  if (c.tile.block_lanes > 0) text += "_blocks" + std::to_string(c.tile.block_lanes);
  if (c.reads_off) text += "_read_off";
  if (c.row_step > 1) text += "_rows" + std::to_string(c.row_step);
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
  const auto width = static_cast<std::size_t>(c.size.width), patch = static_cast<std::size_t>(c.patch);
  for (std::size_t i = 0; i < maps.disparity.size(); ++i) {
    const std::size_t x = i % width, y = i / width, first = (y - y % patch) * width + (x - x % patch);
    maps.disparity[i] = maps.disparity[first];
    maps.variance[i] = maps.variance[first];
  }
  return maps;
}

/// What a match is given and what it gives, by the reference's layout.
struct Match {
  std::vector<std::uint64_t> codes[2];
  std::vector<std::uint16_t> grey;
  std::vector<shared::Band> bands;
  testing::HostMaps measured;
  std::vector<Stripe> stripes;
  shared::DisparityRange range;
  bool reads_off = false;
  cl_int row_step = 1;
  BandedSgmOptions options;
};

Match match(const Case& c, int max_memory_mib = 0) {
  std::mt19937 random(1);
  Match m;
  random_codes(c, random, m.codes);
  for (std::size_t i = 0; i < 2 * pixel_count(c.size); ++i)
    m.grey.push_back(static_cast<std::uint16_t>(random() & 127));

  ocl::Context& context = testing::shared_context();
  const int padding = BandedSgm::code_padding(c.range);
  m.options = {.cost = c.cost, .paths = c.paths, .scheduling = c.scheduling, .max_memory_mib = max_memory_mib};
  SearchBands bands(context, c.size, c.range);
  BandedSgm sgm(context, c.size, c.range, m.options, c.group, c.tile, c.launches);
  const auto padded = reference::padded_codes(c.size, m.codes[0], m.codes[1], padding, c.cost);
  const auto device_codes = testing::on_device<cl_uint>(context, {padded.begin(), padded.end()});
  StereoMaps predicted(context, c.size);
  StereoMaps measured(context, c.size);
  if (c.banded) {
    const testing::HostMaps maps = predictions(c);
    predicted.disparity.write(context, maps.disparity);
    predicted.variance.write(context, maps.variance);
    SearchBand(context, c.size, c.range, {.min_half_width_px = 1}).narrow(predicted, {}, bands, Views::kBoth);
  }
  const auto steps = reference::step_penalties(c.size, m.grey, 8, m.options, c.row_step);
  const auto penalties = testing::on_device<cl_uchar>(context, {steps.begin(), steps.end()});
  const MatchInputs inputs{device_codes, penalties, bands};
  if (c.reads_off) sgm.prepare_reading_off();
  c.reads_off ? sgm.reading_off(inputs, measured, {1, c.row_step}) : sgm.match(inputs, measured, {2, c.row_step});

  m.range = c.range;
  m.reads_off = c.reads_off;
  m.row_step = c.row_step;
  m.bands = bands.bands.read(context);
  m.measured = testing::download(context, measured);
  m.stripes = sgm.stripes();
  return m;
}

class BandedSgmTest : public ::testing::TestWithParam<Case> {};

/// Whether the device's compiler refuses blocks of so many lanes by name (kernels/sgm/block.h).
bool refuses_blocks(const Case& c) {
  try {
    match({.size = {1, 1}, .range = {0, 1}, .tile = c.tile});
    return false;
  } catch (const DeviceError& error) {
    return std::string(error.what()).find("BLOCK: 16") != std::string::npos;
  }
}

TEST_P(BandedSgmTest, EqualsReference) {
  const Case c = GetParam();
  if (c.tile.block_lanes > 16 && refuses_blocks(c)) GTEST_SKIP() << "the compiler has no vectors of 32 lanes";
  const Match m = match(c);
  ASSERT_EQ(m.stripes.size(), 1u);
  const auto expected =
      reference::banded_sgm(c.size, m.range, m.options, m.codes, m.grey, m.bands, m.reads_off, m.row_step);
  EXPECT_TRUE(testing::same_maps(reference::without_absent_rows(c.size, m.row_step, m.measured), expected, c.size));
}

/// `rows` rows of every one of `planes` planes, from `first` on.
template <typename T>
std::vector<T> rows_of(const std::vector<T>& values, int planes, shared::ImageSize size, int first, int rows) {
  std::vector<T> taken;
  for (int plane = 0; plane < planes; ++plane) {
    const auto begin = values.begin() + (static_cast<std::ptrdiff_t>(plane) * size.height + first) * size.width;
    taken.insert(taken.end(), begin, begin + static_cast<std::ptrdiff_t>(rows) * size.width);
  }
  return taken;
}

/// The rows that are kept of what the reference makes of each stripe, as if it were the image.
testing::HostMaps stripe_by_stripe(const Match& m, shared::ImageSize size) {
  testing::HostMaps expected = m.measured;
  for (const Stripe& stripe : m.stripes) {
    const auto cut = [&](const auto& values, int planes) {
      return rows_of(values, planes, size, stripe.first_row, stripe.rows);
    };
    const std::vector<std::uint64_t> codes[2] = {cut(m.codes[0], 1), cut(m.codes[1], 1)};
    const auto maps = reference::banded_sgm({size.width, stripe.rows}, m.range, m.options, codes, cut(m.grey, 2),
                                            cut(m.bands, 2), m.reads_off, m.row_step);
    for (int view = 0; view < 2; ++view) {
      const std::ptrdiff_t kept = static_cast<std::ptrdiff_t>(stripe.kept_end - stripe.kept_begin) * size.width;
      const std::ptrdiff_t to = (static_cast<std::ptrdiff_t>(view) * size.height + stripe.kept_begin) * size.width;
      const std::ptrdiff_t from =
          (static_cast<std::ptrdiff_t>(view) * stripe.rows + stripe.kept_begin - stripe.first_row) * size.width;
      std::copy_n(maps.disparity.begin() + from, kept, expected.disparity.begin() + to);
      std::copy_n(maps.variance.begin() + from, kept, expected.variance.begin() + to);
    }
  }
  return expected;
}

/// Whether stripes are no higher than their number asks for.
void expect_few_rows(const std::vector<Stripe>& stripes, int height) {
  int rows = 0;
  for (const Stripe& stripe : stripes) rows += stripe.rows;
  EXPECT_LE(rows, height + static_cast<int>(stripes.size()) * (2 * BandedSgm::kStripeOverlap + 3));
}

TEST(BandedSgmStripes, EqualTheReferenceOfEach) {
  for (const Scheduling scheduling : {Scheduling::kWavefront, Scheduling::kPaths}) {
    for (const MatchingCost cost : {MatchingCost::kCensus5x5, MatchingCost::kSad3x3}) {
      const bool reads_off = cost == MatchingCost::kSad3x3;
      const Case c{.size = {61, 301},
                   .range = {-5, 37},
                   .cost = cost,
                   .scheduling = scheduling,
                   .launches = reads_off ? BandedSgm::Launches::kWaves : BandedSgm::Launches::kSweepsOfAView,
                   .reads_off = reads_off,
                   .row_step = 2};
      const Match m = match(c, scheduling == Scheduling::kPaths ? 4 : 2);
      ASSERT_GE(m.stripes.size(), 3u);
      expect_few_rows(m.stripes, c.size.height);
      const auto present = [&](const testing::HostMaps& maps) {
        return reference::without_absent_rows(c.size, m.row_step, maps);
      };
      EXPECT_TRUE(testing::same_maps(present(m.measured), present(stripe_by_stripe(m, c.size)), c.size));
    }
  }
}

TEST(BandedSgmStripes, OfPathsAreThoseOfEveryDevice) {
  ocl::Context& context = testing::shared_context();
  const BandedSgmOptions options{.scheduling = Scheduling::kPaths, .max_memory_mib = 18};
  EXPECT_EQ(BandedSgm(context, {200, 224}, {0, 64}, options).stripes().front().rows, 110);
}

TEST(BandedSgmStripes, TooLittleMemoryForOneNamesTheLimit) {
  expect_refused<InvalidArgument>(
      [] {
        match({.size = {640, 120}, .range = {0, 1024}}, 7);
      },
      {"BandedSgm", "96 rows", "max_memory_mib allows 7 MiB: raise it to ", "fewer disparities"});
}

TEST(BandedSgmPathsGroup, LargerThanTheDeviceAllowsNamesTheLimit) {
  const std::size_t limit = testing::shared_context().max_work_group_size();
  const int lines = static_cast<int>(limit / 16) + 1;
  const Case c{.size = {9, 5}, .range = {0, 16}, .scheduling = Scheduling::kPaths, .group = {{16, lines}}};
  expect_refused<DeviceError>([&] { match(c); }, {"BandedSgm: kernel follow_paths", std::to_string(16 * lines),
                                                  "the device allows ", "--tuning none"});
}

TEST(BandedSgmStripes, MatchFewRowsTwice) {
  constexpr int kOverlap = BandedSgm::kStripeOverlap;
  for (const int height : {97, 301, 1080, 2160}) {
    EXPECT_EQ(fewest_rows(height, height, kOverlap), height);
    for (const int most : {96, 97, 301, 600, 1079, 2050}) {
      if (most >= height) continue;
      const int rows = fewest_rows(height, most, kOverlap), even_most = most - (height - most) % 2;
      EXPECT_EQ((height - rows) % 2, 0);
      const std::vector<Stripe> stripes = cut_into_stripes(height, rows, kOverlap);
      EXPECT_LE(rows, most);
      EXPECT_LE(stripes.size(), cut_into_stripes(height, even_most, kOverlap).size());
      expect_few_rows(stripes, height);
    }
  }
}

TEST(BandedSgmStripes, CoverTheImageWithRowsAround) {
  for (const int height : {1, 95, 96, 97, 128, 375, 1080, 2160}) {
    for (const int rows : {96, 97, 130, 2160}) {
      const int matched = rows < height ? rows - (height - rows) % 2 : height, overlap = BandedSgm::kStripeOverlap;
      int next = 0;
      for (const Stripe& stripe : cut_into_stripes(height, matched, overlap)) {
        EXPECT_EQ(stripe.kept_begin, next);
        EXPECT_LT(stripe.kept_begin, stripe.kept_end);
        EXPECT_EQ(stripe.rows, matched);
        EXPECT_GE(stripe.first_row, 0);
        EXPECT_EQ(stripe.first_row % 2, 0);
        EXPECT_LE(stripe.first_row, std::max(0, stripe.kept_begin - overlap));
        EXPECT_LE(stripe.first_row + stripe.rows, height);
        EXPECT_GE(stripe.first_row + stripe.rows, std::min(height, stripe.kept_end + overlap));
        next = stripe.kept_end;
      }
      EXPECT_EQ(next, height);
    }
  }
}

const std::vector<Case> kBanded{
    {{1, 1}, {0, 1}},
    {{1, 1}, {0, 128}},
    {{7, 5}, {0, 16}},
    {{7, 5}, {-3, 37}},
    {{65, 3}, {0, 37}},
    {{3, 65}, {0, 16}},
    {{127, 33}, {0, 1}},
    {{127, 33}, {-2, 5}},
    {{127, 33}, {0, 8}},
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
    {.size = {127, 33}, .range = {0, 128}, .patch = 12},
    {.size = {127, 33}, .range = {0, 24}, .patch = 8},
    {.size = {127, 33}, .range = {0, 128}, .cost = MatchingCost::kCensus9x7, .patch = 16},
    {.size = {127, 33}, .range = {-9, 77}, .paths = 4, .patch = 5},
    {.size = {127, 33}, .range = {0, 96}, .cost = MatchingCost::kCensus9x7, .paths = 4, .patch = 20}};

const std::vector<Case> kFullRange{{.size = {1, 1}, .range = {0, 16}, .banded = false},
                                   {.size = {65, 3}, .range = {-9, 37}, .banded = false},
                                   {.size = {127, 33}, .range = {0, 1}, .banded = false},
                                   {.size = {127, 97}, .range = {0, 128}, .banded = false},
                                   {.size = {320, 97}, .range = {0, 16}, .banded = false},
                                   {.size = {127, 33}, .range = {0, 64}, .paths = 4, .banded = false}};

template <typename... Changes>
std::vector<Case> changed(std::vector<Case> cases, Changes... changes) {
  for (Case& c : cases) (changes(c), ...);
  return cases;
}

void along_paths(Case& c) { c.scheduling = Scheduling::kPaths; }
void read_off(Case& c) { c.reads_off = true; }
void in_few_rows(Case& c) { c.row_step = c.size.width % 2 == 0 ? 2 : 3; }
void whole_sweeps(Case& c) { c.launches = BandedSgm::Launches::kSweeps; }
void view_by_view(Case& c) { c.launches = BandedSgm::Launches::kSweepsOfAView; }

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

/// Several tiles a row, a column and a wave in an image that is small enough for oclgrind, which looks for races.
std::vector<Case> in_small_tiles() {
  std::vector<Case> cases;
  for (const BandedSgm::Tile tile : {BandedSgm::Tile{7, 3}, {9, 4}, {5, 5}}) {
    for (const bool banded : {false, true}) {
      for (const int disparities : {32, 37}) {
        cases.push_back({.size = {31, 23}, .range = {0, disparities}, .banded = banded, .tile = tile});
      }
    }
  }
  return cases;
}

/// Blocks of either width, whatever suits the compiler: ranges of an even and of an odd number of vectors, whole or
/// not.
std::vector<Case> in_blocks() {
  std::vector<Case> cases;
  for (const int lanes : {16, 32}) {
    for (const Case& c : {Case{.size = {33, 21}, .range = {0, 128}},
                          {.size = {33, 21}, .range = {-20, 37}, .reads_off = true},
                          {.size = {33, 21}, .range = {-9, 37}, .banded = false},
                          {.size = {33, 21}, .range = {0, 48}, .cost = MatchingCost::kSad3x3, .paths = 4},
                          {.size = {33, 21}, .range = {-40, 48}, .cost = MatchingCost::kCensus9x7, .banded = false},
                          {.size = {33, 21}, .range = {0, 100}, .banded = false, .reads_off = true},
                          {.size = {24, 21}, .range = {0, 1024}}}) {
      cases.push_back(c);
      cases.back().tile.block_lanes = lanes;
    }
  }
  return cases;
}

using ::testing::ValuesIn;
INSTANTIATE_TEST_SUITE_P(Banded, BandedSgmTest, ValuesIn(kBanded), name);
INSTANTIATE_TEST_SUITE_P(Large, BandedSgmTest, ::testing::Values(Case{testing::kLargest, {0, 128}}), name);
INSTANTIATE_TEST_SUITE_P(FullRange, BandedSgmTest, ValuesIn(kFullRange), name);
INSTANTIATE_TEST_SUITE_P(BandedSweeps, BandedSgmTest, ValuesIn(changed(kBanded, whole_sweeps)), name);
INSTANTIATE_TEST_SUITE_P(FullRangeSweeps, BandedSgmTest, ValuesIn(changed(kFullRange, whole_sweeps)), name);
INSTANTIATE_TEST_SUITE_P(SmallTiles, BandedSgmTest, ValuesIn(in_small_tiles()), name);
INSTANTIATE_TEST_SUITE_P(SmallTilesSweeps, BandedSgmTest, ValuesIn(changed(in_small_tiles(), whole_sweeps)), name);
INSTANTIATE_TEST_SUITE_P(BandedViewByView, BandedSgmTest, ValuesIn(changed(kBanded, view_by_view)), name);
INSTANTIATE_TEST_SUITE_P(FullRangeViewByView, BandedSgmTest, ValuesIn(changed(kFullRange, view_by_view)), name);
INSTANTIATE_TEST_SUITE_P(Blocks, BandedSgmTest, ValuesIn(in_blocks()), name);
INSTANTIATE_TEST_SUITE_P(BandedPaths, BandedSgmTest, ValuesIn(changed(kBanded, along_paths)), name);
INSTANTIATE_TEST_SUITE_P(FullRangePaths, BandedSgmTest, ValuesIn(changed(kFullRange, along_paths)), name);
INSTANTIATE_TEST_SUITE_P(ReadOff, BandedSgmTest, ValuesIn(changed(kBanded, read_off)), name);
INSTANTIATE_TEST_SUITE_P(ReadOffFullRange, BandedSgmTest, ValuesIn(changed(kFullRange, read_off)), name);
INSTANTIATE_TEST_SUITE_P(ReadOffSweeps, BandedSgmTest, ValuesIn(changed(kBanded, read_off, whole_sweeps)), name);
INSTANTIATE_TEST_SUITE_P(ReadOffViewByView, BandedSgmTest, ValuesIn(changed(kBanded, read_off, view_by_view)), name);
INSTANTIATE_TEST_SUITE_P(ReadOffSmallTiles, BandedSgmTest, ValuesIn(changed(in_small_tiles(), read_off)), name);
INSTANTIATE_TEST_SUITE_P(ReadOffPaths, BandedSgmTest, ValuesIn(changed(kBanded, read_off, along_paths)), name);
INSTANTIATE_TEST_SUITE_P(ReadOffGroupedPaths, BandedSgmTest, ValuesIn(changed(in_groups(), read_off)), name);
INSTANTIATE_TEST_SUITE_P(FewRows, BandedSgmTest, ValuesIn(changed(kBanded, in_few_rows)), name);
INSTANTIATE_TEST_SUITE_P(FewRowsSweeps, BandedSgmTest, ValuesIn(changed(kBanded, in_few_rows, whole_sweeps)), name);
INSTANTIATE_TEST_SUITE_P(FewRowsViewByView, BandedSgmTest, ValuesIn(changed(kBanded, in_few_rows, view_by_view)), name);
INSTANTIATE_TEST_SUITE_P(FewRowsSmallTiles, BandedSgmTest, ValuesIn(changed(in_small_tiles(), in_few_rows)), name);
INSTANTIATE_TEST_SUITE_P(FewRowsPaths, BandedSgmTest, ValuesIn(changed(kBanded, in_few_rows, along_paths)), name);
INSTANTIATE_TEST_SUITE_P(FewRowsGroupedPaths, BandedSgmTest, ValuesIn(changed(in_groups(), in_few_rows)), name);
INSTANTIATE_TEST_SUITE_P(ReadOffFewRows, BandedSgmTest, ValuesIn(changed(changed(kBanded, read_off), in_few_rows)),
                         name);
INSTANTIATE_TEST_SUITE_P(ReadOffFewRowsPaths, BandedSgmTest,
                         ValuesIn(changed(changed(changed(kBanded, read_off), in_few_rows), along_paths)), name);
INSTANTIATE_TEST_SUITE_P(GroupedPaths, BandedSgmTest, ValuesIn(in_groups()), name);

}  // namespace
}  // namespace egosgm
