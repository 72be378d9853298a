// SPDX-License-Identifier: Apache-2.0
#include "host/grey_levels.h"

#include <cstring>
#include <vector>

namespace egosgm {
namespace {

constexpr std::int64_t kOutliers = 2000;   // one in so many pixels may lie below, and one above
constexpr std::int64_t kHighlights = 100;  // or one in so many above, where all else is kFarAbove times darker
constexpr int kFarAbove = 4;
constexpr int kFewLevels = 64;  // a range that fills no more of the 255 is stretched
constexpr int kRowStep = 16;    // of 8 bits, that say what is dark with fewer pixels

template <typename Pixel>
void count(const char* pixels, int width, std::vector<std::int64_t>& counts) {
  for (int x = 0; x < width; ++x, pixels += sizeof(Pixel)) {
    Pixel value;
    std::memcpy(&value, pixels, sizeof(value));  // rows of 16 bits may lie at odd places
    ++counts[value];
  }
}

}  // namespace

GreyLevels levels_of(const ImageView& left, const ImageView& right) {
  const bool is_wide = left.type == PixelType::kU16;
  std::vector<std::int64_t> counts(is_wide ? 65536 : 256);
  std::int64_t pixels = 0;
  for (const ImageView* image : {&left, &right}) {
    for (int y = 0; y < image->height; y += is_wide ? 1 : kRowStep) {
      const char* row = static_cast<const char*>(image->data) + y * image->stride_bytes;
      is_wide ? count<std::uint16_t>(row, image->width, counts) : count<std::uint8_t>(row, image->width, counts);
      pixels += image->width;
    }
  }
  int low = 0, high = static_cast<int>(counts.size()) - 1;
  for (std::int64_t below = counts[0]; below <= pixels / kOutliers && low < high; below += counts[++low]) {
  }
  std::int64_t above = counts.back();
  for (; above <= pixels / kOutliers && high > low; above += counts[--high]) {
  }
  int most = high;
  // Lamps and the sun: they would leave a few levels to all else.
  for (; above <= pixels / kHighlights && most > low; above += counts[--most]) {
  }
  if (high / kFarAbove > most) high = most;
  const auto shift_of = [](int largest) {
    int shift = 0;
    while ((largest >> shift) > 255) ++shift;
    return shift;
  };
  GreyLevels levels{.shift = shift_of(high)};
  if ((high - low) >> levels.shift >= kFewLevels || high == low) return levels;
  levels.pedestal = low;
  levels.shift = shift_of(high - low);
  levels.gain = std::max(1, 255 / (high - low));
  return levels;
}

}  // namespace egosgm
