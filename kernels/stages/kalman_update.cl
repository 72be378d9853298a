// SPDX-License-Identifier: Apache-2.0
// Kalman update of every pixel: K = p' / (p' + r), d = d' + K (z - d'), p = (1 - K) p'. Where the two contradict each
// other by more than the gate, the measurement is taken. It then is doubtful, and its variance is so large that the
// next frame searches wide. What is hidden by a surface nearer than the range (ForwardWarp) has no disparity: whatever
// is measured there is a mismatch. Without a gate nothing contradicts anything.
//
// What moves by itself is off to one side of its prediction, together with the pixels around. Their mean innovation m,
// the drift, moves the prediction to d' + m, and makes it as much less certain: p' + m^2.
//
// Evidence (evidence.cl) decides what lives: a pixel's evidence is a sum over frames that moves with the map. Below 0
// the pixel dies, whatever was predicted or measured. A measurement without evidence moves no prediction, and lowers no
// variance.
//
// A camera that stands sees the same mismatches in every frame. What has no prediction was turned down a frame before,
// over a wider range than the band's: it begins where the coarse match found it, and many around are measured alike.
#include "method.h"
#include "pixels.h"
#include "supporters.h"

// lint: PIXELS=1
// lint: PIXELS=16

// Innovations of a pixel: the sum of z - d in steps of 1 / EGOSGM_DRIFT_STEPS_PER_PX, and how many there are. Ten bits
// each count all, those off to the nearer side and those off to the farther one: a window has 200 pixels.
#define OFF_NEARER (1 << 10)
#define OFF_FARTHER (1 << 20)
#define COUNT_OF(counts, unit) ((counts) / (unit)&1023)

static inline void add_innovations(const Floats d, const Floats z, const float gate, Ints* sums, Ints* counts) {
  const Floats innovation = z - d, steps = EGOSGM_DRIFT_STEPS_PER_PX;
  const Ints agrees = is_valid(d) & is_valid(z) & (fabs(innovation) <= gate);
  const Ints nearer = innovation > (Floats)(EGOSGM_DRIFT_SIDE_PX),
             farther = innovation < (Floats)(-EGOSGM_DRIFT_SIDE_PX);
  *sums += INTS_OF_FLOATS(nearest(agrees ? innovation * steps : (Floats)(0.0f)));
  *counts += agrees ? (nearer ? (Ints)(1 + OFF_NEARER) : farther ? (Ints)(1 + OFF_FARTHER) : (Ints)(1)) : (Ints)(0);
}

// The innovations within the gate of blocks of EGOSGM_COARSE x EGOSGM_COARSE pixels, of every second row. A work-item a
// block, or a row of them; rows have EGOSGM_EVIDENCE_STRIDE places.
COMPILED_ONCE void sum_innovations_of_row(const WorkItem at, const ImageSize size, const float gate,
                                          global const float* predicted, global const float* measured, global int* sums,
                                          global int* counts) {
  const int width = size.width, blocks_high = coarse_size(size).height;
  const int y = at.y * EGOSGM_COARSE, end = min(y + EGOSGM_COARSE, size.height);
  const size_t row_of_blocks = ((size_t)at.view * blocks_high + at.y) * EGOSGM_EVIDENCE_STRIDE(width);
  const int step = PIXELS == 1 ? EGOSGM_COARSE : PIXELS;
  for (int start = at.x * step; start < width; start += at.items * step) {
    Ints sum = 0, count = 0;
    for (int v = y; v < end; v += EGOSGM_DRIFT_ROW_STEP) {
      const size_t row = ((size_t)at.view * size.height + v) * width;
      for (int x = start; x < start + step; x += PIXELS) {
        add_innovations(load_pixels(predicted + row, x, width), load_pixels(measured + row, x, width), gate, &sum,
                        &count);
      }
    }
    const size_t block = row_of_blocks + start / EGOSGM_COARSE;
#if PIXELS == 1
    sums[block] = sum;
    counts[block] = count;
#else
    vstore4(sums_of_fours(sum), 0, sums + block);
    vstore4(sums_of_fours(count), 0, counts + block);
#endif
  }
}

KERNEL void sum_innovations(const ImageSize size, const float gate, global const float* predicted,
                            global const float* measured, global int* sums, global int* counts) {
  sum_innovations_of_row(THIS_WORK_ITEM, size, gate, predicted, measured, sums, counts);
}

// The drift of blocks: the mean over a window of blocks, and 0 where few have both values, the mean is small, or less
// than three quarters are off to its side.
COMPILED_ONCE void drift_row(const WorkItem at, const ImageSize size, global const int* sums, global const int* counts,
                             global float* drifts) {
  const int radius = EGOSGM_DRIFT_RADIUS, stride = EGOSGM_EVIDENCE_STRIDE(size.width);
  const int width = coarse_size(size).width, height = coarse_size(size).height;
  const size_t view = (size_t)at.view * height * stride;
  FOR_PIXELS(x, width) {
    Ints sum = 0, count = 0;
    for (int v = max(at.y - radius, 0); v <= min(at.y + radius, height - 1); ++v) {
      const size_t row = view + (size_t)v * stride;
#pragma unroll
      for (int u = -radius; u <= radius; ++u) {
        sum += load_words(sums + row, x + u, width);
        count += load_words(counts + row, x + u, width);
      }
    }
    const Ints all = COUNT_OF(count, 1);
    const Ints off = sum > 0 ? COUNT_OF(count, OFF_NEARER) : COUNT_OF(count, OFF_FARTHER);
    const Floats steps = EGOSGM_DRIFT_STEPS_PER_PX;
    const Floats mean = FLOATS_OF_INTS(sum) / (steps * FLOATS_OF_INTS(max(all, (Ints)(1))));
    const Ints is_drift =
        (all >= EGOSGM_DRIFT_LEAST_COUNT) & (4 * off >= 3 * all) & (fabs(mean) > (Floats)(EGOSGM_LEAST_DRIFT_PX));
    store_pixels(is_drift ? mean : (Floats)(0.0f), drifts + view + (size_t)at.y * stride, x, width);
  }
}

KERNEL void find_drift(const ImageSize size, global const int* sums, global const int* counts, global float* drifts) {
  drift_row(THIS_WORK_ITEM, size, sums, counts, drifts);
}

// Values of the blocks of pixels x .. x + PIXELS - 1: each pixel gets that of its own block.
#if PIXELS == 1
#define OF_ITS_BLOCK(Values, row, x) ((row)[(x) / EGOSGM_COARSE])
#else
#define FOUR_BLOCKS(row, x) vload4(0, (row) + (x) / EGOSGM_COARSE)
#define OF_ITS_BLOCK(Values, row, x) \
  ((Values)(FOUR_BLOCKS(row, x).xxxx, FOUR_BLOCKS(row, x).yyyy, FOUR_BLOCKS(row, x).zzzz, FOUR_BLOCKS(row, x).wwww))
#endif

static inline Ints lesser_of(const Ints a, const Ints b) { return a < b ? a : b; }

// The evidence that moved to pixels of a row of a view. A hole that was filled has that of the lesser of the two beside
// it, or above and below it.
static inline Ints moved_evidence(const ImageSize size, const int step, const int x, const int y,
                                  global const uchar* row) {
  const Ints own = load_bytes(row, x, size.width);
  const Ints beside = lesser_of(load_bytes(row, x - 1, size.width), load_bytes(row, x + 1, size.width));
  if (y < step || y + step >= size.height) return own > 0 ? own : beside;
  const int stride = step * size.width;
  const Ints around = lesser_of(load_bytes(row - stride, x, size.width), load_bytes(row + stride, x, size.width));
  return own > 0 ? own : beside > 0 ? beside : around;
}

// The verdict of evidence on pixels: their sums, which ones live, and which measurements count.
typedef struct {
  Ints sums, lives, counts;
} Verdict;

// `now`: of this frame. A prediction is not asked where its match lies outside of the other image.
static inline Verdict judged(const KalmanParameters* q, const Ints before, const Ints now, const Floats found,
                             const Floats d, const Floats z, const int x, const int view) {
  const float gate = q->gate_px;
  const Ints has_prediction = is_valid(d);
  const Ints has_measurement = is_valid(z);
  const Ints stays = has_prediction & !(has_measurement & (fabs(z - d) > gate));
  const Ints is_found = is_valid(found) & (fabs(found - z) <= EGOSGM_EVIDENCE_COARSE_PX);
  const Ints is_contradicted = stays & is_valid(found) & (fabs(found - d) > EGOSGM_EVIDENCE_COARSE_PX);
  const Floats away = nearest(d);
  const Floats match = FLOATS_OF_INTS(x + LANE_INDICES) + (view == EGOSGM_LEFT ? -away : away);
  const Ints is_unseen = stays & ((match < (Floats)(0.0f)) | (match >= (Floats)(q->width)));
  const Ints kept = before * EGOSGM_EVIDENCE_KEPT >> 6;
  const Ints chosen = (Ints)(EGOSGM_EVIDENCE_OF_CHOICE);
  const Ints of_noise = (is_contradicted ? (Ints)(2) : (Ints)(1)) * EGOSGM_EVIDENCE_OF_NOISE;
  Ints sums = (stays ? kept : is_found ? (Ints)(0) : -chosen) + now - of_noise;
  sums = sums < EGOSGM_EVIDENCE_MOST ? sums : (Ints)(EGOSGM_EVIDENCE_MOST);
  sums = is_unseen ? before * EGOSGM_EVIDENCE_KEPT_UNSEEN >> 6 : sums;
  // A measurement without evidence contradicts nothing: the prediction stays, and was not asked.
  const Ints falls_back = has_prediction & !stays & (sums < 0);
  sums = falls_back ? kept - EGOSGM_EVIDENCE_OF_NOISE : sums;
  const Ints is_old = has_prediction & (Ints)(q->repeats ? -1 : 0);
  sums = is_old ? before : sums;
  Verdict verdict;
  const Ints may_begin = has_prediction | is_found | (Ints)(q->sees_again ? 0 : -1);
  verdict.lives = (has_prediction | has_measurement) & (sums >= 0) & (may_begin != 0);
  verdict.sums = verdict.lives ? sums : (Ints)(0);
  verdict.counts = (!stays & !falls_back) | (stays & (now >= EGOSGM_EVIDENCE_OF_NOISE));
  verdict.counts = is_old ? (Ints)(0) : verdict.counts;
  return verdict;
}

// Drops of a chunk's measurements those that neither a prediction nor a measurement around shares.
static inline void drop_lone(const ImageSize size, const int start, const int y, const KalmanParameters* q,
                             global const float* predicted_row, global const float* measured, Floats* chunk) {
  const float gate = q->gate_px;
  const Ints to_begin = q->sees_again ? EGOSGM_SUPPORTERS_COUNT : EGOSGM_SUPPORTERS_LEAST;
  FOR_BLOCKS(x, i, start, size.width) {
    const Floats d = load_pixels(predicted_row, x, size.width), z = chunk[i];
    const Ints is_shared = is_valid(d) & (fabs(z - d) <= gate);
    const Ints is_new = is_valid(z) & !is_shared;
    const Ints enough = is_valid(d) ? (Ints)(EGOSGM_SUPPORTERS_LEAST) : to_begin;
    const Ints is_lone = is_new & !have_supporters(size, x, y, is_new, enough, z, EGOSGM_LONE_PX, measured, 0);
    chunk[i] = is_lone ? INVALID : z;
  }
}

// `hidden`: not 0 where a surface nearer than the range hides what is behind it.
COMPILED_ONCE void update_row(const WorkItem at, const KalmanParameters q, global const uchar* hidden,
                              global const float* predicted, global const float* predicted_variance,
                              global const float* measured, global const float* measured_variance,
                              global const uchar* evidence_before, global const int* block_evidence,
                              global const float* found, global const float* drifts, global float* updated,
                              global float* updated_variance, global uchar* updated_doubtful, global uchar* evidence) {
  if (!has_row(at, q.row_step)) return;
  const ImageSize size = {q.width, q.height};
  const int width = q.width;
  const int y = at.y;
  const size_t view = (size_t)at.view * size.height * width;
  const size_t row = view + (size_t)y * width;
  const Ints is_plain = (Ints)(q.gate_px < INFINITY ? 0 : -1);
  const int blocks_high = coarse_size(size).height;
  const size_t row_of_blocks = ((size_t)at.view * blocks_high + y / EGOSGM_COARSE) * EGOSGM_EVIDENCE_STRIDE(size.width);

  FOR_CHUNKS(start, width) {
    Floats taken[CHUNK];
    FOR_BLOCKS(x, i, start, width) taken[i] = load_pixels(measured + row, x, width);
    if (q.has_evidence) drop_lone(size, start, y, &q, predicted + row, measured + view, taken);
    FOR_BLOCKS(x, i, start, width) {
      const Floats d = load_pixels(predicted + row, x, width);
      const Floats z = taken[i];
      const Floats drift = OF_ITS_BLOCK(Floats, drifts + row_of_blocks, x);
      const Floats p = load_pixels(predicted_variance + row, x, width) + drift * drift;
      const Floats r = load_pixels(measured_variance + row, x, width);
      Verdict verdict = {(Ints)(EGOSGM_EVIDENCE_MOST), (Ints)(-1), (Ints)(-1)};
      if (q.has_evidence) {
        verdict = judged(&q, moved_evidence(size, q.row_step, x, y, evidence_before + row),
                         OF_ITS_BLOCK(Ints, block_evidence + row_of_blocks, x),
                         OF_ITS_BLOCK(Floats, found + row_of_blocks, x), d, z, x, at.view);
      }
      const Ints has_prediction = is_valid(d);
      const Ints has_measurement =
          is_valid(z) & (is_plain | (load_bytes(hidden + row, x, width) == 0)) & (verdict.counts != 0);
      const Ints has_both = has_prediction & has_measurement;
      const Ints fuses = has_both & (fabs(z - d) <= q.gate_px);
      const Ints predicts = has_prediction & ((Ints)(q.keep_predicted) != 0);

      const Floats zero = 0.0f;
      const Floats sum = p + r;
      const Floats gain = sum > zero ? p / sum : zero;
      // No farther than to the measurement, so that all stays in the range.
      const Floats off = z - d, least_off = drift > 0.0f ? (off < drift ? off : drift) : (off > drift ? off : drift);
      const Floats moved = d + (least_off * drift > 0.0f ? least_off : (Floats)(0.0f));
      const Floats fused = moved + gain * (z - moved);
      const Floats fused_variance = (1.0f - gain) * p;

      const Floats wide = EGOSGM_DOUBTFUL_VARIANCE_PX2;
      const Floats contradicting = r < wide ? wide : r;
      Floats value = fuses ? fused : has_measurement ? z : predicts ? d : INVALID;
      value = verdict.lives ? value : INVALID;
      const Floats variance = fuses ? fused_variance : has_both ? contradicting : has_measurement ? r : p;

      const Floats least = q.min_variance_px2;
      store_pixels(value, updated + row, x, width);
      store_pixels(variance < least ? least : variance, updated_variance + row, x, width);
      const Ints contradicted = has_both & !fuses;
      store_bytes(contradicted & (Ints)(1), updated_doubtful + row, x, width);
      store_bytes(is_valid(value) ? verdict.sums : (Ints)(0), evidence + row, x, width);
    }
  }
}

KERNEL void update(const KalmanParameters q, global const uchar* hidden, global const float* predicted,
                   global const float* predicted_variance, global const float* measured,
                   global const float* measured_variance, global const uchar* evidence_before,
                   global const int* block_evidence, global const float* found, global const float* drifts,
                   global float* updated, global float* updated_variance, global uchar* updated_doubtful,
                   global uchar* evidence) {
  update_row(THIS_WORK_ITEM, q, hidden, predicted, predicted_variance, measured, measured_variance, evidence_before,
             block_evidence, found, drifts, updated, updated_variance, updated_doubtful, evidence);
}
