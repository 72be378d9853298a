// SPDX-License-Identifier: Apache-2.0
// Kalman update of every pixel: K = p' / (p' + r), d = d' + K (z - d'), p = (1 - K) p'. Where the two contradict each
// other, by more than the gate or because the measurement is doubtful, or where they differ to the same side as most
// pixels around, as on what moves by itself, the measurement is taken. It then is doubtful, and its variance is so
// large that the next frame searches wide. What is hidden by a surface nearer than the range (ForwardWarp) has no
// disparity: whatever is measured there is a mismatch. Without a gate nothing contradicts anything.
//
// Evidence (evidence.cl) decides what lives: a pixel's evidence is a sum over frames that moves with the map. Below 0
// the pixel dies, whatever was predicted or measured. A measurement without evidence moves no prediction, and lowers no
// variance.
#include "method.h"
#include "pixels.h"
#include "supporters.h"

// lint: PIXELS=1
// lint: PIXELS=16

static Ints is_off_to(const Floats side, const Floats d, const Floats z) {
  return (d > INVALID) & (z > INVALID) & ((z - d) * side > (Floats)(EGOSGM_DIFFERENCE_PX));
}

// Whether the two pixels beside are off to a side as well, which few are: asked without a branch, as what moves by a
// pixel alone is found in every third block.
static Ints are_beside_off_to(const Floats side, const int x, const int width, global const float* predictions,
                              global const float* measurements) {
  const int left = x - EGOSGM_SUPPORT_STEP, right = x + EGOSGM_SUPPORT_STEP;
  return is_off_to(side, load_pixels(predictions, left, width), load_pixels(measurements, left, width)) &
         is_off_to(side, load_pixels(predictions, right, width), load_pixels(measurements, right, width));
}

// Which of `moves` do so together with EGOSGM_MOVING_COUNT of the 25 around. No row is asked once too many are not off:
// that decides nearly everywhere.
static Ints move_together(const ImageSize size, const int x, const int y, const Floats side, Ints moves,
                          global const float* predictions, global const float* measurements) {
  const int step = EGOSGM_SUPPORT_STEP;
  const Floats needed = EGOSGM_MOVING_COUNT;
  Floats off = 0.0f;
  for (int v = y - EGOSGM_SUPPORT_RADIUS; v <= y + EGOSGM_SUPPORT_RADIUS && any_of(moves); v += step) {
    const int is_inside = v >= 0 && v < size.height;
    const size_t row = is_inside ? (size_t)v * size.width : 0;
    for (int u = x - EGOSGM_SUPPORT_RADIUS; is_inside && u <= x + EGOSGM_SUPPORT_RADIUS; u += step) {
      off += one_where(is_off_to(side, load_pixels(predictions + row, u, size.width),
                                 load_pixels(measurements + row, u, size.width)));
    }
    const Floats to_come = (y + EGOSGM_SUPPORT_RADIUS - v) / step * 5;
    moves &= off + to_come >= needed;
  }
  return moves;
}

// What is known of the blocks of pixels x .. x + PIXELS - 1, each pixel what its own is.
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
static inline Ints moved_evidence(const ImageSize size, const int x, const int y, global const uchar* row) {
  const Ints own = load_bytes(row, x, size.width);
  const Ints beside = lesser_of(load_bytes(row, x - 1, size.width), load_bytes(row, x + 1, size.width));
  if (y == 0 || y + 1 >= size.height) return own > 0 ? own : beside;
  const Ints around =
      lesser_of(load_bytes(row - size.width, x, size.width), load_bytes(row + size.width, x, size.width));
  return own > 0 ? own : beside > 0 ? beside : around;
}

// What evidence says of pixels: their sums, which ones live, and which measurements count.
typedef struct {
  Ints sums, lives, counts;
} Verdict;

// `now`: of this frame. repeats: whether its images are those of the frame before, which make nobody surer. A
// prediction is not asked where its match lies outside of the other image.
static inline Verdict judged(const int repeats, const Ints before, const Ints now, const Floats found, const Floats d,
                             const Floats z, const float gate, const int x, const int width, const int view) {
  const Ints has_prediction = d > INVALID;
  const Ints has_measurement = z > INVALID;
  const Ints stays = has_prediction & !(has_measurement & (fabs(z - d) > gate));
  const Ints is_found = (found > INVALID) & (fabs(found - z) <= EGOSGM_EVIDENCE_COARSE_PX);
  const Floats away = nearest(d);
  const Floats match = FLOATS_OF_INTS(x + LANE_INDICES) + (view == EGOSGM_LEFT ? -away : away);
  const Ints is_unseen = stays & ((match < (Floats)(0.0f)) | (match >= (Floats)(width)));
  const Ints kept = before * EGOSGM_EVIDENCE_KEPT >> 6;
  const Ints chosen = (Ints)(EGOSGM_EVIDENCE_OF_CHOICE);
  Ints sums = (stays ? kept : is_found ? (Ints)(0) : -chosen) + now - EGOSGM_EVIDENCE_OF_NOISE;
  sums = sums < EGOSGM_EVIDENCE_MOST ? sums : (Ints)(EGOSGM_EVIDENCE_MOST);
  sums = is_unseen ? before * EGOSGM_EVIDENCE_KEPT_UNSEEN >> 6 : sums;
  // A measurement without evidence contradicts nothing: the prediction stays, and was not asked.
  const Ints falls_back = has_prediction & !stays & (sums < 0);
  sums = falls_back ? kept - EGOSGM_EVIDENCE_OF_NOISE : sums;
  const Ints is_old = (Ints)(repeats ? -1 : 0);
  sums = is_old ? (has_prediction ? before : (Ints)(-1)) : sums;
  Verdict verdict;
  verdict.lives = (has_prediction | has_measurement) & (sums >= 0);
  verdict.sums = verdict.lives ? sums : (Ints)(0);
  verdict.counts = (!stays & !falls_back) | (stays & (now >= EGOSGM_EVIDENCE_OF_NOISE));
  verdict.counts = (has_prediction & is_old) ? (Ints)(0) : verdict.counts;
  return verdict;
}

// Drops of a chunk's measurements those that neither a prediction nor a measurement around shares.
static inline void drop_lone(const ImageSize size, const int start, const int y, const float gate,
                             global const float* predicted_row, global const float* measured, Floats* chunk) {
  FOR_BLOCKS(x, i, start, size.width) {
    const Floats d = load_pixels(predicted_row, x, size.width), z = chunk[i];
    const Ints is_shared = (d > INVALID) & (fabs(z - d) <= gate);
    const Ints is_new = (z > INVALID) & !is_shared;
    const Ints is_lone =
        is_new & !have_supporters(size, x, y, is_new, EGOSGM_SUPPORTERS_LEAST, z, EGOSGM_LONE_PX, measured, 0);
    chunk[i] = is_lone ? INVALID : z;
  }
}

// `hidden`: not 0 where a surface nearer than the range hides what is behind it. ask_neighbours: whether a measurement
// is taken that differs to the same side as those of EGOSGM_MOVING_COUNT around do. has_gate: else all that is
// predicted and measured is averaged, and nothing is hidden or doubtful. has_evidence: else `evidence_before`,
// `block_evidence` and `found` are not read, and all that lives is confirmed.
COMPILED_ONCE void update_row(const WorkItem at, const ImageSize size, const int has_gate, const float gate,
                              const int keep_predicted, const int ask_neighbours, const float min_variance,
                              global const uchar* hidden, global const float* predicted,
                              global const float* predicted_variance, global const float* measured,
                              global const float* measured_variance, global const uchar* measured_doubtful,
                              const int has_evidence, const int repeats, global const uchar* evidence_before,
                              global const int* block_evidence, global const float* found, global float* updated,
                              global float* updated_variance, global uchar* updated_doubtful, global uchar* evidence) {
  const int width = size.width;
  const int y = at.y;
  const size_t view = (size_t)at.view * size.height * width;
  const size_t row = view + (size_t)y * width;
  const Ints is_plain = (Ints)(has_gate ? 0 : -1);
  const int blocks_high = (size.height + EGOSGM_COARSE - 1) / EGOSGM_COARSE;
  const size_t row_of_blocks = ((size_t)at.view * blocks_high + y / EGOSGM_COARSE) * EGOSGM_EVIDENCE_STRIDE(size.width);

  FOR_CHUNKS(start, width) {
    Floats taken[CHUNK];
    FOR_BLOCKS(x, i, start, width) taken[i] = load_pixels(measured + row, x, width);
    if (has_evidence) drop_lone(size, start, y, gate, predicted + row, measured + view, taken);
    FOR_BLOCKS(x, i, start, width) {
      const Floats d = load_pixels(predicted + row, x, width);
      const Floats z = taken[i];
      const Floats p = load_pixels(predicted_variance + row, x, width);
      const Floats r = load_pixels(measured_variance + row, x, width);
      Verdict verdict = {(Ints)(EGOSGM_EVIDENCE_MOST), (Ints)(-1), (Ints)(-1)};
      if (has_evidence) {
        verdict = judged(repeats, moved_evidence(size, x, y, evidence_before + row),
                         OF_ITS_BLOCK(Ints, block_evidence + row_of_blocks, x),
                         OF_ITS_BLOCK(Floats, found + row_of_blocks, x), d, z, gate, x, width, at.view);
      }
      const Ints has_prediction = d > INVALID;
      const Ints has_measurement =
          (z > INVALID) & (is_plain | (load_bytes(hidden + row, x, width) == 0)) & (verdict.counts != 0);
      const Ints is_doubtful = load_bytes(measured_doubtful + row, x, width) != 0;
      const Ints has_both = has_prediction & has_measurement;
      const Ints fuses = has_both & (is_plain | ((fabs(z - d) <= gate) & !is_doubtful));
      const Ints predicts = has_prediction & ((Ints)(keep_predicted) != 0);

      const Floats zero = 0.0f;
      const Floats innovation = z - d;
      const Floats sum = p + r;
      const Floats gain = sum > zero ? p / sum : zero;
      const Floats fused = d + gain * innovation;
      const Floats fused_variance = (1.0f - gain) * p;

      const Floats wide = EGOSGM_DOUBTFUL_VARIANCE_PX2;
      const Floats contradicting = r < wide ? wide : r;
      Floats value = fuses ? fused : has_measurement ? z : predicts ? d : INVALID;
      value = verdict.lives ? value : INVALID;
      Floats variance = fuses ? fused_variance : has_both ? contradicting : has_measurement ? r : p;

      const Floats most = EGOSGM_DIFFERENCE_PX;
      const Floats side = innovation > zero ? (Floats)(1.0f) : (Floats)(-1.0f);
      Ints moves = fuses & (fabs(innovation) > most) & (Ints)(ask_neighbours ? -1 : 0) &
                   are_beside_off_to(side, x, width, predicted + row, measured + row);
      if (any_of(moves)) {
        moves = move_together(size, x, y, side, moves, predicted + view, measured + view);
        value = (moves & (value > INVALID)) ? z : value;
        variance = moves ? wide : variance;
      }
      const Floats least = min_variance;
      store_pixels(value, updated + row, x, width);
      store_pixels(variance < least ? least : variance, updated_variance + row, x, width);
      const Ints contradicted = (has_both & !fuses) | (moves != 0) | (has_measurement & !has_prediction & is_doubtful);
      store_bytes(contradicted & (Ints)(1), updated_doubtful + row, x, width);
      store_bytes(value > INVALID ? verdict.sums : (Ints)(0), evidence + row, x, width);
    }
  }
}

KERNEL void update(const ImageSize size, const int has_gate, const float gate, const int keep_predicted,
                   const int ask_neighbours, const float min_variance, global const uchar* hidden,
                   global const float* predicted, global const float* predicted_variance, global const float* measured,
                   global const float* measured_variance, global const uchar* measured_doubtful, const int has_evidence,
                   const int repeats, global const uchar* evidence_before, global const int* block_evidence,
                   global const float* found, global float* updated, global float* updated_variance,
                   global uchar* updated_doubtful, global uchar* evidence) {
  update_row(THIS_WORK_ITEM, size, has_gate, gate, keep_predicted, ask_neighbours, min_variance, hidden, predicted,
             predicted_variance, measured, measured_variance, measured_doubtful, has_evidence, repeats, evidence_before,
             block_evidence, found, updated, updated_variance, updated_doubtful, evidence);
}
