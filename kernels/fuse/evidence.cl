// SPDX-License-Identifier: Apache-2.0
// Evidence: how much better a match is than chance, from the images alone, whatever the band was. A pixel's code is
// compared with that of its match, and with those of control pixels of the same row that lie well away from the match.
// Codes of nothing but noise are as far from the one as from the others, so that the mean difference is 0. It is taken
// over a window, at full resolution and at a quarter of it, where noise is weaker and broad texture is not.
//
// What is asked is the prediction, at its own place, before anything was chosen there: a chosen match would be better
// than chance in noise, too. Where there is none, or the measurement lies beyond the gate, it is the measurement.
//
// All is counted in whole numbers, EGOSGM_EVIDENCE_UNITS a bit.
#include "code.h"
#include "method.h"
#include "pixels.h"

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

static inline int bits_apart(const Code a, const Code b) { return (int)popcount(a ^ b); }

// The place of the match of pixel x in the other row, which lies outside of the image if it is not in [0, width).
static inline int own_place(const CodeRows* rows, const int x) {
  return rows->view == EGOSGM_LEFT ? x : rows->width - 1 - x;
}
static inline int place_of_match(const CodeRows* rows, const int x, const int disparity) {
  return rows->width - 1 - own_place(rows, x) + disparity;
}

constant int kControls[8] = EGOSGM_COARSE_CONTROLS;

// The controls' distances less that of the match, times their number: of four controls, and of eight.
static inline int beyond_four(const CodeRows* rows, const int x, const int at) {
  const Code own = rows->own[own_place(rows, x)];
  global const Code* match = rows->other + at;
  return bits_apart(own, match[-EGOSGM_FAR_CONTROL]) + bits_apart(own, match[-EGOSGM_NEAR_CONTROL]) +
         bits_apart(own, match[EGOSGM_NEAR_CONTROL]) + bits_apart(own, match[EGOSGM_FAR_CONTROL]) -
         4 * bits_apart(own, match[0]);
}
static inline int beyond_eight(const CodeRows* rows, const int x, const int at) {
  const Code own = rows->own[own_place(rows, x)];
  global const Code* match = rows->other + at;
  int beyond = -8 * bits_apart(own, match[0]);
  for (int i = 0; i < 8; ++i) beyond += bits_apart(own, match[kControls[i]]);
  return beyond;
}

// What is asked of a pixel.
static inline float asked_of(const float predicted, const float measured, const float gate) {
  const bool has_prediction = predicted > EGOSGM_INVALID_DISPARITY;
  const bool has_measurement = measured > EGOSGM_INVALID_DISPARITY;
  return has_prediction && !(has_measurement && fabs(measured - predicted) > gate) ? predicted : measured;
}

// The nearest whole number, as rint. REQUIRES: |value| < 2^22.
static inline int whole(const float value) {
  const float shift = 12582912.0f;  // 1.5 * 2^23
  return (int)((value + shift) - shift);
}

// Sums of a block of EGOSGM_COARSE x EGOSGM_COARSE pixels: the evidence of those whose match lies in the other image,
// and how many these are. `coarse_codes` are those of the image at a quarter of the resolution.
COMPILED_ONCE void compare_row(const WorkItem at, const ImageSize size, const float gate, const int padding,
                               global const uint* codes, const int has_coarse, const int coarse_padding,
                               global const uint* coarse_codes, global const float* predicted,
                               global const float* measured, global EvidenceSum* sums) {
  const ImageSize blocks = {(size.width + EGOSGM_COARSE - 1) / EGOSGM_COARSE,
                            (size.height + EGOSGM_COARSE - 1) / EGOSGM_COARSE};
  const int view = at.view;
  const int y = at.y * EGOSGM_COARSE;
  const size_t first = (size_t)view * size.height;
  const CodeRows coarse = code_rows(coarse_codes, blocks, coarse_padding, view, at.y);
  const int y_of_coarse = min(y + EGOSGM_COARSE / 2, size.height - 1);
  for (int block = at.x; block < blocks.width; block += at.items) {
    const int x = block * EGOSGM_COARSE;
    int sum = 0;
    int count = 0;
    for (int v = y; v < min(y + EGOSGM_COARSE, size.height); ++v) {
      const CodeRows rows = code_rows(codes, size, padding, view, v);
      global const float* of_prediction = predicted + (first + v) * size.width;
      global const float* of_measurement = measured + (first + v) * size.width;
      for (int u = x; u < min(x + EGOSGM_COARSE, size.width); ++u) {
        const float d = asked_of(of_prediction[u], of_measurement[u], gate);
        if (!(d > EGOSGM_INVALID_DISPARITY)) continue;
        const int match = place_of_match(&rows, u, whole(d));
        if (match < 0 || match >= size.width) continue;
        sum += beyond_four(&rows, u, match);
        count += 1;
      }
    }
    sum *= EGOSGM_EVIDENCE_UNITS / 4;
    const int x_of_coarse = min(x + EGOSGM_COARSE / 2, size.width - 1);
    const size_t middle = (first + y_of_coarse) * size.width + x_of_coarse;
    const float d = asked_of(predicted[middle], measured[middle], gate);
    if (has_coarse && d > EGOSGM_INVALID_DISPARITY) {
      const int match = place_of_match(&coarse, block, whole(d / EGOSGM_COARSE));
      const bool is_inside = match >= 0 && match < blocks.width;
      // Half of the weight: the mean of eight, in units, halved.
      if (is_inside) sum += count * beyond_eight(&coarse, block, match) * (EGOSGM_EVIDENCE_UNITS / 16);
    }
    const EvidenceSum of_block = {sum, count};
    sums[((size_t)view * blocks.height + at.y) * blocks.width + block] = of_block;
  }
}

KERNEL void compare(const ImageSize size, const float gate, const int padding, global const uint* codes,
                    const int has_coarse, const int coarse_padding, global const uint* coarse_codes,
                    global const float* predicted, global const float* measured, global EvidenceSum* sums) {
  compare_row(THIS_WORK_ITEM, size, gate, padding, codes, has_coarse, coarse_padding, coarse_codes, predicted, measured,
              sums);
}

static inline int mean_evidence(const int2 sums) { return sums.x / sums.y; }
static inline int least_evidence(const int evidence, const int2 part) {
  return part.y > EGOSGM_EVIDENCE_LEAST_COUNT ? min(evidence, mean_evidence(part)) : evidence;
}

// The evidence of each block: the least of the means over a window of blocks and over its four halves, so that a plain
// place beside a textured one has none. `found`: the disparity that the coarse match found there [px]; rows of both have
// EGOSGM_EVIDENCE_STRIDE places.
COMPILED_ONCE void gather_row(const WorkItem at, const ImageSize size, const int has_coarse,
                              global const float* coarse, global const EvidenceSum* sums, global int* evidence,
                              global float* found) {
  const ImageSize blocks = {(size.width + EGOSGM_COARSE - 1) / EGOSGM_COARSE,
                            (size.height + EGOSGM_COARSE - 1) / EGOSGM_COARSE};
  const int radius = EGOSGM_EVIDENCE_RADIUS;
  const size_t row = (size_t)at.view * blocks.height + at.y;
  const int stride = EGOSGM_EVIDENCE_STRIDE(size.width);
  for (int x = at.x; x < blocks.width; x += at.items) {
    int2 left = 0, middle = 0, right = 0, above = 0, below = 0, here = 0;
    for (int v = max(at.y - radius, 0); v <= min(at.y + radius, blocks.height - 1); ++v) {
      global const int2* of_row = (global const int2*)sums + ((size_t)at.view * blocks.height + v) * blocks.width;
      int2 of_left = 0, of_right = 0;
      for (int u = max(x - radius, 0); u < x; ++u) of_left += of_row[u];
      for (int u = x + 1; u <= min(x + radius, blocks.width - 1); ++u) of_right += of_row[u];
      left += of_left;
      middle += of_row[x];
      right += of_right;
      const int2 all = of_left + of_row[x] + of_right;
      if (v < at.y) above += all;
      if (v == at.y) here = all;
      if (v > at.y) below += all;
    }
    const int2 whole_window = left + middle + right;
    int least = whole_window.y > 0 ? mean_evidence(whole_window) : 0;
    least = least_evidence(least, left + middle);
    least = least_evidence(least, middle + right);
    least = least_evidence(least, above + here);
    least = least_evidence(least, here + below);
    evidence[row * stride + x] = least;
    const float d = has_coarse ? coarse[row * blocks.width + x] : EGOSGM_INVALID_DISPARITY;
    found[row * stride + x] = d > EGOSGM_INVALID_DISPARITY ? EGOSGM_COARSE * d : EGOSGM_INVALID_DISPARITY;
  }
}

KERNEL void gather_evidence(const ImageSize size, const int has_coarse, global const float* coarse,
                            global const EvidenceSum* sums, global int* evidence, global float* found) {
  gather_row(THIS_WORK_ITEM, size, has_coarse, coarse, sums, evidence, found);
}

// What is given out of a belief: what has been confirmed. Where the left view alone is tracked (by_left), a right pixel
// has the evidence of the left pixel that it sees.
COMPILED_ONCE void publish_row(const WorkItem at, const ImageSize size, const int by_left,
                               global const float* disparity, global const uchar* evidence, global float* published) {
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
    store_pixels(of_pixels >= EGOSGM_EVIDENCE_CONFIRMED ? d : INVALID, published + row, x, width);
  }
}

KERNEL void publish_confirmed(const ImageSize size, const int by_left, global const float* disparity,
                              global const uchar* evidence, global float* published) {
  publish_row(THIS_WORK_ITEM, size, by_left, disparity, evidence, published);
}
