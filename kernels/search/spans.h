// SPDX-License-Identifier: Apache-2.0
// What the pixels of blocks span. OpenCL C only.
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

// What pixels that are looked through one after another span, lane by lane.
typedef struct {
  float8 least, most;
  int8 count;
} Spans;

Spans no_spans() {
  Spans spans;
  spans.least = INFINITY;
  spans.most = -INFINITY;
  spans.count = 0;
  return spans;
}

Spans with(Spans spans, const float8 d, const int8 counts) {
  spans.least = select(spans.least, d, counts & (d < spans.least));
  spans.most = select(spans.most, d, counts & (d > spans.most));
  spans.count -= counts;
  return spans;
}

BlockRange range_of(const Spans spans) {
  BlockRange range;
  const float4 least4 = fmin(spans.least.lo, spans.least.hi);
  const float4 most4 = fmax(spans.most.lo, spans.most.hi);
  const int4 count4 = spans.count.lo + spans.count.hi;
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

// Keeps the EGOSGM_COARSE_OUTLIERS + 1 least values of each lane, in rising order; the most, in falling order.
void insert_least(float4* least, float4 value) {
  for (int i = 0; i <= EGOSGM_COARSE_OUTLIERS; ++i) {
    const float4 before = least[i];
    least[i] = value < before ? value : before;
    value = value < before ? before : value;
  }
}
void insert_most(float4* most, float4 value) {
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
