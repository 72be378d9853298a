// SPDX-License-Identifier: Apache-2.0
// Why a left pixel has no value, or one that is doubtful: a byte of EGOSGM_REASON_*. What the stages decided follows
// from their maps. What the image alone tells (flat, saturated, repeating) is looked for here, only where it is asked
// for.
#include "bit_count.h"
#include "code.h"
#include "grey.h"
#include "method.h"
#include "pixels.h"

// lint: PIXEL_BYTES=1 CODE_BYTES=4 PIXELS=16
// lint: PIXEL_BYTES=1 CODE_BYTES=8 PIXELS=1
// lint: PIXEL_BYTES=2 CODE_BYTES=8 PIXELS=16
// lint: PIXEL_BYTES=2 CODE_BYTES=4 PIXELS=1

#if PIXEL_BYTES == 1
#define WHITE 255.0f
#else
#define WHITE 65535.0f
#endif
#define NO_RUN 0xffff  // of a pixel that SpeckleRemoval did not look at

#if PIXELS > 1
AT_EDGE Floats load_grey_values_at_edge(global const Pixel* row, const int x, const int width) {
  const Ints inside = clamp(x + LANE_INDICES, (Ints)(0), (Ints)(width - 1));
  return GATHERED(Floats, row, inside);
}
#endif

// Grey values x .. x + PIXELS - 1 of a row; those outside of it are its border's.
static inline Floats load_grey_values(global const Pixel* row, const int x, const int width) {
#if PIXELS == 1
  return row[clamp(x, 0, width - 1)];
#else
  if (x >= 0 && x + PIXELS <= width) return convert_float16(load_grey(row + x));
  return load_grey_values_at_edge(row, x, width);
#endif
}

// The texture of the window around a pixel, as far as the image has its rows: how much the grey values two columns
// apart differ, how many are black or white, and of how many that is.
typedef struct {
  Floats changes, extremes;
  float pixels;
} Texture;

static inline Texture texture_around(const ImageSize size, global const Pixel* image, const int x, const int y) {
  Texture texture = {0.0f, 0.0f, 0.0f};
  const int end = min(y + EGOSGM_TEXTURE_RADIUS, size.height - 1);
  for (int v = max(y - EGOSGM_TEXTURE_RADIUS, 0); v <= end; ++v) {
    global const Pixel* row = image + (size_t)v * size.width;
    Floats before = load_grey_values(row, x - EGOSGM_TEXTURE_RADIUS - 1, size.width);
    Floats at = load_grey_values(row, x - EGOSGM_TEXTURE_RADIUS, size.width);
    for (int u = x - EGOSGM_TEXTURE_RADIUS; u <= x + EGOSGM_TEXTURE_RADIUS; ++u) {
      const Floats after = load_grey_values(row, u + 1, size.width);
      texture.changes += fabs(after - before);
      texture.extremes += one_where((at <= 0.0f) | (at >= WHITE));
      before = at;
      at = after;
    }
    texture.pixels += 2 * EGOSGM_TEXTURE_RADIUS + 1;
  }
  return texture;
}

// The span of the disparities that were warped near a pixel of the row.
static inline Floats jump_in_row(global const float* warped, const int x, const int width) {
  Floats least = INFINITY;
  Floats most = -INFINITY;
  for (int u = x - EGOSGM_UNCOVERED_RADIUS; u <= x + EGOSGM_UNCOVERED_RADIUS; ++u) {
    const Floats d = load_pixels(warped, u, width);
    least = ((d > INVALID) & (d < least)) ? d : least;
    most = ((d > INVALID) & (d > most)) ? d : most;
  }
  return most - least;
}

// The Hamming distances of a code to each of PIXELS codes side by side.
static inline Ints codes_apart(const Code own, global const Code* others) {
#if PIXELS == 1
  return (int)popcount(own ^ others[0]);
#else
  Codes bits = load_codes(others) ^ own;
  BIT_COUNT(Codes, bits);
  return convert_int16(bits);
#endif
}

// The Hamming distances of the codes of a grid around a pixel to those around PIXELS places side by side, the first of
// which is `other`, where columns of the grid lead in `direction`, in all; sums beyond `most` need not be whole.
// `stride`: of rows of codes.
static inline Ints bits_apart_around(global const Code* own, global const Code* other, const int direction,
                                     const long stride, const int y, const int height, const int most) {
  Ints bits = 0;
  for (int v = -EGOSGM_REPEAT_RADIUS; v <= EGOSGM_REPEAT_RADIUS && any_of(bits <= most); v += EGOSGM_REPEAT_STEP) {
    if (y + v < 0 || y + v >= height) continue;
    for (int u = -EGOSGM_REPEAT_RADIUS; u <= EGOSGM_REPEAT_RADIUS; u += EGOSGM_REPEAT_STEP) {
      bits += codes_apart(own[v * stride + u], other + v * stride + direction * u);
    }
  }
  return bits;
}

// Whether the pixel in the middle of a block looks like another one of its row that a disparity of the range may take
// for it: by no more bits than noise makes it differ from its match. `measured`: of the left view. REQUIRES: codes with
// a padding of the number of disparities, of the grid and of PIXELS.
COMPILED_ONCE void find_repeats_row(const WorkItem at, const ImageSize size, const int disparities, const int padding,
                                    global const uint* all_codes, global const float* measured, global uchar* repeats) {
  const int width = size.width, height = size.height;
  const int columns = coarse_size(size).width;
  const int y = min(at.y * EGOSGM_COARSE + EGOSGM_COARSE / 2, height - 1);
  const long stride = width + 2 * (long)padding;
  global const Code* left = (global const Code*)all_codes + y * stride + padding;
  global const Code* right = left + height * stride;  // from right to left
  int places = 0;
  for (int v = -EGOSGM_REPEAT_RADIUS; v <= EGOSGM_REPEAT_RADIUS; v += EGOSGM_REPEAT_STEP) {
    if (y + v >= 0 && y + v < height) places += 2 * EGOSGM_REPEAT_RADIUS / EGOSGM_REPEAT_STEP + 1;
  }
  for (int block = at.x; block < columns; block += at.items) {
    const int x = min(block * EGOSGM_COARSE + EGOSGM_COARSE / 2, width - 1);
    global const Code* own = left + x;
    global const float* of_row = measured + (size_t)y * width;
    float d = of_row[x];  // or that of the first pixel beside it that has one
    for (int u = x / EGOSGM_COARSE * EGOSGM_COARSE; u < width && u < x + 2 && d <= EGOSGM_INVALID_DISPARITY; ++u) {
      d = of_row[u];
    }
    const int match = width - 1 - x + (int)(d + 0.5f);
    int most = EGOSGM_REPEAT_BITS * places;
    if (d > EGOSGM_INVALID_DISPARITY && match >= 0 && match < width) {
      const Ints of_match = bits_apart_around(own, right + match, -1, stride, y, height, INT_MAX);
      most = max(most, LANE(int, of_match, 0));
    }
    const int end = min(disparities, width - x);
    int found = 0;
    for (int k = -min(disparities - 1, x); k < end && !found; k += PIXELS) {
      const Ints other = k + LANE_INDICES;
      const Ints bits = bits_apart_around(own, own + k, 1, stride, y, height, most);
      found = any_of((abs(other) >= (Uints)(EGOSGM_LEAST_REPEAT_PX)) & (other < (Ints)(end)) & (bits <= most));
    }
    repeats[(size_t)at.y * columns + block] = (uchar)found;
  }
}

KERNEL void find_repeats(const ImageSize size, const int disparities, const int padding, global const uint* all_codes,
                         global const float* measured, global uchar* repeats) {
  find_repeats_row(THIS_WORK_ITEM, size, disparities, padding, all_codes, measured, repeats);
}

// Whether what was matched in the blocks that pixels lie in is no better than the best of many matches of noise. Where
// nothing was matched, it is not known.
static inline Ints is_like_noise(global const int* blocks, const int x) {
#if PIXELS == 1
  const int evidence = blocks[x / EGOSGM_COARSE];
#else
  const int16 evidence = vload4(0, blocks + x / EGOSGM_COARSE).s0000111122223333;
#endif
  return (evidence != 0) & (evidence < EGOSGM_EVIDENCE_OF_NOISE + EGOSGM_EVIDENCE_OF_CHOICE);
}

static inline Ints are_repeated(global const uchar* repeats, const int x, const int width) {
#if PIXELS == 1
  return repeats[x / EGOSGM_COARSE];
#else
  int lanes[PIXELS];
  for (int i = 0; i < PIXELS; ++i) lanes[i] = x + i < width && repeats[(x + i) / EGOSGM_COARSE] ? -1 : 0;
  return vload16(0, lanes);
#endif
}

// Whether SpeckleRemoval looked at a pixel.
static inline Ints has_run(global const ushort* runs, const int x, const int width) {
#if PIXELS == 1
  return runs[x] != NO_RUN;
#else
  int lanes[PIXELS];
  for (int i = 0; i < PIXELS; ++i) lanes[i] = x + i < width && runs[x + i] != NO_RUN ? -1 : 0;
  return vload16(0, lanes);
#endif
}

// `row_step`: every so many-th row is predicted, measured and fused, and is asked for the rows below it, too.
// `least_change`: the image is flat where grey values two columns apart differ by less in the mean. `repeats`: of
// find_repeats. `runs`: of SpeckleRemoval. `doubtful`, `evidence`: of KalmanUpdate. `block_evidence`: of
// Evidence. What there is not (has_repeats, has_prediction, has_runs, has_evidence) may be any buffer.
COMPILED_ONCE void explain_row(const WorkItem at, const ImageSize size, const int row_step, const float least_change,
                               global const uchar* images, const int has_repeats, global const uchar* repeats,
                               const int has_prediction, global const float* warped, global const uchar* hidden,
                               global const float* measured, const int has_runs, global const ushort* runs,
                               global const float* disparity, global const uchar* doubtful, const int has_evidence,
                               global const uchar* evidence, global const int* block_evidence, global uchar* reasons) {
  const int y = at.y;
  const int width = size.width;
  const size_t row = (size_t)y * width, known = (size_t)(y - y % row_step) * width;
  const int columns = coarse_size(size).width;
  global const uchar* repeats_of_blocks = repeats + (size_t)(y / EGOSGM_COARSE) * columns;
  global const int* evidence_of_blocks = block_evidence + (size_t)(y / EGOSGM_COARSE) * EGOSGM_EVIDENCE_STRIDE(width);
  const Floats jump = EGOSGM_UNCOVERED_JUMP_PX;
  const Floats off = EGOSGM_DIFFERENCE_PX;

  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(disparity + row, x, width);
    const Floats z = load_pixels(measured + known, x, width);
    const Floats w = has_prediction ? load_pixels(warped + known, x, width) : INVALID;
    const Ints has_value = d > INVALID;
    const Ints is_measured = z > INVALID;
    const Ints is_warped = w > INVALID;
    const Ints is_hidden = has_prediction ? load_bytes(hidden + known, x, width) != 0 : (Ints)(0);
    const Ints is_doubtful = has_prediction ? load_bytes(doubtful + known, x, width) != 0 : (Ints)(0);
    const Ints differs = has_value ? is_doubtful : fabs(z - w) > off;
    const Ints contradicts = is_measured & is_warped & differs;
    const Ints is_speckle = has_runs ? has_run(runs + known, x, width) & !is_measured : (Ints)(0);
    const Ints is_uncovered = has_prediction ? (jump_in_row(warped + known, x, width) > jump) & !is_warped : (Ints)(0);
    const Texture texture = texture_around(size, (global const Pixel*)images, x, y);
    Ints is_weak = 0, is_sure = 0;
    if (has_evidence) {
      const Ints of_pixel = load_bytes(evidence + known, x, width);
      is_sure = has_value & (of_pixel > EGOSGM_EVIDENCE_TRUSTED);
      is_weak = has_value      ? is_measured & (of_pixel < EGOSGM_EVIDENCE_TRUSTED)
                : is_uncovered ? (Ints)(0)
                               : is_like_noise(evidence_of_blocks, x);
    }
    const Ints is_plain = texture.changes < (Floats)(least_change * texture.pixels);
    const Ints is_flat = (is_weak != 0) | (is_plain & !is_sure);
    const Ints is_saturated = 2.0f * texture.extremes >= (Floats)(texture.pixels);

    Ints reason = has_value ? (Ints)(EGOSGM_REASON_TRUSTED) : (Ints)(EGOSGM_REASON_UNCONFIRMED);
    const Ints is_ambiguous = has_repeats ? are_repeated(repeats_of_blocks, x, width) : (Ints)(0);
    reason = is_ambiguous ? (Ints)(EGOSGM_REASON_AMBIGUOUS) : reason;
    reason = is_uncovered ? (Ints)(EGOSGM_REASON_UNCOVERED) : reason;
    reason = (has_value & !is_measured) ? (Ints)(EGOSGM_REASON_PREDICTED) : reason;
    reason = (is_speckle & !has_value) ? (Ints)(EGOSGM_REASON_SPECKLE) : reason;
    reason = is_flat ? (Ints)(EGOSGM_REASON_FLAT) : reason;
    reason = is_saturated ? (Ints)(EGOSGM_REASON_SATURATED) : reason;
    reason = contradicts ? (Ints)(EGOSGM_REASON_CONTRADICTED) : reason;
    reason = is_hidden ? (Ints)(EGOSGM_REASON_NEARER) : reason;
    store_bytes(reason, reasons + row, x, width);
  }
}

KERNEL void explain(const ImageSize size, const int row_step, const float least_change, global const uchar* images,
                    const int has_repeats, global const uchar* repeats, const int has_prediction,
                    global const float* warped, global const uchar* hidden, global const float* measured,
                    const int has_runs, global const ushort* runs, global const float* disparity,
                    global const uchar* doubtful, const int has_evidence, global const uchar* evidence,
                    global const int* block_evidence, global uchar* reasons) {
  explain_row(THIS_WORK_ITEM, size, row_step, least_change, images, has_repeats, repeats, has_prediction, warped,
              hidden, measured, has_runs, runs, disparity, doubtful, has_evidence, evidence, block_evidence, reasons);
}
