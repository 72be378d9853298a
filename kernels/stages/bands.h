// SPDX-License-Identifier: Apache-2.0
// The bands that search given disparities, of PIXELS pixels. OpenCL C only.
#ifndef EGOSGM_KERNELS_SEARCH_BANDS_H
#define EGOSGM_KERNELS_SEARCH_BANDS_H

#include "pixels.h"

typedef struct {
  Ints origin, chunks, first, last;
} Bands;

static inline Ints floor_to(const Ints step, const Ints lane) { return lane & ~(step - 1); }
static inline Ints ceil_to(const Ints step, const Ints lane) { return floor_to(step, lane + (step - 1)); }

#define LANES_BITS 3
#if EGOSGM_LANES != 1 << LANES_BITS
#error "LANES_BITS: the logarithm of EGOSGM_LANES"
#endif

// Rounds down what fits, in instructions that every device has.
static inline Ints floor_int(const Floats value) {
  const Ints towards_zero = INTS_OF_FLOATS(value);
  return value < FLOATS_OF_INTS(towards_zero) ? towards_zero - 1 : towards_zero;
}

// The bands that search [from, to], cut to the range. A band has as few chunks as cover that, one or an even number:
// with begin and end counted from range.min, its origin is a multiple of the step (of 1 with one chunk) in [end -
// lanes, begin], and not above ceil_to(step, count) - lanes, so that hardly a lane lies beyond the range. If there is
// none, the next number of chunks has one. Lanes that are computed and cannot win still take part in the paths. On one
// side alone they would draw surfaces to that side. So both sides share them out, and of two origins that are as near
// to the middle, the even multiple of the step is taken. Chunks never exceed SearchBand::max_chunks, because from the
// origin range.min that many cover everything.
static inline Bands bands_of(const DisparityRange range, Floats from, Floats to) {
  const Floats lowest = range.min;
  const Floats highest = range.min + range.count - 1;
  from = from < lowest ? lowest : from > highest ? highest : from;
  to = to < lowest ? lowest : to > highest ? highest : to;

  const Ints begin = floor_int(from) - range.min;
  const Ints end = 1 - floor_int(-to) - range.min;
  const Ints has_one = end - begin <= EGOSGM_LANES;
  const Ints step = EGOSGM_BAND_STEP;
  const Ints in_steps = ceil_to(step, end) - floor_to(step, begin);
  const Ints lanes = has_one ? (Ints)(EGOSGM_LANES) : ceil_to((Ints)(2 * EGOSGM_LANES), in_steps);
  const Ints own_step = has_one ? (Ints)(1) : step;

  const Ints unit = own_step << 1;  // in half lanes, as the middle may lie between two
  const Ints middle = begin + end - lanes + own_step;
  const Ints above = floor_to(unit, middle);
  const Ints is_odd_tie = (above == middle) & ((above & unit) != 0);
  const Ints centred = (above - (is_odd_tie ? unit : (Ints)(0))) >> 1;
  const Ints first_origin = max(ceil_to(own_step, end) - lanes, (Ints)(0));
  const Ints limit = max(ceil_to(own_step, range.count) - lanes, (Ints)(0));
  const Ints origin = max(min(centred, limit), first_origin);

  Bands bands;
  bands.origin = range.min + origin;
  bands.chunks = lanes >> LANES_BITS;
  bands.first = range.min + begin;
  bands.last = range.min + end - 1;
  return bands;
}

// The values of the blocks of PIXELS pixels: each pixel gets that of its own block. `blocks`: the first one's; `next`:
// to that of the next one, if there is any.
#if PIXELS == 1
#define OF_BLOCKS(Values, Half, blocks, next, member) ((Values)((blocks)->member))
#else
#if PIXELS != 2 * EGOSGM_BLOCK
#error "two blocks are as wide as the pixels of a work-item"
#endif
#define OF_BLOCKS(Values, Half, blocks, next, member) \
  ((Values)((Half)((blocks)->member), (Half)((blocks)[next].member)))
#endif
#define NEXT_BLOCK(x, blocks) ((x) / EGOSGM_BLOCK + 1 < (blocks) ? 1 : 0)

static inline Bands bands_at(global const Band* of_row, const int x, const int blocks) {
  Band at[2];
  at[0] = band_at(of_row, x / EGOSGM_BLOCK);
#if PIXELS > 1
  at[1] = band_at(of_row, x / EGOSGM_BLOCK + NEXT_BLOCK(x, blocks));
#endif
  Bands bands;
  bands.origin = OF_BLOCKS(Ints, int8, at, 1, origin);
  bands.chunks = OF_BLOCKS(Ints, int8, at, 1, chunks);
  bands.first = OF_BLOCKS(Ints, int8, at, 1, first);
  bands.last = OF_BLOCKS(Ints, int8, at, 1, last);
  return bands;
}

// Writes the bands of pixels x .. x + PIXELS - 1, as far as the row goes: two words each.
static inline void store_bands(const Bands bands, global Band* row, const int x, const int width) {
  const Ints first_words = (bands.origin & 0xffff) | bands.chunks << 16;
  const Ints second_words = (bands.first & 0xffff) | bands.last << 16;
#if PIXELS == 1
  ((global int2*)row)[x] = (int2)(first_words, second_words);
#else
  int16 words[2];
  words[0].even = first_words.lo;
  words[0].odd = second_words.lo;
  words[1].even = first_words.hi;
  words[1].odd = second_words.hi;
  store_words(words[0], (global uchar*)row, 2 * x, 2 * width);
  if (x + EGOSGM_BLOCK < width) store_words(words[1], (global uchar*)row, 2 * (x + EGOSGM_BLOCK), 2 * width);
#endif
}

#if PIXELS > 1

// The chunks of pixels x .. x + PIXELS - 1, 0 behind the row.
AT_EDGE Ints chunks_at_edge(global const Band* row, const int x, const int width) {
  int chunks[PIXELS];
  for (int i = 0; i < PIXELS; ++i) chunks[i] = x + i < width ? row[x + i].chunks : 0;
  return vload16(0, chunks);
}
static inline Ints chunks_at(global const Band* row, const int x, const int width) {
  if (x + PIXELS > width) return chunks_at_edge(row, x, width);
  const uint16 low = as_uint16(vload16(0, (global const int*)(row + x))),
               high = as_uint16(vload16(0, (global const int*)(row + x + EGOSGM_BLOCK)));
  return as_int16((uint16)(low.even, high.even) >> 16);
}

// Sums of a row up to a pixel.
typedef struct {
  int chunks;
  Ints predicted;
} Sums;

// Leaves where the cells of PIXELS pixels begin, which have so many chunks, and sums them up.
static inline Sums with_offsets(Sums sums, const Ints chunks, const Floats d, global uchar* offsets, const int x,
                                const int width) {
  Ints scan = chunks;  // inclusive, in steps of 1, 2, 4 and 8
  scan += (Ints)(0, scan.s0123, scan.s4567, scan.s89ab, scan.scd, scan.se);
  scan += (Ints)(0, 0, scan.s0123, scan.s4567, scan.s89ab, scan.scd);
  scan += (Ints)(0, 0, 0, 0, scan.s0123, scan.s4567, scan.s89ab);
  scan += (Ints)((int8)(0), scan.s01234567);
  store_words(sums.chunks + scan - chunks, offsets, x, width);
  sums.chunks += scan.sf;
  sums.predicted -= d > INVALID;
  return sums;
}

static inline RowSum row_sum_of(const Sums sums) {
  const int8 halves = sums.predicted.lo + sums.predicted.hi;
  const int4 quarters = halves.lo + halves.hi;
  RowSum sum;
  sum.cells = sums.chunks * EGOSGM_LANES;
  sum.predicted = quarters.x + quarters.y + quarters.z + quarters.w;
  return sum;
}

#endif

#endif
