// SPDX-License-Identifier: Apache-2.0
#include "apps/last_ones.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

namespace egosgm::app {
namespace {

TEST(LastOnes, HoldsSoManyAndKeepsTheirIndices) {
  constexpr std::size_t kMost = 3;
  LastOnes<std::shared_ptr<int>> last(kMost);
  std::vector<std::weak_ptr<int>> all;
  for (int i = 0; i < 10; ++i) {
    const auto element = std::make_shared<int>(i);
    all.push_back(element);
    last.push_back(element);
    EXPECT_EQ(last.end(), all.size());
    EXPECT_EQ(last.end() - last.first(), std::min(all.size(), kMost));
    for (std::size_t k = last.first(); k < last.end(); ++k) EXPECT_EQ(*last[k], static_cast<int>(k));
  }
  for (std::size_t k = 0; k < all.size(); ++k) EXPECT_EQ(all[k].expired(), k < last.first());
}

}  // namespace
}  // namespace egosgm::app
