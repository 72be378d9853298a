// SPDX-License-Identifier: Apache-2.0
// Semi-global matching in a band per pixel, the way for GPUs: LANES work-items follow a path across the image, LINES
// paths a work-group. The same bits as banded_sgm.cl, whose head explains the recurrence and the sums.
//
// Disparities are dealt out in vectors (vector.h): vector k of the range belongs to lane k % LANES, whatever the band,
// which may begin and end within one. So a lane keeps the costs of its vectors in registers from pixel to pixel, gives
// its neighbours only the first and the last of each, and asks the others for nothing but the minimum: a barrier or two
// a pixel, and none where a lane has a path to itself. Costs come from the codes; there is no cost volume.
//
// Three launches: horizontal and vertical paths, one diagonal, the other; forward and backward ones together. They do
// to a cell's partial sums: first = L0, second = L1; first = mean(first, second), second = L2; first += mean(second,
// L3).
#include "sgm_cells.h"

// lint: MAX_CHUNKS=8 PATHS=4 CODE_BYTES=8 COST_SCALE=1 COST_SAD=0 LANES=8 LINES=4 VECTOR=16 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=4 CODE_BYTES=4 COST_SCALE=2 COST_SAD=1 LANES=1 LINES=1 VECTOR=16 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=8 COST_SCALE=1 COST_SAD=0 LANES=32 LINES=1 VECTOR=4 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=4 COST_SCALE=2 COST_SAD=0 LANES=8 LINES=4 VECTOR=4 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=4 COST_SCALE=2 COST_SAD=1 LANES=8 LINES=4 VECTOR=4 PIXELS=1

#ifndef MAX_CHUNKS
#error "MAX_CHUNKS: chunks of EGOSGM_LANES disparities in the whole range"
#endif
#ifndef PATHS
#error "PATHS: 4 or 8"
#endif
#ifndef CODE_BYTES
#error "CODE_BYTES: 4 or 8, the size of a code"
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
#define VECTORS_A_LANE ((VECTORS + LANES - 1) / LANES)
#define SLOT (VECTORS_A_LANE * LANES + 2)
// A cost that is absent: less the largest minimum (254), it still exceeds the largest P2 (190) and what 8 bits hold.
#define ABSENT 511

#if VECTORS_A_LANE <= 8
#define UNROLLED _Pragma("unroll")
#else
#define UNROLLED
#endif

#include "path.h"
#include "path_sums.h"

// Where a work-item is a work-group, it takes all winners of a row, and nobody else offers to the right view's row.
#define ONE_A_ROW (LANES * LINES == 1)

// A pixel's vectors have so many cells more than its band, as it may begin and end within one.
#define SPARE_CELLS (VECTOR == 4 ? 4 : VECTOR + EGOSGM_LANES)

inline size_t cells_of(const size_t row_start, const size_t pixel, const uint offset) {
  return (row_start * MAX_CHUNKS + offset) * EGOSGM_LANES + SPARE_CELLS * pixel;
}

inline Pixel pixel_at(const SgmParameters q, const Path path, const int i, global const Band* bands,
                      global const uint* offsets) {
  Pixel pixel = {0, 0, 0, 0};
  if (i < path.length) {
    const size_t at = path.pixel + i * path.pixel_step;
    const size_t row_start = at - (path.x + i * path.x_step);
    // Where a path begins, any P2 gives the same.
    pixel.p2 = path.penalties[4 * (i > 0 ? at + path.penalty_offset : at)];
    const Band band = band_at(bands, at);
    pixel.first = band.origin - q.min_disparity;
    pixel.end = min(pixel.first + band.chunks * EGOSGM_LANES, q.disparities);
    pixel.cells = cells_of(row_start, at, offsets[at]);
  }
  return pixel;
}

inline bool holds(const Pixel pixel, const int vector) {
  return VECTOR * vector + VECTOR > pixel.first && VECTOR * vector < pixel.end;
}

// A vector's place in the sums.
inline size_t cell_of(const Pixel pixel, const int vector) {
  return pixel.cells + VECTOR * (vector - pixel.first / VECTOR);
}

inline Matches fetch(const SgmParameters q, const Path path, const int i, const Pixel pixel, const int lane) {
  Matches matches;
  global const Code* own = path.own + i * path.own_step;
  matches.own = pixel.end > 0 ? own[0] : 0;
  UNROLLED for (int v = 0; v < VECTORS_A_LANE; ++v) {
    const int vector = lane + v * LANES;
    matches.others[v] = 0;
    if (holds(pixel, vector)) {
      global const Code* other = path.other + i * path.other_step + VECTOR * vector;
      matches.others[v] = fetch_vector(q, own, other, path.y + i * path.y_step);
    }
  }
  return matches;
}

// The least value of a line's lanes, by one barrier or more for all work-items of the group. `minima`: 2 * LANES
// values, others than the call before was given.
#if LANES == 1
inline uint minimum_of_line(local uint* minima, const int lane, const uint value) { return value; }
#else
inline uint minimum_of_line(local uint* minima, const int lane, const uint value) {
  minima[lane] = value;
  int count = LANES;
  for (; count > 8; count /= 8) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane < count / 8) {
      uint least = minima[8 * lane];
      for (int i = 1; i < 8; ++i) least = min(least, minima[8 * lane + i]);
      minima[count + lane] = least;
    }
    minima += count;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  uint least = minima[0];
  for (int i = 1; i < count; ++i) least = min(least, minima[i]);
  return least;
}
#endif

// Adds a path's costs to the partial sums of a cell; `stage` 0: horizontal (and `vertical`) paths, 1 and 2: the
// diagonals.
inline void add_path(const int stage, const bool vertical, const Bytes costs, const size_t cell, global uchar* first,
                     global uchar* second) {
  if (stage == 0) {
    store(costs, (vertical ? second : first) + cell);
  } else if (stage == 1) {
    store(mean(load(first + cell), load(second + cell)), first + cell);
    store(costs, second + cell);
  } else {
    store(add_sat(load(first + cell), mean(load(second + cell), costs)), first + cell);
  }
}

// The costs of a pixel's vector less the least of the pixel before. `same`: those of the pixel before, less `least`,
// the least of them; `before`: the edges of its vectors.
inline Costs path_costs(const SgmParameters q, const Pixel pixel, const Costs matching, const Costs same,
                        local const uint* before, const int vector, const int least) {
  const Costs behind = BEHIND((int)(before[vector] >> 16) - least, same),
              ahead = AHEAD(same, (int)(before[vector + 2] & 0xffff) - least);
  const Costs costs = matching + min(min(same, min(behind, ahead) + (Costs)(q.p1)), (Costs)(pixel.p2));
  const Costs at = (Costs)(VECTOR * vector) + (Costs)(INDEX);
  return at < (Costs)(pixel.first) || at >= (Costs)(pixel.end) ? (Costs)(ABSENT) : costs;
}

// Group ids 1 and 2: the lines, LINES at a time; views, and after them the same views backward.
KERNEL __attribute__((reqd_work_group_size(LANES * LINES, 1, 1))) void follow_paths(
    const SgmParameters q, const int stage, const int views, global const uint* codes, global const uchar* penalties,
    global const Band* bands, global const uint* offsets, global uchar* forward_first, global uchar* forward_second,
    global uchar* backward_first, global uchar* backward_second) {
  // Of each vector the first cost and, in the upper 16 bits, the last; of this pixel and of the one before.
  local uint edges[2][LINES][SLOT];
  local uint minima[2][LINES][2 * LANES];
  const int lane = get_local_id(0) % LANES, line = get_local_id(0) / LANES;
  const bool backward = (int)get_group_id(2) >= views;
  const int view = (int)get_group_id(2) - (backward ? views : 0);
  global uchar* first = backward ? backward_first : forward_first;
  global uchar* second = backward ? backward_second : forward_second;

  const int group = get_group_id(1), row_groups = (q.height + LINES - 1) / LINES;
  const bool vertical = stage == 0 && group >= row_groups;
  const int direction = stage > 0 ? stage + 1 : vertical ? 1 : 0;
  const int first_line = (vertical ? group - row_groups : group) * LINES;
  const Path path = path_of(q, direction, backward, view, line_of(q, direction, first_line + line), codes, penalties);
#if LANES == 1
  const int longest = path.length;
#else
  int longest = 0;
  for (int i = 0; i < LINES; ++i) longest = max(longest, line_of(q, direction, first_line + i).length);
#endif

  for (int i = lane; i < SLOT; i += LANES) edges[0][line][i] = edges[1][line][i] = ABSENT << 16 | ABSENT;
#if LANES > 1
  barrier(CLK_LOCAL_MEM_FENCE);
#endif

  Costs costs[VECTORS_A_LANE];
  UNROLLED for (int v = 0; v < VECTORS_A_LANE; ++v) costs[v] = ABSENT;
  // What a pixel needs is loaded while the one before is under way, its band one pixel earlier still.
  Pixel pixel = pixel_at(q, path, 0, bands, offsets), next = pixel_at(q, path, 1, bands, offsets);
  Matches matches = fetch(q, path, 0, pixel, lane);
  int least = 0;
  for (int i = 0; i < longest; ++i) {
    local const uint* before = edges[(i + 1) % 2][line];
    local uint* after = edges[i % 2][line];
    Costs lowest = ABSENT;
    UNROLLED for (int v = 0; v < VECTORS_A_LANE; ++v) {
      const int vector = lane + v * LANES;
      costs[v] = holds(pixel, vector)
                     ? path_costs(q, pixel, cost_of(matches.own, matches.others[v]), costs[v], before, vector, least)
                     : (Costs)(ABSENT);
      after[vector + 1] = (uint)LAST(costs[v]) << 16 | (uint)costs[v].s0;
      lowest = min(lowest, costs[v]);
    }
    matches = fetch(q, path, i + 1, next, lane);
    const Pixel after_next = pixel_at(q, path, i + 2, bands, offsets);
    least = minimum_of_line(minima[i % 2][line], lane, least_cost(lowest));
    UNROLLED for (int v = 0; v < VECTORS_A_LANE; ++v) {
      const int vector = lane + v * LANES;
      costs[v] -= (Costs)(least);
      if (holds(pixel, vector))
        add_path(stage, vertical, BYTES_OF(min(costs[v], (Costs)(255))), cell_of(pixel, vector), first, second);
    }
    pixel = next;
    next = after_next;
  }
}

// Offers ranks to right pixels: that of lane i to the one i before `seen`.
#if ONE_A_ROW
inline void offer_to(global uint* seen, const Ranks offered) {
  global PackedRanks* at = (global PackedRanks*)(seen - (VECTOR - 1));
  at->ranks = min(at->ranks, BACKWARD(offered));
}
#else
inline void offer_to(global uint* seen, const Ranks offered) {
  uint each[VECTOR];
  OF(vstore, VECTOR)(offered, 0, each);
  for (int i = 0; i < VECTOR; ++i) atomic_min(seen - i, each[i]);
}
#endif

// Offers a left pixel to the right ones that a vector of its cells says it may be. `totals`: in the upper halves, the
// whole of it NO_WINNER where the band has no cell. `least`: of all its totals. `lane`: of the first disparity in the
// range.
inline void offer(const SgmParameters q, const int x, const int y, const int lane, const Ranks totals, const uint least,
                  global const uint* all_codes, global uint* ranks) {
  const size_t stride = (size_t)q.width + 2 * (size_t)q.padding;
  global const Code* codes = (global const Code*)all_codes + q.padding;
  global const Code* own = codes + y * stride + x;
  global const Code* other = codes + ((size_t)q.height + y) * stride + (q.width - 1 - x) + q.min_disparity + lane;
  const Totals costs = TOTALS_OF(cost_of(own[0], fetch_vector(q, own, other, y)));
  const Ranks behind = (Ranks)((uint)(q.disparities - 1 - lane)) - (Ranks)(INDEX);
  const Ranks offered = RANKS_OF(RANK(TOTALS_OF(totals >> (Ranks)(16)), least, costs)) << (Ranks)(16) | behind;
  offer_to(ranks + y * stride + q.padding + x - q.min_disparity - lane, offered);
}

// LANES work-items look at a pixel's cells, one of them at the winner's neighbours. Group ids 1 and 2: row, view.
inline void find_winner(const SgmParameters q, const int x, const int lane, local uint* minima,
                        global const uint* codes, global const Band* bands, global const uint* offsets,
                        global const uchar* forward_first, global const uchar* forward_second,
                        global const uchar* backward_first, global const uchar* backward_second,
                        global float* disparities, global float* variances, global uchar* doubtful,
                        global uint* ranks) {
  const size_t row_start = ((size_t)get_group_id(2) * q.height + get_group_id(1)) * q.width;
  const bool is_inside = x < q.width;
  const size_t pixel = row_start + (is_inside ? x : 0);
  const Band band = band_at(bands, pixel);
  const size_t first_cell = cells_of(row_start, pixel, offsets[pixel]);
  const int first_lane = band.origin - q.min_disparity, first_of_vector = first_lane % VECTOR;
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
    offer(q, x, (int)get_group_id(1), cells_origin - q.min_disparity + at, allowed_of(cells, at, first, last),
          best >> 16, codes, ranks);
  }
  if (is_inside && lane == 0) {
    const int total = best >> 16, winner = best & 0xffff;
    const bool fits = winner > cells.first && winner + 1 < cells.end;
    const int rise_before = fits ? total_of(cells, winner - 1) - total : 0,
              rise_after = fits ? total_of(cells, winner + 1) - total : 0;
    const int steps = count_steps(cells, winner, total, -1, q.s_max) + count_steps(cells, winner, total, 1, q.s_max);
    disparities[pixel] = refined(cells_origin + winner, rise_before, rise_after);
    doubtful[pixel] = falls_on(q, rise_before, rise_after);
    variances[pixel] = matching_variance(q, steps, doubtful[pixel]);
  }
}

// Group id 0: LINES pixels of a row; where a work-item is a group, it takes the whole row.
KERNEL __attribute__((reqd_work_group_size(LANES * LINES, 1, 1))) void find_winners(
    const SgmParameters q, global const uint* codes, global const Band* bands, global const uint* offsets,
    global const uchar* forward_first, global const uchar* forward_second, global const uchar* backward_first,
    global const uchar* backward_second, global float* disparities, global float* variances, global uchar* doubtful,
    global uint* ranks) {
  local uint minima[LINES][2 * LANES];
  const int lane = get_local_id(0) % LANES, line = get_local_id(0) / LANES;
  const int begin = get_group_id(0) * LINES + line, end = ONE_A_ROW ? q.width : begin + 1;
  for (int x = begin; x < end; ++x) {
    find_winner(q, x, lane, minima[line], codes, bands, offsets, forward_first, forward_second, backward_first,
                backward_second, disparities, variances, doubtful, ranks);
  }
}
