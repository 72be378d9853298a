// SPDX-License-Identifier: Apache-2.0
// Semi-global matching in a band per pixel, the way for GPUs: LANES work-items follow a path across the image, LINES
// paths a work-group. The same bits as banded_sgm.cl, whose head explains the recurrence and the sums.
//
// Disparities are dealt out in quads of four: quad k of the range belongs to lane k % LANES, whatever the band, which
// may begin and end within one. So a lane keeps the costs of its quads in registers from pixel to pixel, gives its
// neighbours only the first and the last of each, and asks the others for nothing but the minimum. Costs come from the
// codes; there is no cost volume.
//
// Three launches: horizontal and vertical paths, one diagonal, the other; forward and backward ones together. They do
// to a cell's partial sums: first = L0, second = L1; first = mean(first, second), second = L2; first += mean(second, L3).
#include "sgm_cells.h"

// lint: MAX_CHUNKS=8 PATHS=4 CODE_BYTES=8 COST_SCALE=1 COST_SAD=0 LANES=8 LINES=4 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=4 CODE_BYTES=4 COST_SCALE=2 COST_SAD=1 LANES=1 LINES=1 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=8 COST_SCALE=1 COST_SAD=0 LANES=32 LINES=1 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=4 COST_SCALE=2 COST_SAD=0 LANES=8 LINES=4 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=4 COST_SCALE=2 COST_SAD=1 LANES=8 LINES=4 PIXELS=1

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

#define QUAD 4
#define QUADS (MAX_CHUNKS * EGOSGM_LANES / QUAD)
#define QUADS_A_LANE ((QUADS + LANES - 1) / LANES)
#define SLOT (QUADS_A_LANE * LANES + 2)
#define MAX_STEPS 8
// A cost that is absent: less the largest minimum (254), it still exceeds the largest P2 (190) and what 8 bits hold.
#define ABSENT 511
#define NO_WINNER 0xffffffffu

#if QUADS_A_LANE <= 8
#define UNROLLED _Pragma("unroll")
#else
#define UNROLLED
#endif

#if CODE_BYTES == 4
typedef uint Code;
typedef uint4 Codes;
#else
typedef ulong Code;
typedef ulong4 Codes;
#endif

#include "path.h"

// A quad more a pixel than its band has, as it may begin within one.
inline size_t cells_of(const size_t row_start, const size_t pixel, const uint offset) {
  return (row_start * MAX_CHUNKS + offset) * EGOSGM_LANES + QUAD * pixel;
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

inline bool holds(const Pixel pixel, const int quad) {
  return QUAD * quad + QUAD > pixel.first && QUAD * quad < pixel.end;
}

// A quad's place in the sums.
inline size_t cell_of(const Pixel pixel, const int quad) { return pixel.cells + QUAD * (quad - pixel.first / QUAD); }

#if COST_SAD
inline uint difference(global const Code* own, global const Code* other, const long above, const long below) {
  uint sum = 0;
  for (int dx = -1; dx <= 1; ++dx) {
    sum += abs_diff(own[above + dx], other[above - dx]) + abs_diff(own[dx], other[-dx]) +
           abs_diff(own[below + dx], other[below - dx]);
  }
  return min(sum / 9, (uint)EGOSGM_MAX_COST);
}
#endif

// The codes of a quad of matches from `other` on; with COST_SAD their costs. `y`: the pixel's row.
inline Codes fetch_quad(const SgmParameters q, global const Code* own, global const Code* other, const int y) {
#if COST_SAD
  const long stride = (long)q.width + 2 * (long)q.padding;
  const long above = y > 0 ? -stride : 0, below = y + 1 < q.height ? stride : 0;
  return (Codes)(difference(own, other, above, below), difference(own, other + 1, above, below),
                 difference(own, other + 2, above, below), difference(own, other + 3, above, below));
#else
  return vload4(0, other);
#endif
}

inline int4 cost_of(const Code own, const Codes others) {
#if COST_SAD
  return convert_int4(others);
#else
  return convert_int4(popcount((Codes)(own) ^ others)) * COST_SCALE;
#endif
}

inline Matches fetch(const SgmParameters q, const Path path, const int i, const Pixel pixel, const int lane) {
  Matches matches;
  global const Code* own = path.own + i * path.own_step;
  matches.own = pixel.end > 0 ? own[0] : 0;
  UNROLLED for (int v = 0; v < QUADS_A_LANE; ++v) {
    const int quad = lane + v * LANES;
    matches.others[v] = 0;
    if (holds(pixel, quad)) {
      global const Code* other = path.other + i * path.other_step + QUAD * quad;
      matches.others[v] = fetch_quad(q, own, other, path.y + i * path.y_step);
    }
  }
  return matches;
}

// The least value of a line's lanes, by one barrier or more for all work-items of the group. `minima`: 2 * LANES
// values, others than the call before was given.
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

// Adds a path's costs to the partial sums of a cell; `stage` 0: horizontal (and `vertical`) paths, 1 and 2: the
// diagonals.
inline void add_path(const int stage, const bool vertical, const uchar4 costs, const size_t cell, global uchar* first,
                     global uchar* second) {
  global uchar4* to_first = (global uchar4*)(first + cell);
  global uchar4* to_second = (global uchar4*)(second + cell);
  if (stage == 0) {
    *(vertical ? to_second : to_first) = costs;
  } else if (stage == 1) {
    *to_first = rhadd(*to_first, *to_second);
    *to_second = costs;
  } else {
    *to_first = add_sat(*to_first, rhadd(*to_second, costs));
  }
}

// Group ids 1 and 2: the lines, LINES at a time; views, and after them the same views backward.
KERNEL __attribute__((reqd_work_group_size(LANES * LINES, 1, 1))) void follow_paths(
    const SgmParameters q, const int stage, const int views, global const uint* codes, global const uchar* penalties,
    global const Band* bands, global const uint* offsets, global uchar* forward_first, global uchar* forward_second,
    global uchar* backward_first, global uchar* backward_second) {
  // Of each quad the first cost and, in the upper 16 bits, the last; of this pixel and of the one before.
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
  int longest = 0;
  for (int i = 0; i < LINES; ++i) longest = max(longest, line_of(q, direction, first_line + i).length);
  const Path path = path_of(q, direction, backward, view, line_of(q, direction, first_line + line), codes, penalties);

  for (int i = lane; i < SLOT; i += LANES) edges[0][line][i] = edges[1][line][i] = ABSENT << 16 | ABSENT;
  barrier(CLK_LOCAL_MEM_FENCE);

  int4 costs[QUADS_A_LANE];
  UNROLLED for (int v = 0; v < QUADS_A_LANE; ++v) costs[v] = ABSENT;
  // What a pixel needs is loaded while the one before is under way, its band one pixel earlier still.
  Pixel pixel = pixel_at(q, path, 0, bands, offsets), next = pixel_at(q, path, 1, bands, offsets);
  Matches matches = fetch(q, path, 0, pixel, lane);
  int least = 0;
  for (int i = 0; i < longest; ++i) {
    local const uint* before = edges[(i + 1) % 2][line];
    local uint* after = edges[i % 2][line];
    int4 lowest = ABSENT;
    UNROLLED for (int v = 0; v < QUADS_A_LANE; ++v) {
      const int quad = lane + v * LANES;
      int4 path_costs = ABSENT;
      if (holds(pixel, quad)) {
        const int4 same = costs[v];
        const int4 below = (int4)((int)(before[quad] >> 16) - least, same.xyz),
                   above = (int4)(same.yzw, (int)(before[quad + 2] & 0xffff) - least);
        path_costs =
            cost_of(matches.own, matches.others[v]) + min(min(same, min(below, above) + q.p1), (int4)(pixel.p2));
        const int4 at = QUAD * quad + (int4)(0, 1, 2, 3);
        path_costs = select(path_costs, (int4)(ABSENT), at < pixel.first || at >= pixel.end);
      }
      after[quad + 1] = (uint)path_costs.w << 16 | (uint)path_costs.x;
      lowest = min(lowest, path_costs);
      costs[v] = path_costs;
    }
    matches = fetch(q, path, i + 1, next, lane);
    const Pixel after_next = pixel_at(q, path, i + 2, bands, offsets);
    least = minimum_of_line(minima[i % 2][line], lane, min(min(lowest.x, lowest.y), min(lowest.z, lowest.w)));
    UNROLLED for (int v = 0; v < QUADS_A_LANE; ++v) {
      const int quad = lane + v * LANES;
      costs[v] -= least;
      if (holds(pixel, quad))
        add_path(stage, vertical, convert_uchar4_sat(costs[v]), cell_of(pixel, quad), first, second);
    }
    pixel = next;
    next = after_next;
  }
}

// The partial sums of a pixel's cells, and which of them exist, [first, end).
typedef struct {
  global const uchar *forward_first, *forward_second, *backward_first, *backward_second;
  int first, end;
} Cells;

// Half the sums over all paths, of four cells.
inline ushort4 totals_of(const Cells cells, const int at) {
  uchar4 forward = *(global const uchar4*)(cells.forward_first + at),
         backward = *(global const uchar4*)(cells.backward_first + at);
#if PATHS == 4
  forward = add_sat(forward, *(global const uchar4*)(cells.forward_second + at));
  backward = add_sat(backward, *(global const uchar4*)(cells.backward_second + at));
#endif
  return convert_ushort4(forward) + convert_ushort4(backward);
}

// The same in the upper halves, the index in the lower ones, so that the smallest disparity wins a tie; NO_WINNER
// outside of the band.
inline uint4 allowed_of(const Cells cells, const int at, const int first, const int last) {
  const int4 index = at + (int4)(0, 1, 2, 3);
  const uint4 ranked = convert_uint4(totals_of(cells, at)) << 16 | as_uint4(index);
  return select(ranked, (uint4)(NO_WINNER), index < first || index > last);
}

// The total of one.
inline int total_of(const Cells cells, const int at) {
  uchar forward = cells.forward_first[at], backward = cells.backward_first[at];
#if PATHS == 4
  forward = add_sat(forward, cells.forward_second[at]);
  backward = add_sat(backward, cells.backward_second[at]);
#endif
  return (int)forward + backward;
}

// Steps to one side of the winner until the sums above its own add up to `limit`.
inline int count_steps(const Cells cells, const int winner, const int total, const int step, const int limit) {
  int sum = 0, steps = 0;
  for (int at = winner + step; steps < MAX_STEPS && at >= cells.first && at < cells.end; at += step) {
    sum += max(0, total_of(cells, at) - total);
    if (sum >= limit) break;
    ++steps;
  }
  return steps;
}

// Offers a left pixel to the right ones that a quad of its cells says it may be. `totals`: in the upper halves, the
// whole of it NO_WINNER where the band has no cell. `least`: of all its totals. `lane`: of the first disparity in the
// range.
inline void offer(const SgmParameters q, const int x, const int y, const int lane, const uint4 totals, const uint least,
                  global const uint* all_codes, global uint* ranks) {
  const size_t stride = (size_t)q.width + 2 * (size_t)q.padding;
  global const Code* codes = (global const Code*)all_codes + q.padding;
  global const Code* own = codes + y * stride + x;
  global const Code* other = codes + ((size_t)q.height + y) * stride + (q.width - 1 - x) + q.min_disparity + lane;
  const ushort4 costs = convert_ushort4(cost_of(own[0], fetch_quad(q, own, other, y)));
  uint each[QUAD];
  const uint4 behind = convert_uint4(q.disparities - 1 - lane - (int4)(0, 1, 2, 3));
  vstore4(convert_uint4(RANK(convert_ushort4(totals >> 16), least, costs)) << 16 | behind, 0, each);
  global uint* seen = ranks + y * stride + q.padding + x - q.min_disparity - lane;
  for (int i = 0; i < QUAD; ++i) atomic_min(seen - i, each[i]);
}

// LANES work-items look at a pixel's cells, one of them at the winner's neighbours. Group ids: LINES pixels of a row,
// row, view.
KERNEL __attribute__((reqd_work_group_size(LANES * LINES, 1, 1))) void find_winners(
    const SgmParameters q, global const uint* codes, global const Band* bands, global const uint* offsets,
    global const uchar* forward_first, global const uchar* forward_second, global const uchar* backward_first,
    global const uchar* backward_second, global float* disparities, global float* variances,
    global uchar* doubtful, global uint* ranks) {
  local uint minima[LINES][2 * LANES];
  const int lane = get_local_id(0) % LANES, line = get_local_id(0) / LANES;
  const int x = get_group_id(0) * LINES + line;
  const size_t row_start = ((size_t)get_group_id(2) * q.height + get_group_id(1)) * q.width;
  const bool is_inside = x < q.width;
  const size_t pixel = row_start + (is_inside ? x : 0);
  const Band band = band_at(bands, pixel);
  const size_t first_cell = cells_of(row_start, pixel, offsets[pixel]);
  const int first_lane = band.origin - q.min_disparity, first_of_quad = first_lane % QUAD;
  const int cells_origin = band.origin - first_of_quad;
  const Cells cells = {forward_first + first_cell,
                       forward_second + first_cell,
                       backward_first + first_cell,
                       backward_second + first_cell,
                       first_of_quad,
                       first_of_quad + min(band.chunks * EGOSGM_LANES, q.disparities - first_lane)};

  uint best = NO_WINNER;
  const int first = band.first - cells_origin, last = band.last - cells_origin;
  for (int at = QUAD * lane; is_inside && at <= last; at += QUAD * LANES) {
    const uint4 allowed = allowed_of(cells, at, first, last);
    best = min(best, min(min(allowed.x, allowed.y), min(allowed.z, allowed.w)));
  }
  best = minimum_of_line(minima[line], lane, best);
  for (int at = QUAD * lane; q.reads_off && is_inside && at <= last; at += QUAD * LANES) {
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
