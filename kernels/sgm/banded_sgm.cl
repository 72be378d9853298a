// SPDX-License-Identifier: Apache-2.0
// Semi-global matching (Hirschmueller 2008) in a band per pixel, on diagonal wavefronts.
//
// Four of the eight paths come to a pixel from pixels that a sweep from the top left has done: from the left, the upper
// left, above and the upper right. The other four are the same sweep over the image turned by 180 degrees. So two
// sweeps do it all. They need each other's sums only where both have been: each goes to the middle of the image first,
// the forward one down to it and the backward one up, and then on, over the sums of the other one, to the winners.
//
// In a sweep, a pixel needs the one before it and three of the row above; tiles skewed by a column a row need the tiles
// to the left, above and to the upper right, so all tiles (i, j) with j + 2 i = wave run at once: a launch a wave, a
// work-item a tile. Where a device has no more compute units than there are sweeps, a work-item takes all tiles of a
// sweep up to the middle or from there, row by row, and nobody waits. Where it has no more than the sweeps of a view,
// the views are matched one after the other, in the same memory.
//
// Costs of a path are kept relative to their minimum (recurrence.h), which fits 8 bits. 255 stands for "absent":
// outside the band of the pixel before, or outside the disparity range. The sweep that comes first leaves half the sum
// of its four paths, in 8 bits, in `sums`; the other one adds its own and finds the winner.
//
// A path's costs lie in a slot of their own, at the place of their disparity, and all else in the slot is 255. So a
// pixel reads its predecessor's costs at its own disparities, whatever the predecessor's band was, and then wipes them
// before it writes its own. Vectors hold two chunks, blocks (block.h) one vector or two. The recurrence has a form for
// each width of the band:
//
//   the pixel's band      those before it                         form        a vector holds
//   one chunk, in range   to the left one chunk, above a vector   straight.h  a chunk of two paths, in registers
//   one or two chunks     any                                     narrow.h    a path
//   a block of vectors    any                                     one_block.h a path
//   more                  any                                     wide.h      a block of a path, in two passes
// banded_sgm_paths.cl has one form for all bands, path_together.h.
//
// If the right view comes from the left view's sums, the sweep that finds the winners leaves at each right pixel the
// least rank of the left pixels that it may be (sgm_cells.h).

#ifndef __ENDIAN_LITTLE__
#error "bands and penalties are read as words: a little-endian device"
#endif

// lint: MAX_CHUNKS=8 PATHS=4 CODE_BYTES=8 COST_SCALE=1 COST_SAD=0 PARTIAL_CHUNKS=1 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=16
// lint: MAX_CHUNKS=8 PATHS=4 CODE_BYTES=4 COST_SCALE=2 COST_SAD=0 PARTIAL_CHUNKS=1 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=16
// lint: MAX_CHUNKS=8 PATHS=4 CODE_BYTES=4 COST_SCALE=2 COST_SAD=1 PARTIAL_CHUNKS=1 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=16
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=8 COST_SCALE=1 COST_SAD=0 PARTIAL_CHUNKS=1 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=16
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=4 COST_SCALE=2 COST_SAD=0 PARTIAL_CHUNKS=1 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=4 COST_SCALE=2 COST_SAD=0 PARTIAL_CHUNKS=0 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=16
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=4 COST_SCALE=2 COST_SAD=1 PARTIAL_CHUNKS=1 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=16

#ifndef MAX_CHUNKS
#error "MAX_CHUNKS: chunks of EGOSGM_LANES disparities in the whole range"
#endif
#ifndef PATHS
#error "PATHS: 4 or 8"
#endif
#ifndef COST_SCALE
#error "COST_SCALE: what a bit of Hamming distance costs, 1 or 2"
#endif
#ifndef COST_SAD
#error "COST_SAD: 0 for the Hamming distance of codes, 1 for a 3x3 sum of absolute differences of grey values"
#endif
#ifndef PARTIAL_CHUNKS
#error "PARTIAL_CHUNKS: 1 if the range is not a multiple of two chunks"
#endif
#ifndef TILE_WIDTH
#error "TILE_WIDTH: columns of a tile"
#endif
#ifndef TILE_HEIGHT
#error "TILE_HEIGHT: rows of a tile"
#endif

#include "compiler.h"
#include "narrow.h"
#include "one_block.h"
#include "straight.h"
#include "wide.h"

// A pixel with more than one vector, as wide.h takes it.
ALWAYS_INLINE void match_wide(const bool meets, const SgmParameters q, const Row* row, const uint extent,
                              const uint steps, const Place* place) {
  const int origin = origin_of(extent);
  Pixel pixel;
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) {
    const uint start = n > 0 ? place->moved : -(uint)q.min_disparity;
    pixel.at[n] = row->slot[n] + (start + (uint)origin);
    pixel.wiped_at[n] = row->slot[n] + (start + (uint)origin_of(place->wiped[n]));
    pixel.is_wiped[n] = !covers(extent, place->wiped[n]);
    pixel.wiped[n] = place->wiped[n];
    pixel.p1[n] = n > 0 ? row->p1_across_rows.s0 : row->p1.s0;
    pixel.p2[n] = (uchar)(steps >> 8 * n);
  }
  pixel.own = place->own;
  pixel.other = place->other + origin;
  pixel.row_above = row->row_above;
  pixel.row_below = row->row_below;
  pixel.disparities = q.disparities - (int)((uint)origin - (uint)q.min_disparity);
  pixel.cells = place->cells;
  pixel.origin = origin;
  pixel.first = row->bands[place->k].first - origin;
  pixel.last = row->bands[place->k].last - origin;
  pixel.seen = row->seen ? row->seen + place->k - origin : 0;
  match_blocks(meets, chunks_of(extent) / 2, &pixel, &row->windows[place->k], &row->winners[place->k]);
}

// Matches the next pixel that does not go straight, and goes on to the one after it.
ALWAYS_INLINE void match_pixel(const bool meets, const bool backward, const SgmParameters q, const Row* row,
                               const uint extent, const uint steps, Place* place) {
  if (backward) place->cells -= EGOSGM_LANES * chunks_of(extent);
  if (is_narrow(extent)) {
    match_narrow(meets, q, row, extent, steps, place);
#if BLOCK_VECTORS == 2
  } else if (is_block(extent)) {
    match_block(meets, q, row, extent, steps, place);
#endif
  } else {
    match_wide(meets, q, row, extent, steps, place);
  }
  if (!backward) place->cells += EGOSGM_LANES * chunks_of(extent);
  place->wiped[0] = extent;
  place->moved += SLOT;
  go_on(row, place);
}

ALWAYS_INLINE void sweep_row(const bool meets, const bool backward, const SgmParameters q, const Row* row,
                             Place* place) {
  while (place->k != row->end) {
    const uint extent = extent_at(row->bands + place->k);
    place->wiped[3] = extent_at(row->bands + place->k + row->above_right);
    const uint steps = penalties_to(backward, &place->around, row->penalties + place->k, row->above_right);
    if (goes_straight(q, extent, place->wiped)) {
      match_straight(meets, backward, q, row, extent, steps, place);
    } else {
      match_pixel(meets, backward, q, row, extent, steps, place);
    }
  }
}

// A sweep of a view, and what it reads and writes, from the first view that is matched on. In `backward` ones, x and y
// count from the lower right corner; y counts the rows that are matched.
typedef struct {
  int view;                  // of those that are matched
  global const uint* codes;  // of both views
  global const Band* bands;
  global const uint* offsets;  // where a row's cells begin
  global const RowSum* row_sums;
  global const uchar* penalties;
  global uchar *slots, *sums;
  global uint* ranks;  // of the right pixels, if they are kept
  global float *disparities, *variances;
  int row_step, rows;
} Sweep;

// The row y of a sweep, from its pixel `from` to `to`. To the pixels before one on the four paths it is `left`, `above`
// and so on; where there is none, to one whose band and penalty do no harm: wiping some place in the slot, and a step
// from nowhere.
ALWAYS_INLINE Row row_at(const bool meets, const bool backward, const SgmParameters q, const Sweep* sweep, const int y,
                         const int from, const int to) {
  const int width = q.width, height = q.height, step = backward ? -1 : 1;
  const int image_y = (backward ? sweep->rows - 1 - y : y) * sweep->row_step;
  const int image_x = backward ? width - 1 - from : from;
  const size_t first = (size_t)sweep->view * width * height + (size_t)image_y * width + image_x;
  const size_t code_stride = (size_t)width + 2 * (size_t)q.padding;
  global uchar* slots = sweep->slots;
  Row row;
  row.bands = sweep->bands + first;
  row.penalties = (global const uint*)sweep->penalties + first;
  row.slot[0] = slots + (size_t)y * SLOT;
  row.slot[1] = slots + (size_t)(height + from) * SLOT;
#if PATHS == 8
  row.slot[2] = slots + ((long)2 * height + width - y + from) * SLOT;
  row.slot[3] = slots + (size_t)(2 * height + 2 * width + y + from) * SLOT;
#endif
  row.seen = meets && q.reads_off ? sweep->ranks + (size_t)image_y * code_stride + q.padding + image_x : 0;
  row.row_above = image_y > 0 ? -(long)code_stride : 0;
  row.row_below = image_y + 1 < height ? (long)code_stride : 0;
  row.above_right = y > 0 ? step - step * (long)width * sweep->row_step : 0;
  row.end = step * (long)(to - from);
  row.step = step;
  row.code_step = q.first_view + sweep->view == EGOSGM_LEFT ? step : -step;
  row.p1 = (uchar16)((uchar)q.p1);
  row.p1_across_rows = (uchar16)((uchar)p1_across_rows(q.p1, sweep->row_step));
  return row;
}

// The first pixel of a row.
ALWAYS_INLINE Place place_in(const bool backward, const SgmParameters q, const Sweep* sweep, const Row* row,
                             const int y, const int from, const int to) {
  const int width = q.width, height = q.height;
  const int image_y = (backward ? sweep->rows - 1 - y : y) * sweep->row_step;
  const int image_x = backward ? width - 1 - from : from;
  const size_t row_start = (size_t)sweep->view * width * height + (size_t)image_y * width;
  const size_t code_stride = (size_t)width + 2 * (size_t)q.padding;
  const int image = q.first_view + sweep->view;
  const int along = image == EGOSGM_LEFT ? image_x : width - 1 - image_x;
  const long above = y > 0 ? -row->step * (long)width * sweep->row_step : 0, left = from > 0 ? -row->step : 0;
  global const Code* codes = (global const Code*)sweep->codes + q.padding;
  // The sums move along with the pixel; a backward sweep comes from their end. Where offsets and bands do not belong
  // together, after a kernel that failed, it stays within the sums, which begin with a row that is nobody's.
  const int cells_of_row = width * MAX_CHUNKS, offset = (int)sweep->offsets[row_start + image_x];
  const int first_cell = backward ? clamp(offset + chunks_of(extent_at(row->bands)), 0, cells_of_row)
                                  : clamp(offset, 0, cells_of_row - (to - from) * MAX_CHUNKS);
  Place place;
  place.k = 0;
  place.cells = sweep->sums + ((row_start + width) * MAX_CHUNKS + first_cell) * EGOSGM_LANES;
  place.own = codes + ((size_t)image * height + image_y) * code_stride + along;
  place.other = codes + ((size_t)(1 - image) * height + image_y) * code_stride + (width - 1 - along);
  place.around.before = row->penalties[left];
  place.around.above_before = row->penalties[above + left];
  place.around.above = row->penalties[above];
  place.wiped[0] = extent_at(row->bands + left);
  place.wiped[1] = extent_at(row->bands + above);
  place.wiped[2] = extent_at(row->bands + (above + left));
  place.wiped[3] = 0;
  place.last = (uchar16)(ABSENT);
  if (from > 0 && is_narrow(place.wiped[0])) {
    place.last = load(row->slot[0] + (origin_of(place.wiped[0]) - q.min_disparity));
  }
#if BLOCK_VECTORS == 2
  place.last_block = (Block)(ABSENT);
  place.least_of_block = (Block)(0);
  if (from > 0 && is_block(place.wiped[0])) {
    place.last_block = load_block(row->slot[0] + (origin_of(place.wiped[0]) - q.min_disparity));
  }
#endif
  place.moved = -(uint)q.min_disparity;
  return place;
}

// Leaves the winners of `count` pixels of a row, from the first one in the image on: disparity with its sub-pixel part,
// by a symmetric V through the winner and its neighbours, and the matching variance (options.h).
COMPILED_ONCE void leave_winners(const SgmParameters q, const Window* windows, const int* winners, const int count,
                                 global float* disparities, global float* variances) {
  for (int x = 0; x < count; x += PIXELS) {
    TotalOfEach before[MAX_STEPS], after[MAX_STEPS];
    totals_beside(windows + x, winners + x, -MAX_STEPS, before);
    totals_beside(windows + x, winners + x, 1, after);
    const Ints winner = load_ints_of(winners + x), total = (winner & 0xffff) >> 4;
    const TotalOfEach here = TOTALS_OF_INTS(total);
    const TotalOfEach steps =
        steps_along(before + MAX_STEPS - 1, -1, here, (ushort)q.s_max) + steps_along(after, 1, here, (ushort)q.s_max);
    const Ints sum_before = INTS_OF_TOTALS(before[MAX_STEPS - 1]), sum_after = INTS_OF_TOTALS(after[0]);
    const Ints fits = (sum_before != 65535) & (sum_after != 65535);
    const Floats refined_winner =
        refined(winner >> 16, fits ? sum_before - total : (Ints)(0), fits ? sum_after - total : (Ints)(0));
    store_pixels(refined_winner, disparities, x, count);
    store_pixels(matching_variance(q, INTS_OF_TOTALS(steps)), variances, x, count);
  }
}

// Both flags are constants wherever it is called: each direction has code of its own, whose steps need no registers.
ALWAYS_INLINE void sweep_tile(const bool meets, const bool backward, const SgmParameters q, const Sweep* sweep,
                              const int tile_x, const int first_y, const int end_y) {
  Window windows[TILE_WIDTH + PIXELS];
  int winners[TILE_WIDTH + PIXELS];
  for (int y = first_y; y < end_y; ++y) {
    const int skew = y - first_y;
    const int from = max(0, tile_x * TILE_WIDTH - skew), to = min(q.width, (tile_x + 1) * TILE_WIDTH - skew);
    if (from >= to) continue;
    Row row = row_at(meets, backward, q, sweep, y, from, to);
    const int last = to - from - 1, first = backward ? last : 0;
    row.windows = windows + first;
    row.winners = winners + first;
    Place place = place_in(backward, q, sweep, &row, y, from, to);
    sweep_row(meets, backward, q, &row, &place);
    // Apart from the sweep, whose pixels wait for each other: these do not.
    if (meets) {
      const size_t at = row.bands - sweep->bands - first;
      leave_winners(q, windows, winners, to - from, sweep->disparities + at, sweep->variances + at);
    }
  }
}

// The rows that the forward sweep takes before it comes to those that the backward one has been to. Half of them; where
// a work-item takes all tiles of a sweep, those that take half of the time: as long as a row's cells and so many a
// pixel.
#define CELLS_A_PIXEL 16
static inline int rows_to_middle(const SgmParameters q, const Sweep* sweep, const int wave) {
  if (wave != EGOSGM_ALL_TILES) return sweep->rows - sweep->rows / 2;
  global const RowSum* rows = sweep->row_sums + (size_t)sweep->view * q.height;
  const ulong a_row = (ulong)q.width * CELLS_A_PIXEL;
  ulong all = a_row * sweep->rows;
  for (int y = 0; y < sweep->rows; ++y) all += rows[y * sweep->row_step].cells;
  ulong before = 0;
  int middle = 0;
  for (; middle < sweep->rows && 2 * before < all; ++middle) before += a_row + rows[middle * sweep->row_step].cells;
  return middle;
}

// The tile of a wave in a row of tiles, or all tiles of a view and direction.
ALWAYS_INLINE void sweep_tiles(const bool meets, const bool backward, const SgmParameters q, const Sweep* sweep,
                               const int first_row, const int wave, const int tile_columns) {
  const bool all = wave == EGOSGM_ALL_TILES;
  const int middle = rows_to_middle(q, sweep, wave);
  const int own_rows = backward ? sweep->rows - middle : middle;
  const int first_y = meets ? own_rows : 0;
  const int end_y = meets ? sweep->rows : own_rows;
  const int end_row = all ? (end_y - first_y + TILE_HEIGHT - 1) / TILE_HEIGHT : first_row + 1;
  for (int tile_y = first_row; tile_y < end_row; ++tile_y) {
    const int tile_of_wave = wave - 2 * tile_y;
    const int first = all ? 0 : max(tile_of_wave, 0), end = all ? tile_columns : min(tile_of_wave + 1, tile_columns);
    const int y = first_y + tile_y * TILE_HEIGHT;
    for (int tile_x = first; tile_x < end; ++tile_x) {
      sweep_tile(meets, backward, q, sweep, tile_x, y, min(y + TILE_HEIGHT, end_y));
    }
  }
}

ALWAYS_INLINE void sweep_view(const bool meets, const bool backward, const SgmParameters q, Sweep sweep,
                              const int first_row, const int wave, const int tile_columns) {
  const size_t not_matched = (size_t)q.first_view * q.width * q.height;
  sweep.bands += not_matched;
  sweep.offsets += not_matched;
  sweep.penalties += 4 * not_matched;
  sweep.disparities += not_matched;
  sweep.variances += not_matched;
  sweep.row_sums += (size_t)q.first_view * q.height;
  sweep.row_step = q.row_step;
  sweep.rows = rows_of(q);
  sweep.slots += (size_t)(2 * sweep.view + backward) * SLOTS_OF(q) * SLOT + SLOT_PADDING;
  if (backward) {
    sweep_tiles(meets, true, q, &sweep, first_row, wave, tile_columns);
  } else {
    sweep_tiles(meets, false, q, &sweep, first_row, wave, tile_columns);
  }
}

WITH_BIT_COUNT void to_middle(const bool backward, const SgmParameters q, const Sweep sweep, const int first_row,
                              const int wave, const int tile_columns) {
  sweep_view(false, backward, q, sweep, first_row, wave, tile_columns);
}

WITH_BIT_COUNT void from_middle(const bool backward, const SgmParameters q, const Sweep sweep, const int first_row,
                                const int wave, const int tile_columns) {
  sweep_view(true, backward, q, sweep, first_row, wave, tile_columns);
}

// Both sweeps to the middle of the image, where they leave their sums.
KERNEL void sweep_to_middle(const SgmParameters q, const int wave, const int tile_columns, global const uint* codes,
                            global const Band* bands, global const uint* offsets, global const RowSum* row_sums,
                            global const uchar* penalties, global uchar* slots, global uchar* sums) {
  const Sweep sweep = {get_global_id(1), codes, bands, offsets, row_sums, penalties, slots, sums, 0, 0, 0, 0, 0};
  to_middle(get_global_id(2) > 0, q, sweep, get_global_id(0), wave, tile_columns);
}

// Both on from there, over the sums of the other one, to the winners.
KERNEL void sweep_from_middle(const SgmParameters q, const int wave, const int tile_columns, global const uint* codes,
                              global const Band* bands, global const uint* offsets, global const RowSum* row_sums,
                              global const uchar* penalties, global uchar* slots, global const uchar* sums,
                              global uint* ranks, global float* disparities, global float* variances) {
  const Sweep sweep = {get_global_id(1),    codes, bands,       offsets,   row_sums, penalties, slots,
                       (global uchar*)sums, ranks, disparities, variances, 0,        0};
  from_middle(get_global_id(2) > 0, q, sweep, get_global_id(0), wave, tile_columns);
}
