// SPDX-License-Identifier: Apache-2.0
// Kalman update of every pixel: K = p' / (p' + r), d = d' + K (z - d'), p = (1 - K) p'. Where the two contradict each
// other, by more than the gate or because the measurement is doubtful, or where they differ to the same side as most
// pixels around, as on what moves by itself, the measurement is taken. It then is doubtful, and its variance is so
// large that the next frame searches wide. What is hidden by a surface nearer than the range (ForwardWarp) has no
// disparity: whatever is measured there is a mismatch. Without a gate nothing contradicts anything.
#include "method.h"
#include "pixels.h"

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

// `hidden`: not 0 where a surface nearer than the range hides what is behind it. ask_neighbours: whether a measurement
// is taken that differs to the same side as those of EGOSGM_MOVING_COUNT around do. has_gate: else all that is
// predicted and measured is averaged, and nothing is hidden or doubtful.
COMPILED_ONCE void update_row(const WorkItem at, const ImageSize size, const int has_gate, const float gate,
                              const int keep_predicted, const int ask_neighbours, const float min_variance,
                              global const uchar* hidden, global const float* predicted,
                              global const float* predicted_variance, global const float* measured,
                              global const float* measured_variance, global const uchar* measured_doubtful,
                              global float* updated, global float* updated_variance, global uchar* updated_doubtful) {
  const int width = size.width;
  const int y = at.y;
  const size_t view = (size_t)at.view * size.height * width;
  const size_t row = view + (size_t)y * width;
  const Ints is_plain = (Ints)(has_gate ? 0 : -1);

  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(predicted + row, x, width);
    const Floats z = load_pixels(measured + row, x, width);
    const Floats p = load_pixels(predicted_variance + row, x, width);
    const Floats r = load_pixels(measured_variance + row, x, width);
    const Ints has_prediction = d > INVALID;
    const Ints has_measurement = (z > INVALID) & (is_plain | (load_bytes(hidden + row, x, width) == 0));
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
    Floats variance = fuses ? fused_variance : has_both ? contradicting : has_measurement ? r : p;

    const Floats most = EGOSGM_DIFFERENCE_PX;
    const Floats side = innovation > zero ? (Floats)(1.0f) : (Floats)(-1.0f);
    Ints moves = fuses & (fabs(innovation) > most) & (Ints)(ask_neighbours ? -1 : 0) &
                 are_beside_off_to(side, x, width, predicted + row, measured + row);
    if (any_of(moves)) {
      moves = move_together(size, x, y, side, moves, predicted + view, measured + view);
      value = moves ? z : value;
      variance = moves ? wide : variance;
    }
    const Floats least = min_variance;
    const Floats bounded = variance < least ? least : variance;
    store_pixels(value, updated + row, x, width);
    store_pixels(value > INVALID ? bounded : zero, updated_variance + row, x, width);
    const Ints contradicted = (has_both & !fuses) | (moves != 0) | (has_measurement & !has_prediction & is_doubtful);
    store_bytes(contradicted & (Ints)(1), updated_doubtful + row, x, width);
  }
}

KERNEL void update(const ImageSize size, const int has_gate, const float gate, const int keep_predicted,
                   const int ask_neighbours, const float min_variance, global const uchar* hidden,
                   global const float* predicted, global const float* predicted_variance, global const float* measured,
                   global const float* measured_variance, global const uchar* measured_doubtful, global float* updated,
                   global float* updated_variance, global uchar* updated_doubtful) {
  update_row(THIS_WORK_ITEM, size, has_gate, gate, keep_predicted, ask_neighbours, min_variance, hidden, predicted,
             predicted_variance, measured, measured_variance, measured_doubtful, updated, updated_variance,
             updated_doubtful);
}
