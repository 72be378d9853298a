// SPDX-License-Identifier: Apache-2.0
// The bands that search given disparities, eight at a time, and rows of disparities. OpenCL C only.
#ifndef EGOSGM_KERNELS_SEARCH_BANDS_H
#define EGOSGM_KERNELS_SEARCH_BANDS_H

#include "shared.h"

// Eight bands at a time: PoCL's compiler does not vectorise this over work-items by itself.
typedef struct {
  int8 origin, chunks, first, last;
} Bands;

int8 floor_to(int8 step, int8 lane) { return lane & ~(step - 1); }
int8 ceil_to(int8 step, int8 lane) { return floor_to(step, lane + (step - 1)); }

// convert_int8_rtn for what fits, in instructions that every device has.
int8 floor_int(float8 value) {
  const int8 towards_zero = convert_int8(value);
  return towards_zero + (value < convert_float8(towards_zero));
}

// The bands that search [from, to], cut to the range. A band has as few chunks as cover that, one or an even number:
// with begin and end counted from range.min, its origin is a multiple of the step (of 1 with one chunk) in [end -
// lanes, begin], and not above ceil_to(step, count) - lanes, so that hardly a lane lies beyond the range. If there is
// none, the next number of chunks has one. Slack is shared out to both sides, as far as this allows. Chunks never
// exceed SearchBand::max_chunks, because from the origin range.min that many cover everything.
Bands bands_of(const DisparityRange range, float8 from, float8 to) {
  const float8 lowest = range.min;
  const float8 highest = range.min + range.count - 1;
  from = from < lowest ? lowest : from > highest ? highest : from;
  to = to < lowest ? lowest : to > highest ? highest : to;

  const int8 begin = floor_int(from) - range.min;
  const int8 end = 1 - floor_int(-to) - range.min;
  const int8 has_one = end - begin <= EGOSGM_LANES;
  int8 pairs = (end - begin + (2 * EGOSGM_LANES - 1)) / (2 * EGOSGM_LANES);
  pairs -= ceil_to(EGOSGM_BAND_STEP, end - pairs * (2 * EGOSGM_LANES)) > floor_to(EGOSGM_BAND_STEP, begin);
  const int8 chunks = has_one ? 1 : 2 * pairs;
  const int8 step = has_one ? 1 : EGOSGM_BAND_STEP;

  const int8 last_origin = floor_to(step, begin);
  const int8 lanes = chunks * EGOSGM_LANES;
  const int8 centred = floor_to(step, begin - (lanes - (end - begin)) / 2);
  const int8 first_origin = max(ceil_to(step, end - lanes), (int8)(0));
  const int8 limit = max(ceil_to(step, range.count) - lanes, (int8)(0));
  const int8 origin = max(min(centred, min(last_origin, limit)), first_origin);

  Bands bands;
  bands.origin = range.min + origin;
  bands.chunks = chunks;
  bands.first = range.min + begin;
  bands.last = range.min + end - 1;
  return bands;
}

Band first_of(const Bands bands) {
  Band band;
  band.origin = bands.origin.s0;
  band.chunks = bands.chunks.s0;
  band.first = bands.first.s0;
  band.last = bands.last.s0;
  return band;
}

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

// Writes eight bands of two words each, as far as the row goes.
void store_eight(global Band* row, int x, int width, uint16 words) {
  global uint* to = (global uint*)(row + x);
  if (x + EGOSGM_BLOCK <= width) {
    vstore16(words, 0, to);
    return;
  }
  uint values[2 * EGOSGM_BLOCK];
  vstore16(words, 0, values);
  for (int i = 0; i < 2 * (width - x); ++i) to[i] = values[i];
}

#endif
