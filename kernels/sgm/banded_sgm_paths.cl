// SPDX-License-Identifier: Apache-2.0
// Semi-global matching in a band per pixel, the way for GPUs: LANES work-items follow a path across the image, LINES
// paths a work-group. The same bits as banded_sgm.cl, whose head explains the recurrence and the sums.
//
// Work-items that share a path deal out the band of each pixel, with a barrier a pixel of each of the LINES paths
// (path_together.h). Costs come from the codes; there is no cost volume.
//
// Forward and backward paths of two directions run together. Of four, these are horizontal and vertical ones: they
// leave L0 in `first` and L1 in `second`. Eight take two passes: horizontal and falling ones, then vertical and rising
// ones, which leave mean(L0, L1) in `first` and mean(L2, L3) in `second`.
#include "sgm_cells.h"

// lint: MAX_CHUNKS=8 PATHS=4 CODE_BYTES=8 COST_SCALE=1 COST_SAD=0 LANES=8 LINES=4 VECTOR=16 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=4 CODE_BYTES=4 COST_SCALE=2 COST_SAD=1 LANES=1 LINES=1 VECTOR=16 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=8 COST_SCALE=1 COST_SAD=0 LANES=32 LINES=1 VECTOR=4 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=4 COST_SCALE=2 COST_SAD=0 LANES=4 LINES=8 VECTOR=4 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=4 COST_SCALE=2 COST_SAD=1 LANES=8 LINES=4 VECTOR=4 PIXELS=1

#ifndef MAX_CHUNKS
#error "MAX_CHUNKS: chunks of EGOSGM_LANES disparities in the whole range"
#endif
#ifndef PATHS
#error "PATHS: 4 or 8"
#endif
#ifndef COST_SCALE
#error "COST_SCALE: what a bit of Hamming distance costs"
#endif
#ifndef COST_SAD
#error "COST_SAD: 0 for the Hamming distance of codes, 1 for a 3x3 sum of absolute differences of grey values"
#endif
#ifndef LANES
#error "LANES: work-items a path, a power of two"
#endif
#ifndef LINES
#error "LINES: paths a work-group"
#endif
#ifndef VECTOR
#error "VECTOR: disparities of a work-item at once, 4 or 16"
#endif

#define VECTORS ((MAX_CHUNKS * EGOSGM_LANES + VECTOR - 1) / VECTOR)
// A cost that is absent: it exceeds the largest P2 (190) and what 8 bits hold by more than the largest minimum (254).
#define ABSENT 511

#include "path.h"
#include "path_sums.h"
#include "path_together.h"

// Group ids 1 and 2: the lines of the pass's two directions, LINES at a time; views, and after them the same views
// backward.
KERNEL __attribute__((reqd_work_group_size(LANES * LINES, 1, 1))) void follow_paths(
    const SgmParameters q, const int pass, const int views, global const uint* codes, global const uchar* penalties,
    global const Band* bands, global const uint* offsets, global uchar* forward_first, global uchar* forward_second,
    global uchar* backward_first, global uchar* backward_second) {
  const int line = get_local_id(0) / LANES;
  const bool backward = (int)get_group_id(2) >= views;
  const int view = (int)get_group_id(2) - (backward ? views : 0);

  const int group = get_group_id(1), groups_of_first = ((pass == 0 ? q.height : q.width) + LINES - 1) / LINES;
  const bool is_second = group >= groups_of_first;
  const int direction = pass + (is_second ? PATHS / 4 : 0);
  const int first_line = (is_second ? group - groups_of_first : group) * LINES;
  const int rows = rows_of(q);
  const Path path = path_of(q, direction, backward, view, line_of(q.width, rows, direction, first_line + line));
  const Pixels pixels = {(global const Code*)codes, penalties, bands, offsets};
  global uchar* const first = backward ? backward_first : forward_first;
  global uchar* const second = backward ? backward_second : forward_second;
  const Sums sums = {is_second ? second : first, pass > 0};
  const int lane = get_local_id(0) % LANES;
  // Of this pixel and of the one before.
  local Totals kept[2][LINES][VECTORS];
  local uint minima[2][LINES][MINIMA];
  int longest = 0;
  _Pragma("unroll 1") for (int i = 0; i < LINES; ++i) longest =
      max(longest, line_of(q.width, rows, direction, first_line + i).length);
  follow_together(q, path, longest, lane, pixels, sums, kept[0][line], minima[0][line]);
}

// Offers ranks to right pixels: that of lane i to the one i before `seen`.
static inline void offer_to(global uint* seen, const Ranks offered) {
  uint each[VECTOR];
  OF(vstore, VECTOR)(offered, 0, each);
  for (int i = 0; i < VECTOR; ++i) atomic_min(seen - i, each[i]);
}

// Offers a left pixel to the right ones that a vector of its cells says it may be. `totals`: in the upper halves, the
// whole of it NO_WINNER where the band has no cell. `least`: of all its totals. `lane`: of the first disparity in the
// range.
static inline void offer(const SgmParameters q, const int x, const int y, const int lane, const Ranks totals,
                         const uint least, global const uint* all_codes, global uint* ranks) {
  const size_t stride = (size_t)q.width + 2 * (size_t)q.padding;
  global const Code* codes = (global const Code*)all_codes + q.padding;
  global const Code* own = codes + y * stride + x;
  global const Code* other = codes + ((size_t)q.height + y) * stride + (q.width - 1 - x) + q.min_disparity + lane;
  const Totals costs = TOTALS_OF(cost_of(own[0], fetch_vector(q, own, other, y)));
  const Ranks behind = (Ranks)((uint)(q.disparities - 1 - lane)) - (Ranks)(INDEX);
  const Ranks offered = RANKS_OF(RANK(TOTALS_OF(totals >> (Ranks)(16)), least, costs)) << (Ranks)(16) | behind;
  offer_to(ranks + y * stride + q.padding + x - q.min_disparity - lane, offered);
}

// LANES work-items look at a pixel's cells, one of them at the winner's neighbours.
static inline void find_winner(const SgmParameters q, const int x, const int y, const int view, const int lane,
                               local uint* minima, global const uint* codes, global const Band* bands,
                               global const uint* offsets, global const uchar* forward_first,
                               global const uchar* forward_second, global const uchar* backward_first,
                               global const uchar* backward_second, global float* disparities, global float* variances,
                               global uint* ranks) {
  const size_t row_start = ((size_t)view * q.height + y) * q.width;
  const bool is_inside = x < q.width;
  const size_t pixel = row_start + (is_inside ? x : 0);
  const Band band = band_at(bands, pixel);
  const size_t first_cell = cells_of(row_start, pixel, offsets[pixel]);
  const int first_lane = band.origin - q.min_disparity, first_of_vector = first_lane - first_cell_of(first_lane);
  const int cells_origin = band.origin - first_of_vector;
  const Cells cells = {forward_first + first_cell,
                       forward_second + first_cell,
                       backward_first + first_cell,
                       backward_second + first_cell,
                       first_of_vector,
                       first_of_vector + min(band.chunks * EGOSGM_LANES, q.disparities - first_lane)};

  uint best = NO_WINNER;
  const int first = band.first - cells_origin, last = band.last - cells_origin;
  for (int at = VECTOR * lane; is_inside && at <= last; at += VECTOR * LANES) {
    best = min(best, least_rank(allowed_of(cells, at, first, last)));
  }
  best = minimum_of_line(minima, lane, best);
  for (int at = VECTOR * lane; q.reads_off && is_inside && at <= last; at += VECTOR * LANES) {
    offer(q, x, y, cells_origin - q.min_disparity + at, allowed_of(cells, at, first, last), best >> 16, codes, ranks);
  }
  if (is_inside && lane == 0) {
    const int total = best >> 16, winner = best & 0xffff;
    const bool fits = winner > cells.first && winner + 1 < cells.end;
    const int rise_before = fits ? total_of(cells, winner - 1) - total : 0,
              rise_after = fits ? total_of(cells, winner + 1) - total : 0;
    const int steps = count_steps(cells, winner, total, -1, q.s_max) + count_steps(cells, winner, total, 1, q.s_max);
    disparities[pixel] = refined(cells_origin + winner, rise_before, rise_after);
    variances[pixel] = matching_variance(q, steps);
  }
}

// Group ids: LINES pixels of a row, a row of those that are matched, a view.
KERNEL __attribute__((reqd_work_group_size(LANES * LINES, 1, 1))) void find_winners(
    const SgmParameters q, global const uint* codes, global const Band* bands, global const uint* offsets,
    global const uchar* forward_first, global const uchar* forward_second, global const uchar* backward_first,
    global const uchar* backward_second, global float* disparities, global float* variances, global uint* ranks) {
  local uint minima[LINES][MINIMA];
  const int lane = get_local_id(0) % LANES, line = get_local_id(0) / LANES;
  const int view = get_group_id(2), y = (int)get_group_id(1) * q.row_step;
  if (y >= q.height) return;
  find_winner(q, get_group_id(0) * LINES + line, y, view, lane, minima[line], codes, bands, offsets, forward_first,
              forward_second, backward_first, backward_second, disparities, variances, ranks);
}
