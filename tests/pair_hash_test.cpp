// SPDX-License-Identifier: Apache-2.0
#include "host/pair_hash.h"

#include <gtest/gtest.h>

#include <vector>

namespace egosgm {
namespace {

// Rows longer than a step and no multiple of it, with bytes between them that belong to no pixel.
constexpr int kWidth = 301, kHeight = 3, kStride = 310;

PairHash hash_of(const std::vector<std::uint8_t>& bytes) {
  const auto view = [&](int index) {
    return ImageView{.data = bytes.data() + index * kHeight * kStride,
                     .width = kWidth,
                     .height = kHeight,
                     .stride_bytes = kStride,
                     .type = PixelType::kU8};
  };
  return egosgm::hash_of(view(0), view(1));
}

TEST(PairHash, ChangesWithEveryPixelAndNothingElse) {
  const std::vector<std::uint8_t> pair(2 * kHeight * kStride);
  const PairHash hash = hash_of(pair);
  for (std::size_t i = 0; i < pair.size(); ++i) {
    std::vector<std::uint8_t> other = pair;
    other[i] = 128;
    ASSERT_EQ(hash_of(other) == hash, i % kStride >= kWidth) << "byte " << i;
  }
}

// Two high bits that changed in one place of the step would cancel in sums alone.
TEST(PairHash, ChangesWithTwoPixels) {
  const std::vector<std::uint8_t> pair(2 * kHeight * kStride);
  std::vector<std::uint8_t> other = pair;
  other[3] = other[259] = 128;
  EXPECT_NE(hash_of(other), hash_of(pair));
}

}  // namespace
}  // namespace egosgm
