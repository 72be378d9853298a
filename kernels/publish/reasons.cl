// SPDX-License-Identifier: Apache-2.0
// Why a left pixel has no value, or one that is doubtful: a byte of EGOSGM_REASON_*. What the stages decided follows
// from their maps. What the image alone tells (flat, saturated, repeating) is looked for here, only where it is asked
// for.
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
#define STEPS_PER_GREY 1.0f
#else
#define WHITE 65535.0f
#define STEPS_PER_GREY 257.0f
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

// Of the window around a pixel, as far as the image has its rows: how much the grey values two columns apart differ,
// how many are black or white, and of how many that is.
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

// How far apart those disparities lie that were warped near a pixel of the row.
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

static inline Ints distances(global const Code* own, global const Code* other) {
#if PIXELS == 1
  return convert_int(popcount(*own ^ *other));
#else
  return convert_int16(popcount(load_codes(own) ^ load_codes(other)));
#endif
}

// Which of `asked` look like the pixels at `other`: their own codes, and in the mean those of a grid around.
static inline Ints are_alike(const Ints asked, global const Code* own, global const Code* other, const long above,
                             const long below) {
  const Ints maybe = asked & (distances(own, other) <= EGOSGM_REPEAT_BITS);
  if (!any_of(maybe)) return 0;
  Ints bits = 0;
  int most = 0;
  for (int v = -1; v <= 1; ++v) {
    const long row = v < 0 ? above : v > 0 ? below : 0;
    if (v != 0 && row == 0) continue;
    for (int u = -EGOSGM_REPEAT_STEP; u <= EGOSGM_REPEAT_STEP; u += EGOSGM_REPEAT_STEP) {
      bits += distances(own + row + u, other + row + u);
      most += EGOSGM_REPEAT_BITS;
    }
  }
  return maybe & (bits <= (Ints)(most));
}

// Which pixels of `asked` look like another one of their row that a disparity of the range may take for it. `above`,
// `below`: from a row of codes to those EGOSGM_REPEAT_STEP away; 0: there is none. REQUIRES: codes with a padding of
// the number of disparities, of pixels and of steps.
static inline Ints repeats(const Ints asked, const int disparities, global const Code* codes, const long above,
                           const long below, const int x, const int width) {
  const Ints at = x + LANE_INDICES;
  Ints left = asked;
  for (int k = EGOSGM_LEAST_REPEAT_PX; k < disparities && any_of(left); ++k) {
    left &= !are_alike(left & (at >= (Ints)(k)), codes + x, codes + x - k, above, below);
    left &= !are_alike(left & (at < (Ints)(width - k)), codes + x, codes + x + k, above, below);
  }
  return asked & !left;
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

// `all_codes`: Census's, read where they are a census and no grey values. `runs`: SpeckleRemoval's.
// `doubtful`, `evidence`: KalmanUpdate's. What there is not (has_prediction, has_runs, has_evidence) may be any buffer.
COMPILED_ONCE void explain_row(const WorkItem at, const ImageSize size, const int disparities,
                               global const uchar* images, const int has_census, const int padding,
                               global const uint* all_codes, const int has_prediction, global const float* warped,
                               global const uchar* hidden, global const float* measured, const int has_runs,
                               global const ushort* runs, global const float* disparity, global const uchar* doubtful,
                               const int has_evidence, global const uchar* evidence, global uchar* reasons) {
  const int y = at.y;
  const int width = size.width;
  const size_t row = (size_t)y * width;
  const long stride = width + 2 * (long)padding;
  global const Code* codes = (global const Code*)all_codes + y * stride + padding;
  const long above = y >= EGOSGM_REPEAT_STEP ? -EGOSGM_REPEAT_STEP * stride : 0;
  const long below = y + EGOSGM_REPEAT_STEP < size.height ? EGOSGM_REPEAT_STEP * stride : 0;
  const Floats jump = EGOSGM_UNCOVERED_JUMP_PX;
  const Floats off = EGOSGM_DIFFERENCE_PX;

  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(disparity + row, x, width);
    const Floats z = load_pixels(measured + row, x, width);
    const Floats w = has_prediction ? load_pixels(warped + row, x, width) : INVALID;
    const Ints has_value = d > INVALID;
    const Ints is_measured = z > INVALID;
    const Ints is_warped = w > INVALID;
    const Ints is_hidden = has_prediction ? load_bytes(hidden + row, x, width) != 0 : (Ints)(0);
    const Ints is_doubtful = has_prediction ? load_bytes(doubtful + row, x, width) != 0 : (Ints)(0);
    const Ints differs = has_value ? is_doubtful : fabs(z - w) > off;
    const Ints contradicts = is_measured & is_warped & differs;
    const Ints is_speckle = has_runs ? has_run(runs + row, x, width) & !is_measured : (Ints)(0);
    const Ints is_uncovered = has_prediction ? (jump_in_row(warped + row, x, width) > jump) & !is_warped : (Ints)(0);
    const Texture texture = texture_around(size, (global const Pixel*)images, x, y);
    const Ints is_weak = (Ints)(has_evidence ? -1 : 0) & has_value & is_measured &
                         (load_bytes(evidence + row, x, width) < EGOSGM_EVIDENCE_TRUSTED);
    const Ints is_flat =
        (texture.changes < (Floats)(EGOSGM_LEAST_CHANGE * STEPS_PER_GREY * texture.pixels)) | (is_weak != 0);
    const Ints is_saturated = 2.0f * texture.extremes >= (Floats)(texture.pixels);

    Ints reason = has_value ? (Ints)(EGOSGM_REASON_TRUSTED) : (Ints)(EGOSGM_REASON_UNCONFIRMED);
    reason = is_uncovered ? (Ints)(EGOSGM_REASON_UNCOVERED) : reason;
    const Ints is_explained =
        is_uncovered | is_flat | is_saturated | is_speckle | contradicts | is_hidden | (has_value & !is_measured);
    const Ints is_ambiguous =
        has_census ? repeats(!is_explained, disparities, codes, above, below, x, width) : (Ints)(0);
    reason = is_ambiguous ? (Ints)(EGOSGM_REASON_AMBIGUOUS) : reason;
    reason = (has_value & !is_measured) ? (Ints)(EGOSGM_REASON_PREDICTED) : reason;
    reason = (is_speckle & !has_value) ? (Ints)(EGOSGM_REASON_SPECKLE) : reason;
    reason = is_flat ? (Ints)(EGOSGM_REASON_FLAT) : reason;
    reason = is_saturated ? (Ints)(EGOSGM_REASON_SATURATED) : reason;
    reason = contradicts ? (Ints)(EGOSGM_REASON_CONTRADICTED) : reason;
    reason = is_hidden ? (Ints)(EGOSGM_REASON_NEARER) : reason;
    store_bytes(reason, reasons + row, x, width);
  }
}

KERNEL void explain(const ImageSize size, const int disparities, global const uchar* images, const int has_census,
                    const int padding, global const uint* all_codes, const int has_prediction,
                    global const float* warped, global const uchar* hidden, global const float* measured,
                    const int has_runs, global const ushort* runs, global const float* disparity,
                    global const uchar* doubtful, const int has_evidence, global const uchar* evidence,
                    global uchar* reasons) {
  explain_row(THIS_WORK_ITEM, size, disparities, images, has_census, padding, all_codes, has_prediction, warped, hidden,
              measured, has_runs, runs, disparity, doubtful, has_evidence, evidence, reasons);
}
