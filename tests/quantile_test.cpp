// SPDX-License-Identifier: Apache-2.0
#include "host/quantile.h"

#include <gtest/gtest.h>

namespace egosgm {
namespace {

TEST(Quantile, IsTheValueThatSortingPutsThere) {
  const std::vector<float> values{4, -1, 4, 0, 9};
  EXPECT_EQ(nth_value(values, 0), -1);
  EXPECT_EQ(nth_value(values, 3), 4);
  EXPECT_EQ(nth_value(values, 4), 9);
}

TEST(Quantile, MedianOfAnEvenNumberIsTheGreaterInTheMiddle) {
  EXPECT_EQ(median(std::vector{7}), 7);
  EXPECT_EQ(median(std::vector{3.0, 1.0, 2.0}), 2);
  EXPECT_EQ(median(std::vector{3.0, 1.0, 2.0, 9.0}), 3);
}

}  // namespace
}  // namespace egosgm
