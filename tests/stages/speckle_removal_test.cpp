// SPDX-License-Identifier: Apache-2.0
#include "host/stages/speckle_removal.h"

#include "tests/reference/speckle_removal.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::HostMaps;
using testing::same_bits;

using Row = std::vector<float>;

Row run(shared::ImageSize size, const SpeckleRemovalOptions& options, const HostMaps& maps, int strip_rows = 0,
        int row_group = 0, Views views = Views::kBoth) {
  ocl::Context& context = testing::shared_context();
  SpeckleRemoval stage(context, size, options, strip_rows, row_group);
  Map kept = testing::on_device(context, maps.disparity);
  stage.remove(kept, views);
  return kept.read(context);
}

/// Disparities with the same shape from row to row, so that regions of all sizes and tangled outlines come about.
HostMaps regions(shared::ImageSize size, float step, unsigned seed) {
  HostMaps maps = testing::random_maps(size, 0, 20, 0.25, seed);
  for (std::size_t i = 0; i < maps.disparity.size(); ++i) {
    float& d = maps.disparity[i];
    if (d > EGOSGM_INVALID_DISPARITY) d = step * std::floor(d / 5);
  }
  return maps;
}

EGOSGM_TEST_AT_ALL_SIZES(SpeckleRemovalTest);

TEST_P(SpeckleRemovalTest, EqualsReferenceWhateverStripsAndGroupsAre) {
  const shared::ImageSize size = GetParam();
  for (const float step : {2.0f, 2.5f}) {
    const HostMaps maps = regions(size, step, 51);
    for (const auto& [max_size_px, strip_rows, row_group] :
         {std::tuple{1, 0, 0}, {10, 1, 1}, {10, 1, 64}, {100, 0, 0}, {100, 2, 7}, {100, 1000, 1}}) {
      SCOPED_TRACE(std::to_string(strip_rows) + " rows a strip, " + std::to_string(row_group) + " work-items a row");
      const SpeckleRemovalOptions options{.max_size_px = max_size_px};
      const Row expected = reference::speckle_removal(size, options, maps).disparity;
      EXPECT_TRUE(same_bits(run(size, options, maps, strip_rows, row_group), expected, size));
      EXPECT_TRUE(same_bits(run(size, options, maps, strip_rows, row_group, Views::kLeft),
                            testing::left_and_right(expected, maps.disparity), size));
    }
  }
}

/// Both views as drawn: a digit is a disparity of ten times its value, a dot none.
HostMaps drawn(const std::vector<std::string>& rows) {
  HostMaps maps;
  for (int view = 0; view < 2; ++view) {
    for (const std::string& row : rows) {
      for (const char c : row) {
        maps.disparity.push_back(c == '.' ? EGOSGM_INVALID_DISPARITY : 10.0f * static_cast<float>(c - '0'));
      }
    }
  }
  return maps;
}

void expect_drawn(const Row& actual, const std::vector<std::string>& rows) {
  const shared::ImageSize size{static_cast<int>(rows[0].size()), static_cast<int>(rows.size())};
  EXPECT_TRUE(same_bits(actual, drawn(rows).disparity, size));
}

TEST(SpeckleRemoval, DropsRegionsUpToTheSize) {
  const auto maps = drawn({"11122", "11.2.", "5...3", "..333"});
  expect_drawn(run({5, 4}, {.max_size_px = 3}, maps), {"111..", "11...", "....3", "..333"});
  expect_drawn(run({5, 4}, {.max_size_px = 4}, maps), {"111..", "11...", ".....", "....."});
}

TEST(SpeckleRemoval, DiagonalNeighboursAreNotConnected) {
  expect_drawn(run({4, 4}, {.max_size_px = 1}, drawn({"1...", ".1..", "..11", "1..."})),
               {"....", "....", "..11", "...."});
}

TEST(SpeckleRemoval, RegionsMeetAroundCorners) {
  // A spiral, whose runs are known to belong together only at its end.
  const std::vector<std::string> spiral{"1111111", "......1", "11111.1", "1...1.1", "1.111.1", "1.....1", "1111111"};
  expect_drawn(run({7, 7}, {.max_size_px = 30}, drawn(spiral), 2), spiral);
  expect_drawn(run({7, 7}, {.max_size_px = 31}, drawn(spiral), 2), std::vector<std::string>(7, "......."));
}

TEST(SpeckleRemoval, SlopeIsOneRegion) {
  expect_drawn(run({9, 1}, {.max_size_px = 5, .max_difference_px = 10}, drawn({"123456789"})), {"123456789"});
  expect_drawn(run({9, 1}, {.max_size_px = 5, .max_difference_px = 9.9f}, drawn({"123456789"})), {"........."});
}

TEST(SpeckleRemoval, OffKeepsAll) { expect_drawn(run({3, 1}, {.max_size_px = 0}, drawn({"1.2"})), {"1.2"}); }

}  // namespace
}  // namespace egosgm
