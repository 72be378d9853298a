// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/banded_sgm.h"

#include <algorithm>
#include <bit>
#include <cstdlib>

#include "tests/reference/method.h"
#include "tests/reference/present_rows.h"
#include "tests/reference/step_penalties.h"

namespace egosgm::reference {
namespace {

/// The cells of one view: per pixel, a value for each of its band's disparities that lie in the range.
class Cells {
 public:
  Cells(const shared::SgmParameters& q, const shared::Band* bands) : q_(q), bands_(bands) {
    std::size_t cells = 0;
    for (int i = 0; i < q.width * q.height; ++i) {
      first_cell_.push_back(cells);
      cells += last(i) - first(i) + 1;
    }
    values_.resize(cells);
  }
  int first(int pixel) const { return bands_[pixel].origin; }
  int last(int pixel) const {
    return std::min(bands_[pixel].origin + bands_[pixel].chunks * EGOSGM_LANES, q_.min_disparity + q_.disparities) - 1;
  }
  bool has(int pixel, int d) const { return d >= first(pixel) && d <= last(pixel); }
  int& at(int pixel, int d) { return values_[first_cell_[pixel] + d - first(pixel)]; }

 private:
  const shared::SgmParameters& q_;
  const shared::Band* bands_;
  std::vector<std::size_t> first_cell_;
  std::vector<int> values_;
};

struct View {
  const shared::SgmParameters& q;
  int view;
  const BandedSgmOptions& options;
  const std::uint16_t* grey;
  const std::vector<std::uint64_t>& own;
  const std::vector<std::uint64_t>& other;

  std::uint64_t code(const std::vector<std::uint64_t>& codes, int x, int y) const {
    return codes[static_cast<std::size_t>(std::clamp(y, 0, q.height - 1)) * q.width + std::clamp(x, 0, q.width - 1)];
  }
  /// Every so many-th row is matched.
  int row_step() const { return q.row_step; }
  int rows() const { return (q.height + row_step() - 1) / row_step(); }
  /// P2 of the step from the pixel before, (dx, dy rows) back: that of the lower one of the two from its neighbour.
  int p2(int x, int y, int dx, int dy) const {
    const int lower_x = dy < 0 ? x - dx : x, lower_y = dy < 0 ? y + row_step() : y;
    const int upper_x = dy < 0 ? x : x - dx, upper_y = dy == 0 ? y : lower_y - row_step();
    return step_penalty(options, grey[lower_y * q.width + lower_x], grey[upper_y * q.width + upper_x]);
  }
  int matched(int x, int d) const { return view == EGOSGM_LEFT ? x - d : x + d; }

  int cost(int x, int y, int d) const {
    if (options.cost != MatchingCost::kSad3x3) {
      return (options.cost == MatchingCost::kCensus5x5 ? 2 : 1) *
             std::popcount(code(own, x, y) ^ code(other, matched(x, d), y));
    }
    int sum = 0;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        sum += std::abs(static_cast<int>(code(own, x + dx, y + dy)) -
                        static_cast<int>(code(other, matched(x, d) + dx, y + dy)));
      }
    }
    return std::min(sum / 9, 63);
  }
};

/// L of one path, relative to its minimum at every pixel.
void aggregate(const View& v, int dx, int dy, Cells& costs) {
  const shared::SgmParameters& q = v.q;
  const int p1 = dy == 0 ? q.p1 : q.p1 / v.row_step();
  for (int i = 0; i < v.rows(); ++i) {
    for (int j = 0; j < q.width; ++j) {
      const int row = dy >= 0 ? i : v.rows() - 1 - i, x = dx >= 0 ? j : q.width - 1 - j;
      const int y = row * v.row_step(), pixel = y * q.width + x;
      const bool starts = x - dx < 0 || x - dx >= q.width || row - dy < 0 || row - dy >= v.rows();
      const int before = (row - dy) * v.row_step() * q.width + x - dx;
      const int p2 = starts ? v.options.p2 : v.p2(x, y, dx, dy);
      int least = 1 << 20;
      for (int d = costs.first(pixel); d <= costs.last(pixel); ++d) {
        int transition = p2;
        if (!starts && costs.has(before, d)) transition = std::min(transition, costs.at(before, d));
        if (!starts && costs.has(before, d - 1)) transition = std::min(transition, costs.at(before, d - 1) + p1);
        if (!starts && costs.has(before, d + 1)) transition = std::min(transition, costs.at(before, d + 1) + p1);
        costs.at(pixel, d) = v.cost(x, y, d) + transition;
        least = std::min(least, costs.at(pixel, d));
      }
      for (int d = costs.first(pixel); d <= costs.last(pixel); ++d) costs.at(pixel, d) -= least;
    }
  }
}

/// The paths of one sweep: half the sum of four, rounded as pairs; the sum of two; at most 255.
Cells half_sum(const View& v, const shared::Band* bands, int paths, int sign) {
  const int directions[4][2] = {{1, 0}, {0, 1}, {1, 1}, {-1, 1}};
  std::vector<Cells> costs;
  for (int r = 0; r < paths / 2; ++r) {
    costs.emplace_back(v.q, bands);
    aggregate(v, sign * directions[r][0], sign * directions[r][1], costs.back());
  }
  Cells sum(v.q, bands);
  for (int p = 0; p < v.q.width * v.q.height; ++p) {
    if (p / v.q.width % v.row_step() != 0) continue;
    for (int d = sum.first(p); d <= sum.last(p); ++d) {
      const auto half = [&](int r) { return (costs[r].at(p, d) + costs[r + 1].at(p, d) + 1) / 2; };
      sum.at(p, d) = std::min(255, paths == 8 ? half(0) + half(2) : costs[0].at(p, d) + costs[1].at(p, d));
    }
  }
  return sum;
}

int count_steps(const shared::SgmParameters& q, Cells& sums, int pixel, int winner, int step) {
  int steps = 0, total = 0;
  for (int d = winner + step; steps < 8 && sums.has(pixel, d); d += step) {
    total += std::max(0, sums.at(pixel, d) - sums.at(pixel, winner));
    if (total >= q.s_max) break;
    ++steps;
  }
  return steps;
}

float offset(Cells& sums, int pixel, int winner) {
  if (!sums.has(pixel, winner - 1) || !sums.has(pixel, winner + 1)) return 0;
  const float before = static_cast<float>(sums.at(pixel, winner - 1)),
              here = static_cast<float>(sums.at(pixel, winner)), after = static_cast<float>(sums.at(pixel, winner + 1));
  const float slope = std::max(before, after) - here;
  return slope > 0 ? std::clamp((before - after) / (2 * slope), -0.5f, 0.5f) : 0.0f;
}

/// The right view read off the left one's sums: of the left pixels that a right one may be, that with the least sum,
/// of whose own least one three quarters do not count, and twelve times its matching cost; of those the nearest.
void read_off(const View& left, const shared::Band* bands, Cells& sums, testing::HostMaps& maps) {
  const shared::SgmParameters& q = left.q;
  constexpr int kNone = 65535, kMost = 3 * 510 / 4 + 2;
  std::vector<std::pair<int, int>> least(static_cast<std::size_t>(q.width) * q.height, {kNone, 0});
  for (int y = 0; y < q.height; ++y) {
    for (int x = 0; x < q.width; ++x) {
      const int pixel = y * q.width + x;
      int least_sum = kNone;
      for (int d = bands[pixel].first; d <= bands[pixel].last; ++d) least_sum = std::min(least_sum, sums.at(pixel, d));
      for (int d = bands[pixel].first; d <= bands[pixel].last; ++d) {
        if (x - d < 0 || x - d >= q.width) continue;
        const int behind = q.min_disparity + q.disparities - 1 - d;
        auto& seen = least[pixel - d];
        seen = std::min(seen, {sums.at(pixel, d) - 3 * least_sum / 4 + kMost + 12 * left.cost(x, y, d), behind});
      }
    }
  }
  for (const auto& [rank, behind] : least) {
    const int disparity = q.min_disparity + q.disparities - 1 - behind;
    maps.disparity.push_back(rank == kNone ? EGOSGM_INVALID_DISPARITY : static_cast<float>(disparity));
    maps.variance.push_back(rank == kNone ? 0 : q.variance_floor);
  }
}

}  // namespace

testing::HostMaps banded_sgm(shared::ImageSize size, shared::DisparityRange range, const BandedSgmOptions& options,
                             const std::vector<std::uint64_t> (&codes)[2], const std::vector<std::uint16_t>& grey,
                             const std::vector<shared::Band>& bands, bool reads_off, cl_int row_step) {
  const shared::SgmParameters q{.width = size.width,
                                .height = size.height,
                                .min_disparity = range.min,
                                .disparities = range.count,
                                .padding = 0,
                                .p1 = options.p1,
                                .s_max = options.s_max,
                                .variance_floor = options.variance_floor_px2,
                                .variance_per_step = options.variance_per_step_px2,
                                .variance_per_square = options.variance_per_square_px2,
                                .reads_off = reads_off,
                                .row_step = row_step,
                                .first_view = 0};
  testing::HostMaps maps;
  for (int view = 0; view < 2; ++view) {
    const View v{q,           view,
                 options,     grey.data() + static_cast<std::size_t>(view) * q.width * q.height,
                 codes[view], codes[1 - view]};
    const shared::Band* band = bands.data() + static_cast<std::size_t>(view) * q.width * q.height;
    Cells sums = half_sum(v, band, options.paths, 1), backward = half_sum(v, band, options.paths, -1);
    for (int p = 0; p < q.width * q.height; ++p) {
      for (int d = sums.first(p); d <= sums.last(p); ++d) sums.at(p, d) += backward.at(p, d);
      int winner = band[p].first;
      for (int d = band[p].first; d <= band[p].last; ++d) {
        if (sums.at(p, d) < sums.at(p, winner)) winner = d;
      }
      maps.disparity.push_back(static_cast<float>(winner) + offset(sums, p, winner));
      const int steps = count_steps(q, sums, p, winner, 1) + count_steps(q, sums, p, winner, -1);
      const float n = static_cast<float>(steps);
      maps.variance.push_back(q.variance_floor + n * (q.variance_per_step + q.variance_per_square * n));
    }
    if (q.reads_off) {
      read_off(v, band, sums, maps);
      break;
    }
  }
  return without_absent_rows(size, row_step, maps);
}

}  // namespace egosgm::reference
