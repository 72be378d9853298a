// SPDX-License-Identifier: Apache-2.0
// Evidence: how much better a match is than chance, from the images alone, whatever the band was. A pixel's code is
// compared with that of its match, and with those of control pixels of the same row that lie well away from the match.
// Codes of nothing but noise are as far from the one as from the others, so that the mean difference is 0. It is taken
// over a window, at full resolution and at a quarter of it, where noise is weaker and broad texture is not. Blocks that
// are much brighter or darker do not count, neither in the window nor in the codes at a quarter: they tell of another
// surface, and its outline is seen from afar.
//
// The test asks the prediction, at its own place, before anything was chosen there: a chosen match would be better
// than chance in noise, too. Where there is none, or the measurement lies beyond the gate, it is the measurement.
//
// All is counted in whole numbers, EGOSGM_EVIDENCE_UNITS a bit.
#include "bit_count.h"
#include "code.h"
#include "method.h"
#include "pixels.h"
#include "supporters.h"

// lint: CODE_BYTES=8 PIXELS=1
// lint: CODE_BYTES=8 PIXELS=16

#if CODE_BYTES != 8
#error "CODE_BYTES: 8, the evidence of two words"
#endif

// The codes of a row of a view, and of the other view's, as Census lays them out: the codes a pixel is compared with at
// growing disparities lie at growing addresses.
typedef struct {
  global const Code *own, *other;
  int width, view;
} CodeRows;

static inline CodeRows code_rows(global const uint* all_codes, const ImageSize size, const int padding, const int view,
                                 const int y) {
  const size_t stride = (size_t)size.width + 2 * (size_t)padding;
  global const Code* codes = (global const Code*)all_codes + padding;
  CodeRows rows;
  rows.own = codes + ((size_t)view * size.height + y) * stride;
  rows.other = codes + ((size_t)(1 - view) * size.height + y) * stride;
  rows.width = size.width;
  rows.view = view;
  return rows;
}

static inline int bits_apart(const Code a, const Code b) {
#if PIXELS == 1
  return (int)popcount(a ^ b);
#else
  Code x = a ^ b;
  BIT_COUNT(Code, x);
  return (int)x;
#endif
}

// The place of a pixel in its row of codes. That of its match lies as far from the other end of the other row, and the
// disparity further.
static inline int own_place(const CodeRows* rows, const int x) {
  return rows->view == EGOSGM_LEFT ? x : rows->width - 1 - x;
}
static inline int place_of_match(const CodeRows* rows, const int x, const int disparity) {
  return rows->width - 1 - own_place(rows, x) + disparity;
}

constant int kCoarseControls[8] = EGOSGM_COARSE_CONTROLS;

// The controls' distances less that of the match, times their number: of four controls, and of eight. Loads are
// volatile lest a compiler makes gather instructions of them, which are slower.
static inline int beyond_four(const Code own, volatile global const Code* match) {
  return bits_apart(own, match[-EGOSGM_FAR_CONTROL]) + bits_apart(own, match[-EGOSGM_NEAR_CONTROL]) +
         bits_apart(own, match[EGOSGM_NEAR_CONTROL]) + bits_apart(own, match[EGOSGM_FAR_CONTROL]) -
         4 * bits_apart(own, match[0]);
}
static inline int beyond_eight(const Code own, volatile global const Code* match, const Code alike) {
  int beyond = -8 * bits_apart(own & alike, match[0] & alike);
#pragma unroll
  for (int i = 0; i < 8; ++i) beyond += bits_apart(own & alike, match[kCoarseControls[i]] & alike);
  return beyond;
}

// The disparities that are tested.
static inline Floats asked_of(const Floats predicted, const Floats measured, const float gate) {
  const Ints contradicted = (measured > INVALID) & (fabs(measured - predicted) > gate);
  return ((predicted > INVALID) & !contradicted) ? predicted : measured;
}

// The evidence of PIXELS pixels of a row, those whose match lies in the other image; `counts`: 1 of these.
static inline Ints compared(const CodeRows* rows, const int x, const Floats asked, Ints* counts) {
  const Ints is_asked = asked > INVALID;
  const Ints at = x + LANE_INDICES;
  const Ints own = rows->view == EGOSGM_LEFT ? at : rows->width - 1 - at;
  const Ints match = rows->width - 1 - own + INTS_OF_FLOATS(nearest(is_asked ? asked : (Floats)(0.0f)));
  const Ints is_inside = is_asked & (match >= 0) & (match < (Ints)(rows->width));
  const Ints owns = is_inside ? own : (Ints)(0);
  const Ints places = is_inside ? match : (Ints)(0);
  int beyond[PIXELS];
#pragma unroll
  for (int i = 0; i < PIXELS; ++i) {
    beyond[i] = beyond_four(rows->own[LANE(int, owns, i)], rows->other + LANE(int, places, i));
  }
  *counts = is_inside ? (Ints)(1) : (Ints)(0);
#if PIXELS == 1
  return is_inside ? beyond[0] : 0;
#else
  return is_inside ? vload16(0, beyond) : (Ints)(0);
#endif
}

// Half of the weight of a full pixel, of each of `count` in a block: what the image at a quarter of the resolution says
// of the disparity in the middle of the block, by those pixels of the code's window that are alike, if a few are.
static inline int of_coarse(const CodeRows* coarse, const CodeRows* alike, const int block, const float disparity,
                            const int count) {
  if (!(disparity > EGOSGM_INVALID_DISPARITY)) return 0;
  const float shift = 12582912.0f;  // 1.5 * 2^23: rounds
  const int match = place_of_match(coarse, block, (int)((disparity / EGOSGM_COARSE + shift) - shift));
  const int own = own_place(coarse, block), bits = (int)popcount(alike->own[own]);
  if (match < 0 || match >= coarse->width || bits < EGOSGM_ALIKE_LEAST_BITS) return 0;
  return count * beyond_eight(coarse->own[own], coarse->other + match, alike->own[own]) * (EGOSGM_EVIDENCE_UNITS / 16) *
         62 / bits;
}

// The sum of a block: the evidence of `asked` pixels of its row, and how many these are; `absent` ones have none.
// `coarse`: what a quarter of the resolution says of them.
static inline EvidenceSum sum_of_block(const int beyond, const int coarse, const int asked, const int absent) {
  const EvidenceSum sum = {EGOSGM_EVIDENCE_WEIGHT * (EGOSGM_EVIDENCE_UNITS / 4 * beyond + coarse),
                           EGOSGM_EVIDENCE_WEIGHT * asked + absent};
  return sum;
}

// Sums of blocks of EGOSGM_COARSE x EGOSGM_COARSE pixels, by the row in their middle: the evidence of those that are
// asked and whose match lies in the other image. `coarse_codes` and `alike` are those of the image at a quarter of the
// resolution. A work-item a block, or a row of them.
COMPILED_ONCE void compare_row(const WorkItem at, const ImageSize size, const float gate, const int padding,
                               global const uint* codes, const int has_coarse, const int coarse_padding,
                               global const uint* coarse_codes, global const uint* alike, global const float* predicted,
                               global const float* measured, global EvidenceSum* sums) {
  const ImageSize blocks = coarse_size(size);
  const int view = at.view, width = size.width;
  const int top = at.y * EGOSGM_COARSE, middle = top + EGOSGM_COARSE / 2;
  const int y = middle < size.height ? middle : top;
  const CodeRows rows = code_rows(codes, size, padding, view, y);
  const CodeRows coarse = code_rows(coarse_codes, blocks, coarse_padding, view, at.y);
  const CodeRows alike_row = code_rows(alike, blocks, coarse_padding, view, at.y);
  const size_t pixels = ((size_t)view * size.height + y) * width;
  global EvidenceSum* row = sums + ((size_t)view * blocks.height + at.y) * blocks.width;
#if PIXELS == 1
  if (at.x >= blocks.width) return;
  const int start = at.x * EGOSGM_COARSE, stop = min(start + EGOSGM_COARSE, width);
  int beyond = 0, asked_count = 0, absent = 0;
  float of_middle = EGOSGM_INVALID_DISPARITY;
  for (int x = start; x < stop; ++x) {
    const float asked = asked_of(predicted[pixels + x], measured[pixels + x], gate);
    int counts;
    beyond += compared(&rows, x, asked, &counts);
    asked_count += counts;
    if (!(asked > EGOSGM_INVALID_DISPARITY)) ++absent;
    if (x == min(start + EGOSGM_COARSE / 2, width - 1)) of_middle = asked;
  }
  const int of_quarter = has_coarse ? of_coarse(&coarse, &alike_row, at.x, of_middle, asked_count) : 0;
  row[at.x] = sum_of_block(beyond, of_quarter, asked_count, absent);
#else
  FOR_PIXELS(x, width) {
    const Floats of_prediction = load_pixels(predicted + pixels, x, width);
    const Floats asked = asked_of(of_prediction, load_pixels(measured + pixels, x, width), gate);
    Ints counts;
    const Ints beyond = compared(&rows, x, asked, &counts);
    const Ints absent = !(asked > INVALID) & (x + LANE_INDICES < (Ints)(width)) & (Ints)(1);
    const int4 beyond4 = sums_of_fours(beyond), asked4 = sums_of_fours(counts), absent4 = sums_of_fours(absent);
    for (int i = 0; i < PIXELS / EGOSGM_COARSE && x / EGOSGM_COARSE + i < blocks.width; ++i) {
      const int block = x / EGOSGM_COARSE + i, lane = min(EGOSGM_COARSE * i + EGOSGM_COARSE / 2, width - 1 - x);
      const int asked_count = LANE(int, asked4, i);
      const int of_quarter =
          has_coarse ? of_coarse(&coarse, &alike_row, block, LANE(float, asked, lane), asked_count) : 0;
      row[block] = sum_of_block(LANE(int, beyond4, i), of_quarter, asked_count, LANE(int, absent4, i));
    }
  }
#endif
}

KERNEL void compare(const ImageSize size, const float gate, const int padding, global const uint* codes,
                    const int has_coarse, const int coarse_padding, global const uint* coarse_codes,
                    global const uint* alike, global const float* predicted, global const float* measured,
                    global EvidenceSum* sums) {
  compare_row(THIS_WORK_ITEM, size, gate, padding, codes, has_coarse, coarse_padding, coarse_codes, alike, predicted,
              measured, sums);
}

// Sums of blocks side by side.
typedef struct {
  Ints sums, counts;
} BlockSums;
static inline BlockSums added(const BlockSums a, const BlockSums b) {
  return (BlockSums){a.sums + b.sums, a.counts + b.counts};
}
static inline BlockSums less(const BlockSums a, const BlockSums b) {
  return (BlockSums){a.sums - b.sums, a.counts - b.counts};
}

#if PIXELS > 1
AT_EDGE BlockSums load_sums_at_edge(global const int* row, const int x, const int width) {
  const Ints at = x + LANE_INDICES, inside = clamp(at, (Ints)(0), (Ints)(width - 1)), places = 2 * inside;
  const BlockSums loaded = {GATHERED(Ints, row, places), GATHERED(Ints, row + 1, places)};
  return (BlockSums){at == inside ? loaded.sums : (Ints)(0), at == inside ? loaded.counts : (Ints)(0)};
}
#endif
// Those of blocks x .. x + PIXELS - 1 of a row; outside of it they are 0.
static inline BlockSums load_sums(global const EvidenceSum* row, const int x, const int width) {
#if PIXELS == 1
  const int is_inside = x >= 0 && x < width;
  return (BlockSums){is_inside ? row[x].sum : 0, is_inside ? row[x].count : 0};
#else
  if (x < 0 || x + PIXELS > width) return load_sums_at_edge((global const int*)row, x, width);
  global const PackedInts* pairs = (global const PackedInts*)(row + x);
  const Ints first = pairs[0].lanes, second = pairs[1].lanes;
  return (BlockSums){(Ints)(first.even, second.even), (Ints)(first.odd, second.odd)};
#endif
}

// Which of the five blocks around the one dy below each block are alike, by its code (census.cl): the leftmost has the
// highest bit.
static inline Ints alike_in_row(const CodeRows* alike, const int x, const int dy) {
  const int last = (dy + 3) * 9 + 6, shift = dy < 0 ? 61 - last : 62 - last, place = own_place(alike, x);
#if PIXELS == 1
#define BITS(shift, mask) (int)(alike->own[place] >> (shift) & (mask))
#else
  Codes codes = load_codes(alike->own + (alike->view == EGOSGM_LEFT ? place : place - (PIXELS - 1)));
  if (alike->view == EGOSGM_RIGHT) codes = codes.sfedcba9876543210;
#define BITS(shift, mask) convert_int16(codes >> (Codes)(shift) & (Codes)(mask))
#endif
  return dy == 0 ? BITS(31, 3) << 3 | 4 | BITS(29, 3) : BITS(shift, 31);
}

// Makes `least`, a mean of `counts`, that of a part where this has less and is no mean of a few.
static inline void keep_least(BlockSums* least, const BlockSums part) {
  const Ints is_less =
      (part.counts > EGOSGM_EVIDENCE_LEAST_COUNT) & (part.sums * least->counts < least->sums * part.counts);
  least->sums = is_less ? part.sums : least->sums;
  least->counts = is_less ? part.counts : least->counts;
}

// The evidence of each block: the least of the means over a window of blocks that are alike and over its four halves,
// so that a plain place beside a textured one has none. `found`: the disparity that the coarse match found there [px];
// rows of both have EGOSGM_EVIDENCE_STRIDE places.
COMPILED_ONCE void gather_row(const WorkItem at, const ImageSize size, const int has_coarse, const int coarse_padding,
                              global const float* coarse, global const uint* alike, global const EvidenceSum* sums,
                              global int* evidence, global float* found) {
  const ImageSize blocks = coarse_size(size);
  const int radius = EGOSGM_EVIDENCE_RADIUS, width = blocks.width;
  const size_t row = (size_t)at.view * blocks.height + at.y, places = row * EGOSGM_EVIDENCE_STRIDE(size.width);
  const CodeRows alike_row = code_rows(alike, blocks, coarse_padding, at.view, at.y);
  FOR_PIXELS(x, width) {
    const BlockSums none = {0, 0};
    BlockSums all = none, left = none, right = none, above = none, below = none;
    for (int v = max(at.y - radius, 0); v <= min(at.y + radius, blocks.height - 1); ++v) {
      const Ints is_alike = has_coarse ? alike_in_row(&alike_row, x, v - at.y) : (Ints)(31);
      BlockSums of_row = none;
#pragma unroll
      for (int u = -radius; u <= radius; ++u) {
        BlockSums sums_there = load_sums(sums + ((size_t)at.view * blocks.height + v) * width, x + u, width);
        const Ints counts = -(is_alike >> (radius - u) & 1);
        sums_there.sums &= counts;
        sums_there.counts &= counts;
        of_row = added(of_row, sums_there);
        if (u < 0) left = added(left, sums_there);
        if (u > 0) right = added(right, sums_there);
      }
      all = added(all, of_row);
      if (v < at.y) above = added(above, of_row);
      if (v > at.y) below = added(below, of_row);
    }
    BlockSums least = {all.sums, max(all.counts, (Ints)(1))};
    keep_least(&least, less(all, right));
    keep_least(&least, less(all, left));
    keep_least(&least, less(all, below));
    keep_least(&least, less(all, above));
    store_words(least.sums / least.counts, (global uchar*)(evidence + places), x, width);
    const Floats d = has_coarse ? load_pixels(coarse + row * width, x, width) : INVALID;
    store_pixels(d > INVALID ? (float)EGOSGM_COARSE * d : INVALID, found + places, x, width);
  }
}

KERNEL void gather_evidence(const ImageSize size, const int has_coarse, const int coarse_padding,
                            global const float* coarse, global const uint* alike, global const EvidenceSum* sums,
                            global int* evidence, global float* found) {
  gather_row(THIS_WORK_ITEM, size, has_coarse, coarse_padding, coarse, alike, sums, evidence, found);
}

// Publishes of a belief the pixels with much evidence, and those with little within confirmed ones of the same surface.
// Where the left view alone is tracked (by_left), a right pixel has the evidence of the left pixel that it sees, and
// must be confirmed itself.
COMPILED_ONCE void publish_row(const WorkItem at, const ImageSize size, const int row_step, const int by_left,
                               global const float* disparity, global const uchar* evidence, global float* published) {
  if (!has_row(at, row_step)) return;
  const int width = size.width;
  const size_t left_row = (size_t)at.y * width;
  const size_t row = (size_t)at.view * size.height * width + left_row;
  const int asks_left = by_left && at.view == EGOSGM_RIGHT;
  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(disparity + row, x, width);
    Ints of_pixels;
    if (asks_left) {
      const Floats seen = nearest(FLOATS_OF_INTS(x + LANE_INDICES) + d);
      const Ints is_inside = (d > INVALID) & (seen >= 0.0f) & (seen < (Floats)(width));
      const Ints places = INTS_OF_FLOATS(is_inside ? seen : (Floats)(0.0f));
      of_pixels = is_inside ? GATHERED(Ints, evidence + left_row, places) : (Ints)(0);
    } else {
      of_pixels = load_bytes(evidence + row, x, width);
    }
    Ints is_given = (d > INVALID) & (of_pixels >= (asks_left ? EGOSGM_EVIDENCE_CONFIRMED : EGOSGM_EVIDENCE_TRUSTED));
    if (!asks_left) {
      const size_t view = row - left_row;
      is_given |= have_supporters(size, x, at.y, (d > INVALID) & !is_given, (Ints)(0), d, EGOSGM_SAME_SURFACE_PX,
                                  disparity + view, evidence + view);
    }
    store_pixels(is_given ? d : INVALID, published + row, x, width);
  }
}

KERNEL void publish_confirmed(const ImageSize size, const int row_step, const int by_left,
                              global const float* disparity, global const uchar* evidence, global float* published) {
  publish_row(THIS_WORK_ITEM, size, row_step, by_left, disparity, evidence, published);
}
