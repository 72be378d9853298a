// SPDX-License-Identifier: Apache-2.0
#include "host/stages/edge_rejection.h"

#include "tests/reference/edge_rejection.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::kNone;

testing::HostMaps reject(shared::ImageSize size, float max_jump_px, const testing::HostMaps& maps, int pixels = 0,
                         Views views = Views::kBoth) {
  ocl::Context& context = testing::shared_context();
  EdgeRejection stage(context, size, {.max_jump_px = max_jump_px}, pixels);
  Map kept = testing::upload(context, size, testing::earlier_maps(size)).disparity;
  stage.reject(testing::upload(context, size, maps).disparity, kept, views);
  return {kept.read(context), {}};
}

// One row in the left view; the right view is empty.
std::vector<float> reject_row(const std::vector<float>& row, float max_jump_px) {
  const shared::ImageSize size{static_cast<int>(row.size()), 1};
  testing::HostMaps maps = testing::empty_maps(size);
  std::copy(row.begin(), row.end(), maps.disparity.begin());
  const std::vector<float> kept = reject(size, max_jump_px, maps).disparity;
  return {kept.begin(), kept.begin() + size.width};
}

EGOSGM_TEST_AT_ALL_SIZES(EdgeRejectionTest);

TEST_P(EdgeRejectionTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  const testing::HostMaps maps = testing::random_maps(size, -20, 100, 0.2, 3);
  for (const float max_jump_px : {1.0f, 5.0f}) {
    testing::expect_reference(
        size, testing::earlier_maps(size),
        [&](int pixels, Views views) { return reject(size, max_jump_px, maps, pixels, views); },
        [&](int step) { return reference::edge_rejection(size, max_jump_px, maps, step); });
  }
}

TEST(EdgeRejection, DropsBothSidesOfAJumpAndSeesItAcrossOneHoleButNotAcrossTwo) {
  EXPECT_EQ(reject_row({10, 10, 10, 10, 30, 30, 30}, 5), (std::vector<float>{10, 10, 10, kNone, kNone, 30, 30}));
  EXPECT_EQ(reject_row({10, 10, kNone, 30, 30}, 5), (std::vector<float>{10, kNone, kNone, kNone, 30}));
  EXPECT_EQ(reject_row({10, 10, kNone, kNone, 30, 30}, 5), (std::vector<float>{10, 10, kNone, kNone, 30, 30}));
}

TEST(EdgeRejection, KeepsSlopesAndStepsUpToTheLimit) {
  const std::vector<float> row{10, 15, 20, 25, 20};
  EXPECT_EQ(reject_row(row, 5), row);
  EXPECT_NE(reject_row(row, 4.75f), row);
}

TEST(EdgeRejection, DoesNotLookAroundTheEndOfARow) {
  const shared::ImageSize size{3, 2};
  testing::HostMaps maps = testing::empty_maps(size);
  maps.disparity = {kNone, kNone, 90,    kNone, 10,    kNone,   // left view: left of the 10, over the edge, lies the 90
                    kNone, 10,    kNone, 90,    kNone, kNone};  // right view: right of the 10
  EXPECT_EQ(reject(size, 5, maps).disparity, maps.disparity);
}

}  // namespace
}  // namespace egosgm
