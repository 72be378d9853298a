// SPDX-License-Identifier: Apache-2.0
// The band of every pixel: d +- a multiple of its standard deviation, or what the predictions around it span; and
// what its block's predictions span and CoarseMatch found there, where that lies elsewhere.

// lint: ROW_GROUP=1 PIXELS=16
// lint: ROW_GROUP=64 PIXELS=1

#ifndef ROW_GROUP
#error "ROW_GROUP: work-items that share a row"
#endif

#include "bands.h"
#include "spans.h"

#ifndef __ENDIAN_LITTLE__
#error "bands are written as words: a little-endian device"
#endif

// So many times BLOCKS at once: less of a row at a time would cost as long a wait for memory.
#define GATHERED_AT_ONCE (PIXELS == 1 ? 1 : 8)

// Predictions count for the rows that the view lacks, too. A work-item BLOCKS blocks and view, or a row of them.
KERNEL void gather_blocks(const ImageSize size, const int row_step, global const float* disparity,
                          global BlockRange* ranges) {
  const WorkItem at = THIS_WORK_ITEM;
  const ImageSize blocks = blocks_of(size);
  const int y = at.y;
  const int view = at.view;
  const int end = min((y + 1) * EGOSGM_BLOCK, size.height);
  for (int x = at.x * BLOCKS * GATHERED_AT_ONCE; x < blocks.width; x += at.items * BLOCKS * GATHERED_AT_ONCE) {
    Spans spans[GATHERED_AT_ONCE];
#pragma unroll
    for (int i = 0; i < GATHERED_AT_ONCE; ++i) spans[i] = no_spans();
    for (int row = y * EGOSGM_BLOCK; row < end; row += row_step) {
      global const float* of_row = disparity + ((size_t)view * size.height + row) * size.width;
#pragma unroll
      for (int i = 0; i < GATHERED_AT_ONCE; ++i) {
        spans[i] = with(spans[i], load_across(of_row, (x + BLOCKS * i) * EGOSGM_BLOCK, size.width));
      }
    }
    global BlockRange* to = ranges + index_of(blocks, view, x, y);
#pragma unroll
    for (int i = 0; i < GATHERED_AT_ONCE; ++i) {
      spans[i].count *= row_step;
#if BLOCKS == 1
      to[i] = range_of(spans[i].least, spans[i].most, spans[i].count);
#else
      const int left = blocks.width - x - BLOCKS * i;
      if (left > 0) to[2 * i] = range_of(spans[i].least.lo, spans[i].most.lo, spans[i].count.lo);
      if (left > 1) to[2 * i + 1] = range_of(spans[i].least.hi, spans[i].most.hi, spans[i].count.hi);
#endif
    }
  }
}

// Spans what CoarseMatch found in a block and one coarse pixel around it, in full pixels, without
// EGOSGM_COARSE_OUTLIERS at either end: a single mismatch, as where there is no texture, would widen the bands of a
// whole block. One surface may lie a little farther. A work-item a block and view.
COMPILED_ONCE void gather_coarse_block(const WorkItem at, const ImageSize size, global const float* coarse,
                                       global BlockRange* ranges) {
  const ImageSize blocks = blocks_of(size);
  const int width = coarse_size(size).width, height = coarse_size(size).height;
  const int x = at.x, y = at.y, view = at.view;
  if (x >= blocks.width || y >= blocks.height) return;

#if EGOSGM_BLOCK != 2 * EGOSGM_COARSE
#error "a block and what lies around it are four coarse pixels wide"
#endif
  // The outermost ones of each column, then of all four.
  float4 least[EGOSGM_COARSE_OUTLIERS + 1];  // in rising order
  float4 most[EGOSGM_COARSE_OUTLIERS + 1];   // in falling order
#pragma unroll
  for (int i = 0; i <= EGOSGM_COARSE_OUTLIERS; ++i) {
    least[i] = INFINITY;
    most[i] = -INFINITY;
  }
  int4 count = 0;
  for (int v = max(2 * y - 1, 0); v <= min(2 * y + 2, height - 1); ++v) {
    const float4 d = four(coarse + ((size_t)view * height + v) * width, 2 * x - 1, width);
    const int4 valid = d > EGOSGM_INVALID_DISPARITY;
    count -= valid;
    insert_least(least, valid ? d : INFINITY);
    insert_most(most, valid ? d : -INFINITY);
  }
#pragma unroll
  for (int i = 0; i <= EGOSGM_COARSE_OUTLIERS; ++i) {
    // The other columns go to lane 0, which alone is read then.
    float4 low = least[i];
    float4 high = most[i];
#pragma unroll
    for (int lane = 1; lane < 4; ++lane) {
      low = low.yzwx;
      high = high.yzwx;
      insert_least(least, (float4)(low.x, INFINITY, INFINITY, INFINITY));
      insert_most(most, (float4)(high.x, -INFINITY, -INFINITY, -INFINITY));
    }
  }
  BlockRange range;
  range.min = EGOSGM_COARSE * least[EGOSGM_COARSE_OUTLIERS].x;
  range.max = EGOSGM_COARSE * most[EGOSGM_COARSE_OUTLIERS].x;
  if (range.max - range.min <= (float)EGOSGM_COARSE) range.min -= EGOSGM_COARSE_FARTHER_PX;
  range.count = count.x + count.y + count.z + count.w;
  ranges[index_of(blocks, view, x, y)] = range;
}

KERNEL void gather_coarse(const ImageSize size, global const float* coarse, global BlockRange* ranges) {
  gather_coarse_block(THIS_WORK_ITEM, size, coarse, ranges);
}

// From what to what the unpredicted pixels of a block search.
typedef struct {
  float from, to;
} Span;

// Spans the predictions in the 3x3 blocks around it and the coarse match, or the whole range where few are
// predicted: a few beside each other may be wrong together, and what searches near them alone would confirm them, as
// where texture repeats. `found`: what the predictions in the block and in those above and below it, and the coarse
// match span. Thin things stand upright: where a frame lost a part of one, the parts farther above and below it say
// where to search, so that paths along it meet its disparity all the way.
static inline Span span_around(const ImageSize blocks, const int view, const int x, const int y,
                               const int from_neighbours, const float margin, const int min_count,
                               const float coarse_margin, global const BlockRange* ranges,
                               global const BlockRange* coarse_ranges, global BlockRange* found) {
  float least = INFINITY;
  float most = -INFINITY;
  uint count = 0;
  BlockRange upright = {INFINITY, -INFINITY, 0};
  for (int v = max(y - 1, 0); v <= min(y + 1, blocks.height - 1); ++v) {
    for (int u = max(x - 1, 0); u <= min(x + 1, blocks.width - 1); ++u) {
      const BlockRange block = ranges[index_of(blocks, view, u, v)];
      least = fmin(least, block.min);
      most = fmax(most, block.max);
      count += block.count;
      if (u == x) upright = joined(upright, block);
    }
  }
  for (int v = y - EGOSGM_THIN_REACH; v <= y + EGOSGM_THIN_REACH; v += 2) {
    if (v < 0 || v >= blocks.height) continue;
    global const BlockRange* row = ranges + index_of(blocks, view, 0, v);
    if (is_thin(blocks, x, row)) upright.max = fmax(upright.max, row[x].max);  // what lies behind it changes
  }
  const size_t here = index_of(blocks, view, x, y);
  const BlockRange coarse = coarse_ranges[here];
  const bool has_around = count > 0 && count >= (uint)max(min_count, 0);
  const bool has_coarse = coarse.count >= EGOSGM_COARSE_MIN_COUNT;
  BlockRange both = {INFINITY, -INFINITY, 0};
  if (has_coarse) both = coarse;
  found[here] = joined(both, upright);

  const bool is_narrow = from_neighbours && has_around;
  Span span = {is_narrow ? least - margin : -INFINITY, is_narrow ? most + margin : INFINITY};
  if (is_narrow && has_coarse) {
    span.from = fmin(span.from, coarse.min - coarse_margin);
    span.to = fmax(span.to, coarse.max + coarse_margin);
  }
  return span;
}

// The band of a block's unpredicted pixels; `found` is for the predicted ones: beside a jump a prediction may lie on
// the wrong side of it. A work-item PIXELS blocks and view, or a row of blocks and view.
COMPILED_ONCE void bands_of_blocks_row(const WorkItem at, const ImageSize size, const DisparityRange range,
                                       const int from_neighbours, const float margin, const int min_count,
                                       const float coarse_margin, global const BlockRange* ranges,
                                       global const BlockRange* coarse_ranges, global BlockRange* found,
                                       global Band* bands) {
  const ImageSize blocks = blocks_of(size);
  const int y = at.y;
  const int view = at.view;
  FOR_PIXELS(x, blocks.width) {
    float from[PIXELS], to[PIXELS];
    for (int i = 0; i < PIXELS; ++i) {
      const Span span = span_around(blocks, view, min(x + i, blocks.width - 1), y, from_neighbours, margin, min_count,
                                    coarse_margin, ranges, coarse_ranges, found);
      from[i] = span.from;
      to[i] = span.to;
    }
    store_bands(bands_of(range, load_pixels_of(from), load_pixels_of(to)), bands + index_of(blocks, view, 0, y), x,
                blocks.width);
  }
}

KERNEL void bands_of_blocks(const ImageSize size, const DisparityRange range, const int from_neighbours,
                            const float margin, const int min_count, const float coarse_margin,
                            global const BlockRange* ranges, global const BlockRange* coarse_ranges,
                            global BlockRange* found, global Band* bands) {
  bands_of_blocks_row(THIS_WORK_ITEM, size, range, from_neighbours, margin, min_count, coarse_margin, ranges,
                      coarse_ranges, found, bands);
}

typedef struct {
  Floats from, to;
} SearchedRange;

// The range that PIXELS predictions and the matches of their blocks search.
static inline SearchedRange range_of_predictions(const DisparityRange range, const float sigmas,
                                                 const float min_half_width, const float coarse_tolerance,
                                                 const float coarse_margin, const Floats d, const Floats variance,
                                                 const Floats found_min, const Floats found_max,
                                                 const Ints found_count) {
  const Floats deviation = sigmas * sqrt(variance);
  // A variance that is not a number searches everything.
  const Floats half_width = deviation <= min_half_width ? (Floats)(min_half_width) : deviation;
  const Floats reach = half_width <= (float)range.count ? half_width : (Floats)(range.count);
  const Floats low = d - reach, high = d + reach;
  const Ints contradicted =
      (found_count > 0) & ((found_min < low - coarse_tolerance) | (found_max > high + coarse_tolerance));
  const Floats found_low = found_min - coarse_margin, found_high = found_max + coarse_margin;
  SearchedRange searched;
  searched.from = (contradicted & (found_low < low)) ? found_low : low;
  searched.to = (contradicted & (found_high > high)) ? found_high : high;
  return searched;
}

#if ROW_GROUP == 1
// Sums up a row, and writes where the cells of its pixels begin.
COMPILED_ONCE void sum_row(const WorkItem at, const ImageSize size, global const float* disparity,
                           global const Band* bands, global uint* cell_offsets, global RowSum* row_sums) {
  const int width = size.width;
  const size_t row = (size_t)at.view * size.height + at.y;
  Sums sums = {0, 0};
  FOR_PIXELS(x, width) {
    sums = with_offsets(sums, chunks_at(bands + row * width, x, width), load_pixels(disparity + row * width, x, width),
                        (global uchar*)(cell_offsets + row * width), x, width);
  }
  row_sums[row] = row_sum_of(sums);
}
#endif

// Work-items that have a row alone sum it up, too. A work-item PIXELS pixels and view, or a row and view.
COMPILED_ONCE void bands_of_pixels_row(const WorkItem at, const ImageSize size, const int row_step,
                                       const DisparityRange range, const float sigmas, const float min_half_width,
                                       global const float* disparity, global const float* variance,
                                       const float coarse_tolerance, const float coarse_margin,
                                       global const BlockRange* found, global const Band* block_bands,
                                       global Band* bands, global uint* cell_offsets, global RowSum* row_sums) {
  const ImageSize blocks = blocks_of(size);
  const int y = at.y, view = at.view, width = size.width;
  if (!has_row(at, row_step)) return;
  const size_t row = ((size_t)view * size.height + y) * width;
  const size_t row_of_blocks = index_of(blocks, view, 0, y / EGOSGM_BLOCK);
  FOR_CHUNKS(start, width) {
    SearchedRange own[CHUNK];
    FOR_BLOCKS(x, i, start, width) {
      const Floats d = load_pixels(disparity + row, x, width);
      global const BlockRange* here = found + row_of_blocks + x / EGOSGM_BLOCK;
      own[i] = range_of_predictions(range, sigmas, min_half_width, coarse_tolerance, coarse_margin,
                                    d > INVALID ? d : (Floats)(0.0f), load_pixels(variance + row, x, width),
                                    OF_BLOCKS(Floats, float8, here, NEXT_BLOCK(x, blocks.width), min),
                                    OF_BLOCKS(Floats, float8, here, NEXT_BLOCK(x, blocks.width), max),
                                    OF_BLOCKS(Ints, int8, here, NEXT_BLOCK(x, blocks.width), count));
    }
    FOR_BLOCKS(x, i, start, width) {
      const Ints predicted = load_pixels(disparity + row, x, width) > INVALID;
      const Bands of_own = bands_of(range, own[i].from, own[i].to);
      Bands all = bands_at(block_bands + row_of_blocks, x, blocks.width);
      all.origin = predicted ? of_own.origin : all.origin;
      all.chunks = predicted ? of_own.chunks : all.chunks;
      all.first = predicted ? of_own.first : all.first;
      all.last = predicted ? of_own.last : all.last;
      store_bands(all, bands + row, x, width);
    }
  }
#if ROW_GROUP == 1
  sum_row(at, size, disparity, bands, cell_offsets, row_sums);
#endif
}

KERNEL void bands_of_pixels(const ImageSize size, const int row_step, const DisparityRange range, const float sigmas,
                            const float min_half_width, global const float* disparity, global const float* variance,
                            const float coarse_tolerance, const float coarse_margin, global const BlockRange* found,
                            global const Band* block_bands, global Band* bands, global uint* cell_offsets,
                            global RowSum* row_sums) {
  bands_of_pixels_row(THIS_WORK_ITEM, size, row_step, range, sigmas, min_half_width, disparity, variance,
                      coarse_tolerance, coarse_margin, found, block_bands, bands, cell_offsets, row_sums);
}

#if ROW_GROUP == 1

// Counts rows that were not banded pixel by pixel. A work-item a row and view.
KERNEL void sum_rows(const ImageSize size, const int row_step, global const float* disparity, global const Band* bands,
                     global uint* cell_offsets, global RowSum* row_sums) {
  const WorkItem at = THIS_WORK_ITEM;
  if (has_row(at, row_step)) sum_row(at, size, disparity, bands, cell_offsets, row_sums);
}

#else

// Sums up each row: a work-group of ROW_GROUP a row and view goes over it in tiles, with an inclusive scan of a tile at
// a time.
KERNEL __attribute__((reqd_work_group_size(ROW_GROUP, 1, 1))) void sum_rows(const ImageSize size, const int row_step,
                                                                            global const float* disparity,
                                                                            global const Band* bands,
                                                                            global uint* cell_offsets,
                                                                            global RowSum* row_sums) {
  const int lane = get_local_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  const size_t row = (size_t)view * size.height + y;
  const int width = has_row(THIS_WORK_ITEM, row_step) ? size.width : 0;
  uint chunks_before = 0, predicted = 0;
  local uint chunks[ROW_GROUP];
  local uint totals[ROW_GROUP];
  for (int tile = 0; tile < width; tile += ROW_GROUP) {
    const int x = tile + lane;
    const size_t pixel = row * size.width + x;
    uint own = 0;
    if (x < size.width) {
      own = bands[pixel].chunks;
      predicted += disparity[pixel] > EGOSGM_INVALID_DISPARITY ? 1 : 0;
    }
    chunks[lane] = own;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int step = 1; step < ROW_GROUP; step *= 2) {
      const uint left = lane >= step ? chunks[lane - step] : 0;
      barrier(CLK_LOCAL_MEM_FENCE);
      chunks[lane] += left;
      barrier(CLK_LOCAL_MEM_FENCE);
    }
    if (x < size.width) cell_offsets[pixel] = chunks_before + chunks[lane] - own;
    chunks_before += chunks[ROW_GROUP - 1];
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  totals[lane] = predicted;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int i = 1; lane == 0 && i < ROW_GROUP; ++i) predicted += totals[i];
  if (lane == 0) {
    row_sums[row].cells = chunks_before * EGOSGM_LANES;
    row_sums[row].predicted = predicted;
  }
}

#endif

// `band`: the one of every pixel.
KERNEL void full_range(const ImageSize size, const Band band, global Band* bands, global uint* cell_offsets,
                       global RowSum* row_sums) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= size.width) return;

  const size_t row = (size_t)view * size.height + y;
  bands[row * size.width + x] = band;
  cell_offsets[row * size.width + x] = (uint)x * band.chunks;
  if (x == 0) {
    row_sums[row].cells = (uint)size.width * band.chunks * EGOSGM_LANES;
    row_sums[row].predicted = 0;
  }
}
