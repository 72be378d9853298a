// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/dynamic_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "tests/reference/method.h"

namespace egosgm::reference {
namespace {

struct Grid {
  int width, height;
  bool has(int x, int y) const { return x >= 0 && y >= 0 && x < width && y < height; }
  std::size_t at(int x, int y) const { return static_cast<std::size_t>(y) * width + x; }
  std::size_t count() const { return static_cast<std::size_t>(width) * height; }
  template <typename F>
  void around(int x, int y, int radius, F&& f) const {
    for (int v = y - radius; v <= y + radius; ++v) {
      for (int u = x - radius; u <= x + radius; ++u) {
        if (has(u, v)) f(u, v);
      }
    }
  }
};

struct Image {
  Grid grid;
  std::vector<int> greys;
};

/// Means of 2x2 pixels, of `factor` times their grey values.
Image halved(const Image& image, int factor) {
  Image half{{image.grid.width / 2, image.grid.height / 2}, {}};
  for (int y = 0; y < half.grid.height; ++y) {
    for (int x = 0; x < half.grid.width; ++x) {
      int sum = 0;
      for (const int v : {2 * y, 2 * y + 1}) {
        for (const int u : {2 * x, 2 * x + 1}) sum += image.greys[image.grid.at(u, v)];
      }
      half.greys.push_back(factor * sum / 4);
    }
  }
  return half;
}

using Code = std::array<bool, 24>;

std::vector<Code> codes_of(const Image& image) {
  const auto& [grid, greys] = image;
  std::vector<Code> codes(grid.count());
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      int bit = 0;
      for (int dy = -2; dy <= 2; ++dy) {
        for (int dx = -2; dx <= 2; ++dx) {
          if (dx == 0 && dy == 0) continue;
          const int u = std::clamp(x + dx, 0, grid.width - 1), v = std::clamp(y + dy, 0, grid.height - 1);
          codes[grid.at(x, y)][bit++] = greys[grid.at(u, v)] < greys[grid.at(x, y)];
        }
      }
    }
  }
  return codes;
}

int bits_apart(const Code& a, const Code& b) {
  int bits = 0;
  for (std::size_t i = 0; i < a.size(); ++i) bits += a[i] != b[i];
  return bits;
}

struct Place {
  int x = 0, y = 0;  // in sixteenths, from the one to which the camera's motion leads
};

struct Block {
  float disparity = EGOSGM_INVALID_DISPARITY;
  bool is_asked = false, was_hidden = false, is_new = false, is_nearer = false, is_farther = false;
  int part_x = 0, part_y = 0;                 // of the camera's place, in sixteenths, beyond the whole one before it
  std::array<std::array<int, 8>, 8> costs{};  // of the places from three before that one to four behind it
  std::optional<Place> elsewhere;
  bool moves = false;
};

struct Level {
  Grid grid;
  std::vector<Block> blocks;
  bool is_finest;
};

void look_at_last_map(Grid image, const LeftView& last, float u, float v, float expected, Block& block) {
  const int x = static_cast<int>(std::nearbyint(u)), y = static_cast<int>(std::nearbyint(v));
  if (!image.has(x, y)) return;
  const float seen = last.disparity[image.at(x, y)];
  if (seen == EGOSGM_INVALID_DISPARITY) return;
  const float part = kDynamicPart * std::max(expected, 0.0f), apart = std::abs(seen - expected);
  block.is_asked = true;
  block.was_hidden = seen > expected + kDynamicHidesPx + part;
  block.is_new = seen < expected - kDynamicNewPx - part;
  const bool contradicts = apart > kDynamicLeastPx && apart < kDynamicMostPx + part;
  block.is_nearer = contradicts && seen > expected;
  block.is_farther = contradicts && !(seen > expected);
}

Level compare(Grid pixels, int side, const Image& last_small, const Image& small, const LeftView& last,
              const LeftView& current, const shared::DisparityMotion& m) {
  const std::vector<Code> last_codes = codes_of(last_small), codes = codes_of(small);
  Level level{{pixels.width / side, pixels.height / side}, {}, side == kDynamicBlock};
  level.blocks.resize(level.grid.count());
  const auto row_times = [](const float(&row)[4], float x, float y, float d) {
    return row[0] * x + row[1] * y + row[2] * d + row[3];
  };
  for (int y = 0; y < level.grid.height; ++y) {
    for (int x = 0; x < level.grid.width; ++x) {
      Block& block = level.blocks[level.grid.at(x, y)];
      const int middle_x = side * x + side / 2, middle_y = side * y + side / 2;
      for (const auto& [dx, dy] : {std::pair(0, 0), {-1, -1}, {0, -1}, {-1, 0}}) {
        if (block.disparity != EGOSGM_INVALID_DISPARITY) break;
        block.disparity = current.disparity[pixels.at(middle_x + dx, middle_y + dy)];
      }
      if (block.disparity == EGOSGM_INVALID_DISPARITY) continue;
      const float own_x = static_cast<float>(middle_x) - 0.5f, own_y = static_cast<float>(middle_y) - 0.5f;
      const float wx = own_x - m.cx, wy = own_y - m.cy, wd = block.disparity + m.doffs;
      const float w = row_times(m.w, wx, wy, wd);
      if (!(w > kMinDepthRatio)) continue;
      const float phi = 1 / w;
      const float u = row_times(m.x, wx, wy, wd) * phi + m.cx, v = row_times(m.y, wx, wy, wd) * phi + m.cy;
      if (!(std::abs(u) < 1048576) || !(std::abs(v) < 1048576)) continue;
      const float samples = static_cast<float>(side) / 2;
      const float off_x = (u - own_x) / samples, off_y = (v - own_y) / samples;
      const int whole_x = static_cast<int>(std::floor(off_x)), whole_y = static_cast<int>(std::floor(off_y));
      const int first_x = 2 * x + whole_x - 3, first_y = 2 * y + whole_y - 3;
      if (!small.grid.has(first_x, first_y) || !small.grid.has(first_x + 8, first_y + 8)) continue;
      look_at_last_map(pixels, last, u, v, wd * phi - m.doffs, block);
      block.part_x = static_cast<int>((off_x - static_cast<float>(whole_x)) * 16);
      block.part_y = static_cast<int>((off_y - static_cast<float>(whole_y)) * 16);
      for (int i = 0; i < 8; ++i) {
        for (int j = 0; j < 8; ++j) {
          for (int sample = 0; sample < 4; ++sample) {
            const int dx = sample % 2, dy = sample / 2;
            block.costs[i][j] += bits_apart(codes[small.grid.at(2 * x + dx, 2 * y + dy)],
                                            last_codes[small.grid.at(first_x + j + dx, first_y + i + dy)]);
          }
        }
      }
    }
  }
  return level;
}

void find_places(Level& level) {
  for (int y = 0; y < level.grid.height; ++y) {
    for (int x = 0; x < level.grid.width; ++x) {
      Block& block = level.blocks[level.grid.at(x, y)];
      if (!block.is_asked) continue;
      std::array<std::array<int, 8>, 8> sums{};
      int count = 0;
      level.grid.around(x, y, 1, [&](int u, int v) {
        const Block& other = level.blocks[level.grid.at(u, v)];
        if (!other.is_asked) return;
        ++count;
        for (int i = 0; i < 8; ++i) {
          for (int j = 0; j < 8; ++j) sums[i][j] += other.costs[i][j];
        }
      });
      if (count < 3) continue;
      int best_i = 0, best_j = 0;
      for (int i = 0; i < 8; ++i) {
        for (int j = 0; j < 8; ++j) {
          if (sums[i][j] < sums[best_i][best_j]) best_i = i, best_j = j;
        }
      }
      const int bits = 256 * 4 * count;  // a bit a pixel
      int there = 256 * std::min({sums[3][3], sums[3][4], sums[4][3], sums[4][4]});
      if (level.is_finest) {
        there = 0;
        for (const int i : {0, 1}) {
          for (const int j : {0, 1}) {
            there +=
                (i ? block.part_y : 16 - block.part_y) * (j ? block.part_x : 16 - block.part_x) * sums[3 + i][3 + j];
          }
        }
      }
      if (there <= kDynamicDifferentBits * bits) block.is_new = false;
      if (block.was_hidden) there = std::min(there, kDynamicHiddenBits * bits);
      const int best = 256 * sums[best_i][best_j];
      if (2 * (there - best) <= kDynamicGainHalfBits * bits || 10 * best >= kDynamicRatioTenths * there) continue;
      const Place place{16 * (best_j - 3) - block.part_x, 16 * (best_i - 3) - block.part_y};
      if (!level.is_finest || place.x * place.x + place.y * place.y > kDynamicLeastSquare) block.elsewhere = place;
    }
  }
}

void vote(Level& level, const Level* coarser) {
  std::vector<bool> moves(level.blocks.size());
  for (int y = 0; y < level.grid.height; ++y) {
    for (int x = 0; x < level.grid.width; ++x) {
      const Block& block = level.blocks[level.grid.at(x, y)];
      const auto count = [&](int radius, auto&& counts) {
        int votes = 0;
        level.grid.around(x, y, radius, [&](int u, int v) { votes += counts(level.blocks[level.grid.at(u, v)]); });
        return votes;
      };
      const auto agrees = [&](const Block& other) {
        return other.elsewhere && std::abs(other.elsewhere->x - block.elsewhere->x) <= kDynamicAgrees &&
               std::abs(other.elsewhere->y - block.elsewhere->y) <= kDynamicAgrees;
      };
      bool is_marked =
          coarser && coarser->grid.has(x / 2, y / 2) && coarser->blocks[coarser->grid.at(x / 2, y / 2)].moves;
      if (block.elsewhere) is_marked |= count(1, agrees) >= kDynamicVotes;
      if (level.is_finest) {
        const auto is_new = [](const Block& other) { return other.is_new; };
        const auto is_nearer = [](const Block& other) { return other.is_nearer; };
        const auto is_farther = [](const Block& other) { return other.is_farther; };
        if (block.is_new) is_marked |= count(1, is_new) >= kDynamicVotes;
        if (block.is_nearer) is_marked |= count(2, is_nearer) >= kDynamicDepthVotes;
        if (block.is_farther) is_marked |= count(2, is_farther) >= kDynamicDepthVotes;
      }
      moves[level.grid.at(x, y)] = is_marked;
    }
  }
  for (std::size_t i = 0; i < moves.size(); ++i) level.blocks[i].moves = moves[i];
}

}  // namespace

std::vector<std::uint8_t> dynamic_map(shared::ImageSize size, const LeftView& last, const LeftView& current,
                                      const shared::DisparityMotion& previous_from_current) {
  const Grid pixels{size.width, size.height};
  std::vector<std::uint8_t> marks(pixels.count(), 0);
  std::vector<Level> levels;
  Image last_small = halved({pixels, last.greys}, last.bits == 8 ? 256 : 1);
  Image small = halved({pixels, current.greys}, current.bits == 8 ? 256 : 1);
  for (int side = kDynamicBlock; side <= kDynamicMaxBlock; side *= 2) {
    if (side > kDynamicBlock) last_small = halved(last_small, 1), small = halved(small, 1);
    levels.push_back(compare(pixels, side, last_small, small, last, current, previous_from_current));
    find_places(levels.back());
  }
  for (std::size_t i = levels.size(); i-- > 0;) vote(levels[i], i + 1 < levels.size() ? &levels[i + 1] : nullptr);

  const Level& finest = levels.front();
  if (finest.blocks.empty()) return marks;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const float d = current.disparity[pixels.at(x, y)];
      if (d == EGOSGM_INVALID_DISPARITY) continue;
      const float most = kDynamicAlikePx + kDynamicAlikePart * std::max(d, 0.0f);
      int moving = 0, others = 0;
      finest.grid.around(std::min(x / kDynamicBlock, finest.grid.width - 1),
                         std::min(y / kDynamicBlock, finest.grid.height - 1), kDynamicReach, [&](int u, int v) {
                           const Block& block = finest.blocks[finest.grid.at(u, v)];
                           if (!(std::abs(block.disparity - d) <= most)) return;
                           moving += block.moves;
                           others += !block.moves && block.is_asked;
                         });
      if (moving > 0 && kDynamicShare * moving >= others) marks[pixels.at(x, y)] = 255;
    }
  }
  return marks;
}

}  // namespace egosgm::reference
