// SPDX-License-Identifier: Apache-2.0
// What every pixel searches: d +- a multiple of its standard deviation, or what the predictions around it span.
#include "shared.h"

#ifndef ROW_GROUP
#error "ROW_GROUP: work-items that share a row"
#endif

int floor_to_step(int lane) { return lane & ~(EGOSGM_BAND_STEP - 1); }
int ceil_to_step(int lane) { return (lane + EGOSGM_BAND_STEP - 1) & ~(EGOSGM_BAND_STEP - 1); }

// The band that searches [from, to], cut to the range. It has as few chunks as cover that: with begin and end counted
// from range.min, its origin is a multiple of the step in [end - lanes, begin], and not above ceil_to_step(count) -
// lanes, so that hardly a lane lies beyond the range. If there is none, one chunk more has one. Slack is shared out to
// both sides, as far as this allows. Chunks never exceed ceil(count / EGOSGM_LANES), because from the origin range.min
// that many cover everything.
Band band_of(const DisparityRange range, float from, float to) {
  const float lowest = range.min;
  const float highest = range.min + range.count - 1;
  from = from < lowest ? lowest : from > highest ? highest : from;
  to = to < lowest ? lowest : to > highest ? highest : to;

  const int begin = convert_int_rtn(from) - range.min;
  const int end = convert_int_rtp(to) - range.min + 1;
  int lanes = (end - begin + EGOSGM_LANES - 1) / EGOSGM_LANES * EGOSGM_LANES;
  const int last_origin = floor_to_step(begin);
  lanes += ceil_to_step(end - lanes) > last_origin ? EGOSGM_LANES : 0;

  const int centred = floor_to_step(begin - (lanes - (end - begin)) / 2);
  const int first_origin = max(ceil_to_step(end - lanes), 0);
  const int limit = max(ceil_to_step(range.count) - lanes, 0);
  const int origin = max(min(centred, min(last_origin, limit)), first_origin);

  Band band;
  band.origin = range.min + origin;
  band.chunks = lanes / EGOSGM_LANES;
  band.first = range.min + begin;
  band.last = range.min + end - 1;
  return band;
}

// Eight disparities of a row from x on; what lies beyond the row is invalid.
float8 eight(global const float* row, int x, int width) {
  if (x + EGOSGM_BLOCK <= width) return vload8(0, row + x);
  float values[EGOSGM_BLOCK];
  for (int i = 0; i < EGOSGM_BLOCK; ++i) values[i] = x + i < width ? row[x + i] : EGOSGM_INVALID_DISPARITY;
  return vload8(0, values);
}

// A work-item a block and view.
kernel void gather_blocks(const ImageSize size, global const float* disparity, global BlockRange* ranges) {
  const int blocks_x = (size.width + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK;
  const int blocks_y = (size.height + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK;
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= blocks_x || y >= blocks_y) return;

  float8 least = INFINITY;
  float8 most = -INFINITY;
  int8 count = 0;
  const int end = min((y + 1) * EGOSGM_BLOCK, size.height);
  for (int row = y * EGOSGM_BLOCK; row < end; ++row) {
    const float8 d = eight(disparity + ((size_t)view * size.height + row) * size.width, x * EGOSGM_BLOCK, size.width);
    const int8 valid = d > EGOSGM_INVALID_DISPARITY;
    least = select(least, d, valid & (d < least));
    most = select(most, d, valid & (d > most));
    count -= valid;
  }
  BlockRange range;
  const float4 least4 = fmin(least.lo, least.hi);
  const float4 most4 = fmax(most.lo, most.hi);
  const int4 count4 = count.lo + count.hi;
  range.min = fmin(fmin(least4.x, least4.y), fmin(least4.z, least4.w));
  range.max = fmax(fmax(most4.x, most4.y), fmax(most4.z, most4.w));
  range.count = count4.x + count4.y + count4.z + count4.w;
  ranges[((size_t)view * blocks_y + y) * blocks_x + x] = range;
}

// The band of a block's unpredicted pixels, from the 3x3 blocks around it. A work-item a block and view.
kernel void bands_of_blocks(const ImageSize size, const DisparityRange range, const float margin, const int min_count,
                            global const BlockRange* ranges, global Band* bands) {
  const int blocks_x = (size.width + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK;
  const int blocks_y = (size.height + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK;
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= blocks_x || y >= blocks_y) return;

  float least = INFINITY;
  float most = -INFINITY;
  uint count = 0;
  for (int v = max(y - 1, 0); v <= min(y + 1, blocks_y - 1); ++v) {
    for (int u = max(x - 1, 0); u <= min(x + 1, blocks_x - 1); ++u) {
      const BlockRange block = ranges[((size_t)view * blocks_y + v) * blocks_x + u];
      least = fmin(least, block.min);
      most = fmax(most, block.max);
      count += block.count;
    }
  }
  const bool enough = count > 0 && count >= (uint)max(min_count, 0);
  bands[((size_t)view * blocks_y + y) * blocks_x + x] =
      band_of(range, enough ? least - margin : -INFINITY, enough ? most + margin : INFINITY);
}

kernel void bands_of_pixels(const ImageSize size, const DisparityRange range, const float sigmas,
                            const float min_half_width, global const float* disparity, global const float* variance,
                            global const Band* block_bands, global Band* bands) {
  const int blocks_x = (size.width + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK;
  const int blocks_y = (size.height + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK;
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= size.width) return;

  const size_t pixel = ((size_t)view * size.height + y) * size.width + x;
  const float d = disparity[pixel];
  const float deviation = sigmas * sqrt(variance[pixel]);
  // A variance that is not a number searches everything.
  const float half_width = deviation <= min_half_width ? min_half_width : deviation;
  const float reach = half_width <= range.count ? half_width : range.count;
  const bool predicted = d > EGOSGM_INVALID_DISPARITY;
  const Band own = band_of(range, predicted ? d - reach : 0.0f, predicted ? d + reach : 0.0f);
  const Band around = block_bands[((size_t)view * blocks_y + y / EGOSGM_BLOCK) * blocks_x + x / EGOSGM_BLOCK];
  bands[pixel].origin = predicted ? own.origin : around.origin;
  bands[pixel].chunks = predicted ? own.chunks : around.chunks;
  bands[pixel].first = predicted ? own.first : around.first;
  bands[pixel].last = predicted ? own.last : around.last;
}

// Sums up each row: a work-group of ROW_GROUP a row and view goes over it in tiles, with an inclusive scan of a tile at
// a time.
kernel __attribute__((reqd_work_group_size(ROW_GROUP, 1, 1))) void sum_rows(const ImageSize size,
                                                                            global const float* disparity,
                                                                            global const Band* bands,
                                                                            global uint* cell_offsets,
                                                                            global RowSum* row_sums) {
  const int lane = get_local_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  const size_t row = (size_t)view * size.height + y;
  uint chunks_before = 0;
  uint searched = 0;
  uint predicted = 0;
#if ROW_GROUP > 1
  local uint chunks[ROW_GROUP];
  local uint totals[2][ROW_GROUP];
#endif
  for (int tile = 0; tile < size.width; tile += ROW_GROUP) {
    const int x = tile + lane;
    const size_t pixel = row * size.width + x;
    uint own = 0;
    if (x < size.width) {
      own = bands[pixel].chunks;
      searched += bands[pixel].last - bands[pixel].first + 1;
      predicted += disparity[pixel] > EGOSGM_INVALID_DISPARITY ? 1 : 0;
    }
    uint before = chunks_before;
#if ROW_GROUP > 1
    chunks[lane] = own;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int step = 1; step < ROW_GROUP; step *= 2) {
      const uint left = lane >= step ? chunks[lane - step] : 0;
      barrier(CLK_LOCAL_MEM_FENCE);
      chunks[lane] += left;
      barrier(CLK_LOCAL_MEM_FENCE);
    }
    before += chunks[lane] - own;
    chunks_before += chunks[ROW_GROUP - 1];
    barrier(CLK_LOCAL_MEM_FENCE);
#else
    chunks_before += own;
#endif
    if (x < size.width) cell_offsets[pixel] = before;
  }
#if ROW_GROUP > 1
  totals[0][lane] = searched;
  totals[1][lane] = predicted;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int i = 1; lane == 0 && i < ROW_GROUP; ++i) {
    searched += totals[0][i];
    predicted += totals[1][i];
  }
#endif
  if (lane == 0) {
    row_sums[row].searched = searched;
    row_sums[row].computed = chunks_before * EGOSGM_LANES;
    row_sums[row].predicted = predicted;
  }
}

kernel void full_range(const ImageSize size, const DisparityRange range, global Band* bands, global uint* cell_offsets,
                       global RowSum* row_sums) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= size.width) return;

  const Band band = band_of(range, -INFINITY, INFINITY);
  const size_t row = (size_t)view * size.height + y;
  bands[row * size.width + x] = band;
  cell_offsets[row * size.width + x] = (uint)x * band.chunks;
  if (x == 0) {
    row_sums[row].searched = (uint)size.width * range.count;
    row_sums[row].computed = (uint)size.width * band.chunks * EGOSGM_LANES;
    row_sums[row].predicted = 0;
  }
}
