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

bool has_no_texture(const std::vector<int>& greys) {
  const auto [least, largest] = std::minmax_element(greys.begin(), greys.end());
  return 12 * (*largest - *least) < *largest;
}

}  // namespace

std::vector<float> textureless_regions(shared::ImageSize size, const std::vector<int>& images, int row_step,
                                       std::vector<float> disparity) {
  for (int view = 0; view < 2; ++view) {
    Blocks blocks{(size.width + kSide - 1) / kSide, (size.height + kSide - 1) / kSide, {}, {}};
    const auto pixels_of = [&](int block) {
      const int left = kSide * (block % blocks.columns), top = kSide * (block / blocks.columns);
      std::vector<std::size_t> pixels;
      for (int v = top; v < std::min(top + kSide, size.height); ++v) {
        for (int u = left; u < std::min(left + kSide, size.width); ++u) {
          pixels.push_back((static_cast<std::size_t>(view) * size.height + v) * size.width + u);
        }
      }
      return pixels;
    };
    const auto greys_of = [&](int block) {
      std::vector<int> greys;
      for (const std::size_t i : pixels_of(block)) greys.push_back(images[i]);
      return greys;
    };
    const int count = blocks.columns * blocks.rows;
    for (int block = 0; block < count; ++block) {
      blocks.is_textureless.push_back(has_no_texture(greys_of(block)));
      blocks.labels.push_back(block < blocks.columns ? block : kNoLabel);
    }
    for (int time = 0; time < 3; ++time) {
      spread(blocks, 0, 1);
      spread(blocks, 0, -1);
      spread(blocks, 1, 0);
      spread(blocks, -1, 0);
    }
    const auto is_there = [&](std::size_t i) { return i / size.width % size.height % row_step == 0; };
    const auto is_filled = [&](std::size_t i) { return is_there(i) && disparity[i] != EGOSGM_INVALID_DISPARITY; };
    std::vector<std::ptrdiff_t> pixels(blocks.columns), filled(blocks.columns);
    const auto has_label = [&](int block) { return blocks.is_textureless[block] && blocks.labels[block] != kNoLabel; };
    for (int block = 0; block < count; ++block) {
      if (!has_label(block)) continue;
      const std::vector<std::size_t> each = pixels_of(block);
      pixels[blocks.labels[block]] += std::count_if(each.begin(), each.end(), is_there);
      filled[blocks.labels[block]] += std::count_if(each.begin(), each.end(), is_filled);
    }
    const auto is_left_out = [&](int block) {
      return has_label(block) && 4 * filled[blocks.labels[block]] < 3 * pixels[blocks.labels[block]];
    };
    for (int block = 0; block < count; ++block) {
      std::vector<int> beside;  // the greys of what is left out around a block with texture
      const int x = block % blocks.columns, y = block / blocks.columns;
      for (int v = std::max(y - 1, 0); v <= std::min(y + 1, blocks.rows - 1); ++v) {
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, blocks.columns - 1); ++u) {
          if (blocks.is_textureless[block] || !is_left_out(v * blocks.columns + u)) continue;
          for (const int grey : greys_of(v * blocks.columns + u)) beside.push_back(grey);
        }
      }
      for (const std::size_t i : pixels_of(block)) {
        std::vector<int> with_it = beside;
        with_it.push_back(images[i]);
        const bool goes = is_left_out(block) || (!beside.empty() && has_no_texture(with_it));
        if (goes && is_there(i)) disparity[i] = EGOSGM_INVALID_DISPARITY;
      }
    }
  }
  return disparity;
}

}  // namespace egosgm::reference
