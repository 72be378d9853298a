// SPDX-License-Identifier: Apache-2.0
#include "host/stages/search_band.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "host/frame/frame_transfer.h"
#include "tests/reference/present_rows.h"
#include "tests/reference/search_band.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::HostMaps;
using testing::same_bits;

constexpr shared::DisparityRange kRanges[] = {{0, 1}, {0, 16}, {-20, 37}, {0, 128}, {3, 1027}};

using Ends = std::pair<int, int>;
Ends ends(const shared::Band& band) { return {band.first, band.last}; }

reference::SearchBands read(ocl::Context& context, const SearchBands& bands) {
  return {bands.bands.read(context), bands.cell_offsets.read(context), bands.row_sums.read(context)};
}

reference::SearchBands run(shared::ImageSize size, shared::DisparityRange range, const SearchBandOptions& options,
                           const HostMaps& maps, int row_group = 0, const std::vector<float>& coarse = {},
                           Views views = Views::kBoth) {
  ocl::Context& context = testing::shared_context();
  SearchBand stage(context, size, range, options, row_group);
  StereoMaps predicted(context, size);
  predicted.disparity.write(context, maps.disparity);
  predicted.variance.write(context, maps.variance);
  StereoMaps found(context, {(size.width + 3) / 4, (size.height + 3) / 4});
  if (!coarse.empty()) found.disparity.write(context, coarse);
  SearchBands bands(context, size, range);
  stage.narrow(predicted, coarse.empty() ? nullptr : &found.disparity, bands, views);
  return read(context, bands);
}

void expect_same(const reference::SearchBands& actual, const reference::SearchBands& expected, shared::ImageSize size) {
  EXPECT_TRUE(same_bits(actual.bands, expected.bands, size));
  EXPECT_TRUE(same_bits(actual.cell_offsets, expected.cell_offsets, size));
  EXPECT_TRUE(same_bits(actual.row_sums, expected.row_sums, {1, size.height}));
}

EGOSGM_TEST_AT_ALL_SIZES(SearchBandTest);

TEST_P(SearchBandTest, EqualsReference) {
  const shared::ImageSize size = GetParam(), quarter{(size.width + 3) / 4, (size.height + 3) / 4};
  const SearchBandOptions alone{.sigmas = 1.5f, .min_half_width_px = 0.0f, .from_neighbours = false};
  const SearchBandOptions tolerant{.coarse_tolerance_px = 1.25f, .coarse_margin_px = 0.5f};
  for (const shared::DisparityRange range : kRanges) {
    SCOPED_TRACE("min " + std::to_string(range.min) + ", count " + std::to_string(range.count));
    // Some predictions lie outside of the range, as a warp can leave them.
    const float min = static_cast<float>(range.min), end = static_cast<float>(range.min + range.count);
    const auto maps = testing::random_maps(size, min - 3, end + 3, 0.6, 31);
    const auto coarse = testing::random_maps(quarter, min / 4, end / 4, 0.3, 36).disparity;
    const auto expected = reference::search_band(size, range, {}, maps);
    for (const int row_group : {0, 1, 7, 64}) expect_same(run(size, range, {}, maps, row_group), expected, size);
    expect_same(run(size, range, alone, maps), reference::search_band(size, range, alone, maps), size);
    expect_same(run(size, range, tolerant, maps, 0, coarse),
                reference::search_band(size, range, tolerant, maps, coarse), size);
  }
}

TEST_P(SearchBandTest, EqualsReferenceWithEverySecondRow) {
  const shared::ImageSize size = GetParam();
  const SearchBandOptions options{.neighbour_min_count = 60};
  const auto maps = testing::random_maps(size, 0, 127, 0.7, 37);
  const auto present = [&](const reference::SearchBands& bands) {
    return reference::SearchBands{reference::without_absent_rows(size, 2, bands.bands, {}),
                                  reference::without_absent_rows(size, 2, bands.cell_offsets, 0u),
                                  reference::without_absent_rows({1, size.height}, 2, bands.row_sums, {})};
  };
  const auto expected = present(reference::search_band(size, {0, 128}, options, maps, {}, /*row_step=*/2));
  for (const int row_group : {1, 64}) {
    expect_same(present(run(size, {0, 128}, options, maps, row_group, {}, {2, 2})), expected, size);
  }
}

TEST_P(SearchBandTest, FullRangeEqualsReference) {
  const shared::ImageSize size = GetParam();
  for (const shared::DisparityRange range : kRanges) {
    ocl::Context& context = testing::shared_context();
    SearchBands bands(context, size, range);
    EXPECT_TRUE(same_bits(bands.bands.read(context), reference::full_range(size, range).bands, size));
    EXPECT_TRUE(same_bits(bands.cell_offsets.read(context), reference::full_range(size, range).cell_offsets, size));
    bands.bands.fill(context, {0, 1, 0, 0});
    SearchBand(context, size, range, {}).full_range(bands, Views::kBoth);
    expect_same(read(context, bands), reference::full_range(size, range), size);
  }
}

TEST_P(SearchBandTest, SearchesTheLeftViewAlone) {
  const shared::ImageSize size = GetParam(), quarter{(size.width + 3) / 4, (size.height + 3) / 4};
  ocl::Context& context = testing::shared_context();
  const StereoMaps predicted = testing::upload(context, size, testing::random_maps(size, -5, 122, 0.6, 40));
  const StereoMaps coarse = testing::upload(context, quarter, testing::random_maps(quarter, -1, 30, 0.3, 42));
  const StereoMaps earlier = testing::upload(context, size, testing::random_maps(size, -5, 122, 0.6, 43));
  for (const int row_group : {1, 64}) {
    SearchBand stage(context, size, {-5, 128}, {}, row_group);
    SearchBands bands(context, size, {-5, 128});
    const std::function<void(Views)> ways[] = {
        [&](Views views) { stage.narrow(predicted, &coarse.disparity, bands, views); },
        [&](Views views) { stage.full_range(bands, views); },
        [&](Views views) { stage.full_range(predicted.disparity, bands, views); },
    };
    for (const auto& search : ways) {
      search(Views::kBoth);
      const reference::SearchBands both = read(context, bands);
      stage.narrow(earlier, nullptr, bands, Views::kBoth);
      const reference::SearchBands before = read(context, bands);
      search(Views::kLeft);
      expect_same(read(context, bands),
                  {testing::left_and_right(both.bands, before.bands),
                   testing::left_and_right(both.cell_offsets, before.cell_offsets),
                   testing::left_and_right(both.row_sums, before.row_sums)},
                  size);
    }
  }
}

TEST(SearchBand, PredictedPixelSearchesItsDeviations) {
  const shared::ImageSize size{2, 1};
  auto maps = testing::empty_maps(size);
  maps.disparity[0] = 40.25f, maps.variance[0] = 4.0f;  // +- 3 * 2
  maps.disparity[1] = 60.5f, maps.variance[1] = 0.01f;  // +- the minimum
  const auto bands = run(size, {0, 128}, {.sigmas = 3, .min_half_width_px = 2, .from_neighbours = false}, maps).bands;
  EXPECT_EQ(ends(bands[0]), (Ends{34, 47}));  // 34.25, 46.25
  EXPECT_EQ(ends(bands[1]), (Ends{58, 63}));  // 58.5, 62.5
  EXPECT_EQ(bands[1].chunks, 1);
  EXPECT_EQ(bands[1].origin, 57);  // one of two spare lanes below
}

TEST(SearchBand, AbsurdVarianceSearchesEverything) {
  const shared::ImageSize size{4, 1};
  auto maps = testing::empty_maps(size);
  for (int x = 0; x < 3; ++x) maps.disparity[x] = 10;
  maps.variance = {1e30f, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN(), 0, 0, 0, 0,
                   0};
  const auto bands = run(size, {-8, 100}, {}, maps).bands;
  for (int x = 0; x < 3; ++x) EXPECT_EQ(ends(bands[x]), (Ends{-8, 91})) << x;
}

TEST(SearchBand, UnpredictedPixelSearchesWhatItsNeighboursSpan) {
  const shared::ImageSize size{64, 64};
  auto maps = testing::empty_maps(size);
  for (int x = 16; x < 32; ++x) maps.disparity[20 * 64 + x] = x == 20 ? 50.5f : 40.25f;
  const SearchBandOptions options{.neighbour_min_count = 8, .neighbour_margin_px = 4};
  const auto bands = run(size, {0, 128}, options, maps).bands;
  EXPECT_EQ(ends(bands[25 * 64 + 24]), (Ends{36, 55}));
  EXPECT_EQ(bands[25 * 64 + 24].chunks, 4);
  EXPECT_EQ(bands[40 * 64 + 24].last - bands[40 * 64 + 24].first, 127) << "two blocks below: none near";
  EXPECT_EQ(ends(bands[25 * 64 + 32]), (Ends{36, 45})) << "beside the block of x 24..31";
  EXPECT_EQ(bands[4096 + 25 * 64 + 24].last, 127) << "the right view has no predictions";

  maps.disparity[20 * 64 + 31] = EGOSGM_INVALID_DISPARITY;  // seven left around (32, 25)
  EXPECT_EQ(run(size, {0, 128}, options, maps).bands[25 * 64 + 32].last, 127);
}

TEST(SearchBand, ReachesWhatTheCoarseMatchFoundElsewhere) {
  const shared::ImageSize size{64, 64};
  auto maps = testing::empty_maps(size);
  maps.disparity[20 * 64 + 20] = 40, maps.disparity[20 * 64 + 60] = 40;
  std::vector<float> coarse(2 * 16 * 16, EGOSGM_INVALID_DISPARITY);
  for (int v = 3; v <= 6; ++v) {
    for (int u = 3; u <= 6; ++u) coarse[v * 16 + u] = 20;  // 80 px, around the block of (16..23, 16..23) alone
  }
  const SearchBandOptions options{
      .min_half_width_px = 2, .neighbour_min_count = 1, .coarse_tolerance_px = 3, .coarse_margin_px = 2};
  const auto bands = run(size, {0, 128}, options, maps, 0, coarse).bands;
  EXPECT_EQ(ends(bands[20 * 64 + 20]), (Ends{38, 82}));
  EXPECT_EQ(bands[20 * 64 + 60].last, 42) << "nothing was found there";
  EXPECT_EQ(ends(bands[20 * 64 + 21]), (Ends{36, 82})) << "unpredicted: what is predicted around and what was found";
  EXPECT_EQ(bands[44 * 64 + 20].last, 127) << "nothing is predicted around";
  EXPECT_EQ(bands[4096 + 20 * 64 + 20].last, 127) << "the right view";

  const SearchBandOptions two{.neighbour_min_count = 2};
  EXPECT_EQ(run(size, {0, 128}, two, maps, 0, coarse).bands[20 * 64 + 21].first, 0) << "too few are predicted around";

  // Two of the coarse pixels that stand out are mismatches, three are not.
  coarse[3 * 16 + 3] = 30, coarse[4 * 16 + 6] = 31;
  EXPECT_EQ(run(size, {0, 128}, options, maps, 0, coarse).bands[20 * 64 + 20].last, 82);
  coarse[6 * 16 + 4] = 29;
  EXPECT_EQ(run(size, {0, 128}, options, maps, 0, coarse).bands[20 * 64 + 20].last, 118);

  for (float& d : coarse) d = d > 0 ? 11.2f : d;  // 44.8: within 3 px of what is searched anyway
  EXPECT_EQ(run(size, {0, 128}, options, maps, 0, coarse).bands[20 * 64 + 20].last, 42);
  for (float& d : coarse) d = d > 0 ? 11.3f : d;
  EXPECT_EQ(run(size, {0, 128}, options, maps, 0, coarse).bands[20 * 64 + 20].last, 48);

  const auto first = [&] { return run(size, {0, 128}, options, maps, 0, coarse).bands[20 * 64 + 20].first; };
  for (float& d : coarse) d = d > 0 ? 9.5f : d;  // 38: with 3 px farther, within 3 px of what is searched anyway
  EXPECT_EQ(first(), 38);
  for (float& d : coarse) d = d > 0 ? 9.25f : d;
  EXPECT_EQ(first(), 32) << "37, 3 px farther, and the margin";
  for (int u = 3; u <= 5; ++u) coarse[3 * 16 + u] = 10.5f;
  EXPECT_EQ(first(), 38) << "37 and 42 are two surfaces";
}

// Beside a jump a prediction may lie on the wrong side of it.
TEST(SearchBand, PredictedPixelReachesWhatItsBlockSpans) {
  const shared::ImageSize size{24, 8};
  auto maps = testing::empty_maps(size);
  for (int x = 8; x < 24; ++x) maps.disparity[3 * 24 + x] = x < 12 ? 40 : 60;
  const SearchBandOptions options{.min_half_width_px = 2, .coarse_tolerance_px = 3, .coarse_margin_px = 1};
  const auto bands = run(size, {0, 128}, options, maps).bands;
  EXPECT_EQ(ends(bands[3 * 24 + 8]), (Ends{38, 61}));
  EXPECT_EQ(ends(bands[3 * 24 + 15]), (Ends{39, 62}));
  EXPECT_EQ(bands[3 * 24 + 16].first, 58) << "the block beside";
  for (int x = 8; x < 12; ++x) maps.disparity[3 * 24 + x] = 55;  // within 3 px of what is searched anyway
  EXPECT_EQ(run(size, {0, 128}, options, maps).bands[3 * 24 + 15].first, 58);
  for (int x = 8; x < 12; ++x) maps.disparity[3 * 24 + x] = 54.875f;
  EXPECT_EQ(run(size, {0, 128}, options, maps).bands[3 * 24 + 15].first, 53);
}

// Where the frame before lost the upper part of a pole.
TEST(SearchBand, PredictedPixelReachesAThinThingFarBelow) {
  const shared::ImageSize size{72, 160};
  const SearchBandOptions options{.min_half_width_px = 2, .coarse_tolerance_px = 3, .coarse_margin_px = 1};
  const auto last_at = [&](int first_x, int last_x, float disparity, int x, int block_y, float behind = 40) {
    auto maps = testing::empty_maps(size);
    std::fill_n(maps.disparity.begin(), pixel_count(size), 40.0f);
    for (int y = 96; y < size.height; ++y) {
      std::fill_n(maps.disparity.begin() + y * size.width, size.width, behind);
      for (int u = first_x; u <= last_x; ++u) maps.disparity[y * size.width + u] = disparity;
    }
    return run(size, {0, 128}, options, maps).bands[8 * block_y * size.width + x].last;
  };
  EXPECT_EQ(last_at(36, 38, 60, 36, 4), 61) << "eight blocks above";
  EXPECT_EQ(last_at(36, 38, 60, 36, 3), 42) << "nine blocks above";
  EXPECT_EQ(last_at(36, 38, 60, 44, 4), 42) << "the blocks beside hold none of it";
  EXPECT_EQ(last_at(36, 41, 60, 44, 4), 61) << "two columns of blocks";
  EXPECT_EQ(last_at(20, 60, 60, 36, 4), 42) << "a wide thing";
  EXPECT_EQ(last_at(36, 38, 47, 36, 4, 44), 42) << "no jump";
  EXPECT_EQ(last_at(36, 38, 48, 36, 4, 44), 49);
  EXPECT_EQ(last_at(0, 2, 60, 0, 4), 42) << "at the edge nobody knows how wide it is";
}

// The left view has a prediction everywhere and searches 5 of 100 disparities, the right one has none and searches all.
TEST(SearchBand, ReportsAllThatWasMatched) {
  const shared::ImageSize size{32, 8};
  auto maps = testing::empty_maps(size);
  std::fill_n(maps.disparity.begin(), pixel_count(size), 50.0f);
  ocl::Context& context = testing::shared_context();
  SearchBand stage(context, size, {0, 100}, {.sigmas = 0, .min_half_width_px = 2});
  FrameTransfer transfer(context, size, {0, 100});
  const StereoMaps predicted = testing::upload(context, size, maps);
  const VerticalOffset offset(context);
  SearchBands bands(context, size, {0, 100});
  const auto report_of = [&](Views views, const MatchedParts& parts) {
    stage.narrow(predicted, {}, bands, views);
    transfer.download({predicted, &predicted, predicted, bands, views, parts, offset, {}}, {});
    context.wait();
    FrameReport report;
    transfer.collect(report);
    transfer.release();
    return report;
  };
  const std::vector<Stripe> whole = cut_into_stripes(8, 8, 2), stripes = cut_into_stripes(8, 6, 1);
  ASSERT_EQ(stripes.size(), 3u);  // 18 rows to match
  for (const Views views : {Views::kBoth, Views::kLeft, Views::kBoth}) {
    // Lanes of a band of 5 and of the whole range, of 100 disparities.
    const double once = views == Views::kLeft ? 0.08 : (0.08 + 1.12) / 2;
    const FrameReport report = report_of(views, {1, &whole, 0});
    EXPECT_DOUBLE_EQ(report.search_fraction, once);
    EXPECT_DOUBLE_EQ(report.predicted_fraction, 1);
    EXPECT_DOUBLE_EQ(report_of(views, {1, &stripes, 0}).search_fraction, 2.25 * once);
    EXPECT_DOUBLE_EQ(report_of(views, {2, &whole, 0}).search_fraction, 2 * once);
    const FrameReport of_few = report_of(views, {1, &whole, 0, 2});
    EXPECT_DOUBLE_EQ(of_few.search_fraction, once / 2);
    EXPECT_DOUBLE_EQ(of_few.predicted_fraction, 1);
    EXPECT_DOUBLE_EQ(report_of(views, {2, &whole, 256}).search_fraction, 2 * (once + 0.01 / views.count));
  }
}

}  // namespace
}  // namespace egosgm
