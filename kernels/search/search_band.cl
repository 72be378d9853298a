// SPDX-License-Identifier: Apache-2.0
// What every pixel searches: d +- a multiple of its standard deviation, or what the predictions around it span; and
// what its block's predictions span and CoarseMatch found there, where that lies elsewhere.
#include "bands.h"
#include "spans.h"

// lint: ROW_GROUP=1
// lint: ROW_GROUP=64

#ifndef ROW_GROUP
#error "ROW_GROUP: work-items that share a row"
#endif

#ifndef __ENDIAN_LITTLE__
#error "bands are written as words: a little-endian device"
#endif

// A work-item a block and view.
KERNEL void gather_blocks(const ImageSize size, global const float* disparity, global BlockRange* ranges) {
  const ImageSize blocks = blocks_of(size);
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= blocks.width || y >= blocks.height) return;

  Spans spans = no_spans();
  const int end = min((y + 1) * EGOSGM_BLOCK, size.height);
  for (int row = y * EGOSGM_BLOCK; row < end; ++row) {
    const float8 d = eight(disparity + ((size_t)view * size.height + row) * size.width, x * EGOSGM_BLOCK, size.width);
    spans = with(spans, d, d > EGOSGM_INVALID_DISPARITY);
  }
  ranges[index_of(blocks, view, x, y)] = range_of(spans);
}

// What CoarseMatch found in a block and one coarse pixel around it, in full pixels, without EGOSGM_COARSE_OUTLIERS at
// either end: a single mismatch, as where there is no texture, would widen the bands of a whole block. A work-item a
// block and view.
KERNEL void gather_coarse(const ImageSize size, global const float* coarse, global BlockRange* ranges) {
  const ImageSize blocks = blocks_of(size);
  const int width = (size.width + EGOSGM_COARSE - 1) / EGOSGM_COARSE;
  const int height = (size.height + EGOSGM_COARSE - 1) / EGOSGM_COARSE;
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= blocks.width || y >= blocks.height) return;

#if EGOSGM_BLOCK != 2 * EGOSGM_COARSE
#error "a block and what lies around it are four coarse pixels wide"
#endif
  // Of each column the outermost ones, then of all four.
  float4 least[EGOSGM_COARSE_OUTLIERS + 1];  // in rising order
  float4 most[EGOSGM_COARSE_OUTLIERS + 1];   // in falling order
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
  for (int i = 0; i <= EGOSGM_COARSE_OUTLIERS; ++i) {
    // The other columns go to lane 0, which alone is read then.
    float4 low = least[i];
    float4 high = most[i];
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
  range.count = count.x + count.y + count.z + count.w;
  ranges[index_of(blocks, view, x, y)] = range;
}

// The band of a block's unpredicted pixels: what the predictions in the 3x3 blocks around it and the coarse match span.
// `found`: what the block's own predictions and the coarse match span, for the predicted ones: beside a jump a
// prediction may lie on the wrong side of it. `before`: of the frame before; after wrong predictions every pixel searches
// everything. A work-item a block and view.
KERNEL void bands_of_blocks(const ImageSize size, const DisparityRange range, const int from_neighbours,
                            const float margin, const int min_count, const float coarse_margin,
                            global const PredictionState* before, global const BlockRange* ranges,
                            global const BlockRange* coarse_ranges,
                            global BlockRange* found, global Band* bands) {
  const ImageSize blocks = blocks_of(size);
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= blocks.width || y >= blocks.height) return;

  float least = INFINITY;
  float most = -INFINITY;
  uint count = 0;
  for (int v = max(y - 1, 0); v <= min(y + 1, blocks.height - 1); ++v) {
    for (int u = max(x - 1, 0); u <= min(x + 1, blocks.width - 1); ++u) {
      const BlockRange block = ranges[index_of(blocks, view, u, v)];
      least = fmin(least, block.min);
      most = fmax(most, block.max);
      count += block.count;
    }
  }
  const size_t here = index_of(blocks, view, x, y);
  const bool has_around = count > 0 && count >= (uint)max(min_count, 0);
  const bool has_coarse = coarse_ranges[here].count >= EGOSGM_COARSE_MIN_COUNT;
  const BlockRange coarse = coarse_ranges[here];
  BlockRange both = {INFINITY, -INFINITY, 0};
  if (has_coarse) both = coarse;
  found[here] = joined(both, ranges[here]);

  const bool has_any = from_neighbours && (has_around || has_coarse) && !before->is_wrong;
  float from = has_any ? INFINITY : -INFINITY;
  float to = -from;
  if (has_any && has_around) {
    from = least - margin;
    to = most + margin;
  }
  if (has_any && has_coarse) {
    from = fmin(from, coarse.min - coarse_margin);
    to = fmax(to, coarse.max + coarse_margin);
  }
  bands[here] = first_of(bands_of(range, from, to));
}

// A work-item a block's row of pixels and view.
KERNEL void bands_of_pixels(const ImageSize size, const DisparityRange range, const float sigmas,
                            const float min_half_width, global const float* disparity, global const float* variance,
                            const float coarse_tolerance, const float coarse_margin, global const PredictionState* before,
                            global const BlockRange* found, global const Band* block_bands, global Band* bands) {
  const ImageSize blocks = blocks_of(size);
  const int block = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (block >= blocks.width) return;

  const int x = block * EGOSGM_BLOCK;
  const size_t row = ((size_t)view * size.height + y) * size.width;
  const float8 d = eight(disparity + row, x, size.width);
  const float8 deviation = sigmas * sqrt(eight(variance + row, x, size.width));
  const int8 predicted = (d > EGOSGM_INVALID_DISPARITY) & (int8)(before->is_wrong ? 0 : -1);
  // A variance that is not a number searches everything.
  const float8 half_width = deviation <= min_half_width ? (float8)min_half_width : deviation;
  const float8 reach = half_width <= (float)range.count ? half_width : (float8)range.count;
  const size_t own_block = index_of(blocks, view, block, y / EGOSGM_BLOCK);
  const BlockRange coarse = found[own_block];
  const int8 believed = coarse.count > 0 ? -1 : 0;
  const float8 low = d - reach;
  const float8 high = d + reach;
  const int8 contradicted = believed & ((coarse.min < low - coarse_tolerance) | (coarse.max > high + coarse_tolerance));
  const float8 found_low = coarse.min - coarse_margin;
  const float8 found_high = coarse.max + coarse_margin;
  const float8 from = (contradicted & (found_low < low)) ? found_low : low;
  const float8 to = (contradicted & (found_high > high)) ? found_high : high;
  const Bands own = bands_of(range, predicted ? from : 0.0f, predicted ? to : 0.0f);
  const Band around = block_bands[own_block];

  const uint8 origin = as_uint8(predicted ? own.origin : around.origin) & 0xffff;
  const uint8 chunks = as_uint8(predicted ? own.chunks : around.chunks);
  const uint8 first = as_uint8(predicted ? own.first : around.first) & 0xffff;
  const uint8 last = as_uint8(predicted ? own.last : around.last);
  const uint8 first_words = origin | chunks << 16;
  const uint8 second_words = first | last << 16;
  uint16 words;
  words.even = first_words;
  words.odd = second_words;
  store_eight(bands + row, x, size.width, words);
}

#if ROW_GROUP == 1

uint sum_of(uint8 v) {
  const uint4 halves = v.lo + v.hi;
  return halves.x + halves.y + halves.z + halves.w;
}

// The chunks of the pixels from x on; what lies beyond the row has none.
uint8 load_chunks(global const Band* row, int x, int width) {
  if (x + EGOSGM_BLOCK <= width) return vload16(0, (global const uint*)(row + x)).even >> 16;
  uint chunks[EGOSGM_BLOCK];
  for (int i = 0; i < EGOSGM_BLOCK; ++i) chunks[i] = x + i < width ? row[x + i].chunks : 0;
  return vload8(0, chunks);
}

// Sums up each row, eight pixels at a time. A work-item a row and view.
KERNEL __attribute__((reqd_work_group_size(1, 1, 1))) void sum_rows(const ImageSize size, global const float* disparity,
                                                                    global const Band* bands, global uint* cell_offsets,
                                                                    global RowSum* row_sums) {
  const size_t row = (size_t)get_global_id(2) * size.height + get_global_id(1);
  global const float* disparities = disparity + row * size.width;
  global uint* offsets = cell_offsets + row * size.width;
  uint chunks_before = 0;
  int8 predicted = 0;
  for (int x = 0; x < size.width; x += EGOSGM_BLOCK) {
    const uint8 chunks = load_chunks(bands + row * size.width, x, size.width);
    predicted -= eight(disparities, x, size.width) > EGOSGM_INVALID_DISPARITY;
    uint8 scan = chunks;  // inclusive, in steps of 1, 2 and 4
    scan += (uint8)(0, scan.s0123, scan.s456);
    scan += (uint8)(0, 0, scan.s0123, scan.s45);
    scan += (uint8)(0, 0, 0, 0, scan.s0123);
    const uint8 before = chunks_before + scan - chunks;
    chunks_before += scan.s7;
    if (x + EGOSGM_BLOCK <= size.width) {
      vstore8(before, 0, offsets + x);
    } else {
      uint values[EGOSGM_BLOCK];
      vstore8(before, 0, values);
      for (int i = 0; i < size.width - x; ++i) offsets[x + i] = values[i];
    }
  }
  row_sums[row].cells = chunks_before * EGOSGM_LANES;
  row_sums[row].predicted = sum_of(as_uint8(predicted));
}

#else

// Sums up each row: a work-group of ROW_GROUP a row and view goes over it in tiles, with an inclusive scan of a tile at
// a time.
KERNEL __attribute__((reqd_work_group_size(ROW_GROUP, 1, 1))) void sum_rows(const ImageSize size,
                                                                            global const float* disparity,
                                                                            global const Band* bands,
                                                                            global uint* cell_offsets,
                                                                            global RowSum* row_sums) {
  const int lane = get_local_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  const size_t row = (size_t)view * size.height + y;
  uint chunks_before = 0;
  uint predicted = 0;
  local uint chunks[ROW_GROUP];
  local uint totals[ROW_GROUP];
  for (int tile = 0; tile < size.width; tile += ROW_GROUP) {
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
