// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/textureless_regions.h"

#include <algorithm>

namespace egosgm::reference {
namespace {

constexpr int kSide = 4;  // of a block
constexpr int kNoLabel = 1 << 20;

/// The blocks of a view.
struct Blocks {
  int columns, rows;
  std::vector<bool> is_textureless;
  std::vector<int> labels;

  int& label(int x, int y) { return labels[y * columns + x]; }
  bool joins(int x, int y) const {
    return x >= 0 && y >= 0 && x < columns && y < rows && is_textureless[y * columns + x];
  }
};

/// A block's label goes on to its neighbours in one line, from one to the next.
void spread(Blocks& blocks, int dx, int dy) {
  const int count = blocks.rows * blocks.columns;
  for (int i = 0; i < count; ++i) {
    const int at = dx + dy > 0 ? i : count - 1 - i;
    const int x = at % blocks.columns, y = at / blocks.columns;
    if (!blocks.joins(x, y) || !blocks.joins(x - dx, y - dy)) continue;
    blocks.label(x, y) = std::min(blocks.label(x, y), blocks.label(x - dx, y - dy));
  }
}

}  // namespace

std::vector<float> textureless_regions(shared::ImageSize size, const std::vector<int>& images, int row_step,
                                       std::vector<float> disparity) {
  for (int view = 0; view < 2; ++view) {
    Blocks blocks{(size.width + kSide - 1) / kSide, (size.height + kSide - 1) / kSide, {}, {}};
    const auto pixels_of = [&](int x, int y) {
      std::vector<std::size_t> pixels;
      for (int v = kSide * y; v < std::min(kSide * (y + 1), size.height); ++v) {
        for (int u = kSide * x; u < std::min(kSide * (x + 1), size.width); ++u) {
          pixels.push_back((static_cast<std::size_t>(view) * size.height + v) * size.width + u);
        }
      }
      return pixels;
    };
    for (int y = 0; y < blocks.rows; ++y) {
      for (int x = 0; x < blocks.columns; ++x) {
        std::vector<int> greys;
        for (const std::size_t i : pixels_of(x, y)) greys.push_back(images[i]);
        const auto [least, largest] = std::minmax_element(greys.begin(), greys.end());
        blocks.is_textureless.push_back(24 * (*largest - *least) < *largest);
        blocks.labels.push_back(y == 0 ? x : kNoLabel);
      }
    }
    for (int time = 0; time < 3; ++time) {
      spread(blocks, 0, 1);
      spread(blocks, 0, -1);
      spread(blocks, 1, 0);
      spread(blocks, -1, 0);
    }
    for (int label = 0; label < blocks.columns; ++label) {
      std::vector<std::size_t> region;
      for (int i = 0; i < blocks.columns * blocks.rows; ++i) {
        if (!blocks.is_textureless[i] || blocks.labels[i] != label) continue;
        for (const std::size_t pixel : pixels_of(i % blocks.columns, i / blocks.columns)) {
          if (pixel / size.width % size.height % row_step == 0) region.push_back(pixel);
        }
      }
      const auto is_filled = [&](std::size_t i) { return disparity[i] != EGOSGM_INVALID_DISPARITY; };
      if (2 * std::count_if(region.begin(), region.end(), is_filled) >= static_cast<std::ptrdiff_t>(region.size()))
        continue;
      for (const std::size_t i : region) disparity[i] = EGOSGM_INVALID_DISPARITY;
    }
  }
  return disparity;
}

}  // namespace egosgm::reference
