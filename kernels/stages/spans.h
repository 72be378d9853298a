// SPDX-License-Identifier: Apache-2.0
// The spans of the pixels of blocks. OpenCL C only.
#ifndef EGOSGM_KERNELS_SEARCH_SPANS_H
#define EGOSGM_KERNELS_SEARCH_SPANS_H

#include "method.h"
#include "shared.h"

// Eight disparities of a row from x on; what lies before or beyond the row is invalid.
float8 eight(global const float* row, int x, int width) {
  if (x >= 0 && x + EGOSGM_BLOCK <= width) return vload8(0, row + x);
  float values[EGOSGM_BLOCK];
  for (int i = 0; i < EGOSGM_BLOCK; ++i) {
    values[i] = x + i >= 0 && x + i < width ? row[x + i] : EGOSGM_INVALID_DISPARITY;
  }
  return vload8(0, values);
}

// Four disparities of a row from x on; what lies before or beyond the row is invalid.
float4 four(global const float* row, int x, int width) {
  if (x >= 0 && x + 4 <= width) return vload4(0, row + x);
  float values[4];
  for (int i = 0; i < 4; ++i) values[i] = x + i >= 0 && x + i < width ? row[x + i] : EGOSGM_INVALID_DISPARITY;
  return vload4(0, values);
}

// The blocks of a work-item, a row of pixels of theirs, and what such rows span, lane by lane.
#if PIXELS == 1
#define BLOCKS 1
typedef float8 Across;
typedef int8 AcrossInts;
#define load_across eight
#else
#define BLOCKS 2
typedef float16 Across;
typedef int16 AcrossInts;
#define load_across load_pixels
#endif
typedef struct {
  Across least, most;
  AcrossInts count;
} Spans;

Spans no_spans() {
  Spans spans;
  spans.least = INFINITY;
  spans.most = -INFINITY;
  spans.count = 0;
  return spans;
}

Spans with(Spans spans, const Across d) {
  const AcrossInts valid = d > EGOSGM_INVALID_DISPARITY;
  spans.least = (valid & (d < spans.least)) ? d : spans.least;
  spans.most = (valid & (d > spans.most)) ? d : spans.most;
  spans.count -= valid;
  return spans;
}

BlockRange range_of(const float8 least, const float8 most, const int8 count) {
  BlockRange range;
  const float4 least4 = fmin(least.lo, least.hi);
  const float4 most4 = fmax(most.lo, most.hi);
  const int4 count4 = count.lo + count.hi;
  range.min = fmin(fmin(least4.x, least4.y), fmin(least4.z, least4.w));
  range.max = fmax(fmax(most4.x, most4.y), fmax(most4.z, most4.w));
  range.count = count4.x + count4.y + count4.z + count4.w;
  return range;
}

BlockRange joined(const BlockRange a, const BlockRange b) {
  BlockRange both;
  both.min = b.count > 0 && (a.count == 0 || b.min < a.min) ? b.min : a.min;
  both.max = b.count > 0 && (a.count == 0 || b.max > a.max) ? b.max : a.max;
  both.count = a.count + b.count;
  return both;
}

// Whether the block at x of a row of blocks holds a thin thing (method.h).
bool is_thin(const ImageSize blocks, const int x, global const BlockRange* row) {
  const float left = row[max(x - EGOSGM_THIN_BLOCKS, 0)].max;
  const float right = row[min(x + EGOSGM_THIN_BLOCKS, blocks.width - 1)].max;
  return row[x].max > fmax(left, right) + EGOSGM_THIN_JUMP_PX;
}

// Keeps the EGOSGM_COARSE_OUTLIERS + 1 least values of each lane, in rising order; the most, in falling order.
void insert_least(float4* least, float4 value) {
#pragma unroll
  for (int i = 0; i <= EGOSGM_COARSE_OUTLIERS; ++i) {
    const float4 before = least[i];
    least[i] = value < before ? value : before;
    value = value < before ? before : value;
  }
}
void insert_most(float4* most, float4 value) {
#pragma unroll
  for (int i = 0; i <= EGOSGM_COARSE_OUTLIERS; ++i) {
    const float4 before = most[i];
    most[i] = value > before ? value : before;
    value = value > before ? before : value;
  }
}

ImageSize blocks_of(const ImageSize size) {
  ImageSize blocks;
  blocks.width = (size.width + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK;
  blocks.height = (size.height + EGOSGM_BLOCK - 1) / EGOSGM_BLOCK;
  return blocks;
}
size_t index_of(const ImageSize size, int view, int x, int y) {
  return ((size_t)view * size.height + y) * size.width + x;
}

#endif
