// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/search_band.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "tests/reference/method.h"

namespace egosgm::reference {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// By trial: the fewest chunks that an allowed origin exists for, and of those origins the nearest to the centred one.
shared::Band band_of(shared::DisparityRange range, float from, float to) {
  const float lowest = static_cast<float>(range.min), highest = static_cast<float>(range.min + range.count - 1);
  const int first = static_cast<int>(std::floor(std::clamp(from, lowest, highest)));
  const int last = static_cast<int>(std::ceil(std::clamp(to, lowest, highest)));
  for (int chunks = 1;; chunks += chunks > 1 ? 2 : 1) {
    const int step = chunks > 1 ? EGOSGM_BAND_STEP : 1;
    const int lanes = chunks * EGOSGM_LANES;
    if (lanes < last - first + 1) continue;
    int best = -1;
    for (int origin = 0; range.min + origin <= first; origin += step) {
      if (range.min + origin + lanes <= last) continue;
      if (origin > 0 && origin + lanes >= range.count + step) continue;
      // How far the middles of band and lanes are apart, in half lanes; of equal ones, an even multiple of the step.
      const auto distance = [&](int at) { return std::abs(2 * (range.min + at) + lanes - (first + last + 1)); };
      const bool is_even = origin / step % 2 == 0;
      if (best < 0 || distance(origin) < distance(best) || (distance(origin) == distance(best) && is_even)) {
        best = origin;
      }
    }
    if (best < 0) continue;
    return {static_cast<cl_short>(range.min + best), static_cast<cl_ushort>(chunks), static_cast<cl_short>(first),
            static_cast<cl_short>(last)};
  }
}

bool is_valid(float disparity) { return disparity > EGOSGM_INVALID_DISPARITY; }

/// What the coarse match found around a block, in full pixels, but for the outermost; first > second: not enough.
std::pair<float, float> found_around(shared::ImageSize size, const std::vector<float>& coarse, int view, int block_x,
                                     int block_y) {
  const int width = (size.width + 3) / 4, height = (size.height + 3) / 4;
  std::vector<float> found;
  for (int y = 2 * block_y - 1; y <= 2 * block_y + 2; ++y) {
    for (int x = 2 * block_x - 1; x <= 2 * block_x + 2; ++x) {
      if (coarse.empty() || x < 0 || y < 0 || x >= width || y >= height) continue;
      const float d = coarse[(static_cast<std::size_t>(view) * height + y) * width + x];
      if (!is_valid(d)) continue;
      found.push_back(4 * d);
    }
  }
  if (found.size() < kCoarseMinCount) return {kInfinity, -kInfinity};
  std::sort(found.begin(), found.end());
  const float least = found[kCoarseOutliers], most = found[found.size() - 1 - kCoarseOutliers];
  return {most - least <= 4 ? least - kCoarseFartherPx : least, most};
}

/// Disparities of both views, of the rows that are there.
struct PresentMap {
  shared::ImageSize size;
  const std::vector<float>& disparity;
  cl_int row_step;
};

/// What is predicted in the blocks from (first_x, first_y) to (last_x, last_y).
struct Predicted {
  float least = kInfinity, most = -kInfinity;
  int count = 0;
};
Predicted predicted_in(const PresentMap& map, int view, int first_x, int first_y, int last_x, int last_y) {
  const shared::ImageSize size = map.size;
  const int step = map.row_step;
  Predicted found;
  for (int y = std::max(0, first_y * EGOSGM_BLOCK); y < std::min(size.height, (last_y + 1) * EGOSGM_BLOCK); y += step) {
    for (int x = std::max(0, first_x * EGOSGM_BLOCK); x < std::min(size.width, (last_x + 1) * EGOSGM_BLOCK); ++x) {
      const float d = map.disparity[(static_cast<std::size_t>(view) * size.height + y) * size.width + x];
      if (!is_valid(d)) continue;
      found.least = std::min(found.least, d), found.most = std::max(found.most, d), found.count += step;
    }
  }
  return found;
}

/// What is predicted in a block and in those above and below it, and the thin things farther above and below it.
Predicted predicted_upright(const PresentMap& map, int view, int x, int y) {
  const int last = (map.size.width + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK - 1;
  Predicted found = predicted_in(map, view, x, y - 1, x, y + 1);
  for (int v = y - kThinReach; v <= y + kThinReach; v += 2) {
    const auto in = [&](int u) {
      return predicted_in(map, view, std::clamp(u, 0, last), v, std::clamp(u, 0, last), v);
    };
    const Predicted own = in(x);
    if (own.count == 0 || !(own.most > std::max(in(x - kThinBlocks).most, in(x + kThinBlocks).most) + kThinJumpPx)) {
      continue;
    }
    found.most = std::max(found.most, own.most);
  }
  return found;
}

shared::Band from_neighbours(const PresentMap& predicted, shared::DisparityRange range,
                             const SearchBandOptions& options, std::pair<float, float> coarse, int view, int x, int y) {
  const Predicted around = predicted_in(predicted, view, x - 1, y - 1, x + 1, y + 1);
  if (around.count == 0 || around.count < options.neighbour_min_count) return band_of(range, -kInfinity, kInfinity);
  const float from = around.least - options.neighbour_margin_px, to = around.most + options.neighbour_margin_px;
  if (coarse.first > coarse.second) return band_of(range, from, to);
  return band_of(range, std::min(from, coarse.first - options.coarse_margin_px),
                 std::max(to, coarse.second + options.coarse_margin_px));
}

shared::Band of_prediction(shared::DisparityRange range, const SearchBandOptions& options, float d, float p,
                           std::pair<float, float> found) {
  float half_width = options.sigmas * std::sqrt(p);
  if (half_width <= options.min_half_width_px) half_width = options.min_half_width_px;
  if (!(half_width <= static_cast<float>(range.count))) half_width = static_cast<float>(range.count);
  float from = d - half_width, to = d + half_width;
  if (found.first < from - options.coarse_tolerance_px || found.second > to + options.coarse_tolerance_px) {
    const float below = found.first - options.coarse_margin_px, above = found.second + options.coarse_margin_px;
    from = std::min(from, below), to = std::max(to, above);
  }
  return band_of(range, from, to);
}

void sum_rows(shared::ImageSize size, const std::vector<float>& disparity, SearchBands& result) {
  result.cell_offsets.resize(result.bands.size());
  for (std::size_t row = 0; row < 2 * static_cast<std::size_t>(size.height); ++row) {
    shared::RowSum sum{};
    cl_uint chunks = 0;
    for (std::size_t i = row * size.width; i < (row + 1) * size.width; ++i) {
      const shared::Band& band = result.bands[i];
      result.cell_offsets[i] = chunks;
      chunks += band.chunks;
      sum.cells += static_cast<cl_uint>(band.chunks) * EGOSGM_LANES;
      sum.predicted += is_valid(disparity[i]);
    }
    result.row_sums.push_back(sum);
  }
}

}  // namespace

SearchBands search_band(shared::ImageSize size, shared::DisparityRange range, const SearchBandOptions& options,
                        const testing::HostMaps& predicted, const std::vector<float>& coarse, cl_int row_step) {
  const int blocks_x = (size.width + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK;
  const int blocks_y = (size.height + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK;
  std::vector<shared::Band> of_blocks;
  std::vector<std::pair<float, float>> found;
  const PresentMap disparities{size, predicted.disparity, row_step};
  for (int view = 0; view < 2; ++view) {
    for (int y = 0; y < blocks_y; ++y) {
      for (int x = 0; x < blocks_x; ++x) {
        const std::pair<float, float> of_coarse = found_around(size, coarse, view, x, y);
        of_blocks.push_back(options.from_neighbours
                                ? from_neighbours(disparities, range, options, of_coarse, view, x, y)
                                : band_of(range, -kInfinity, kInfinity));
        const Predicted own = options.from_neighbours ? predicted_upright(disparities, view, x, y) : Predicted{};
        found.push_back({std::min(of_coarse.first, own.least), std::max(of_coarse.second, own.most)});
      }
    }
  }
  SearchBands result;
  for (int view = 0; view < 2; ++view) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const std::size_t i = (static_cast<std::size_t>(view) * size.height + y) * size.width + x;
        const float d = predicted.disparity[i];
        const std::size_t block =
            (static_cast<std::size_t>(view) * blocks_y + y / EGOSGM_BLOCK) * blocks_x + x / EGOSGM_BLOCK;
        result.bands.push_back(is_valid(d) ? of_prediction(range, options, d, predicted.variance[i], found[block])
                                           : of_blocks[block]);
      }
    }
  }
  sum_rows(size, predicted.disparity, result);
  return result;
}

SearchBands full_range(shared::ImageSize size, shared::DisparityRange range, const std::vector<float>& predicted) {
  const std::size_t pixels = 2 * static_cast<std::size_t>(size.width) * size.height;
  SearchBands result{std::vector(pixels, band_of(range, -kInfinity, kInfinity)), {}, {}};
  sum_rows(size, predicted.empty() ? std::vector<float>(pixels, EGOSGM_INVALID_DISPARITY) : predicted, result);
  return result;
}

}  // namespace egosgm::reference
