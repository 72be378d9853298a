// SPDX-License-Identifier: Apache-2.0
// Kalman update of every pixel: K = p' / (p' + r), d = d' + K (z - d'), p = (1 - K) p'. Where the two
// contradict each other, by more than the gate or because the measurement escaped its band, the measurement is taken,
// with a variance for which the next frame searches wide.
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

kernel void update(const ImageSize size, const float gate, const int keep_predicted, const float min_variance,
                   global const float* predicted, global const float* predicted_variance, global const float* measured,
                   global const float* measured_variance, global float* updated, global float* updated_variance) {
  const int width = size.width;
  const size_t row = ((size_t)get_global_id(2) * size.height + get_global_id(1)) * size.width;

  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(predicted + row, x, width);
    const Floats z = load_pixels(measured + row, x, width);
    const Floats p = load_pixels(predicted_variance + row, x, width);
    const Floats r = load_pixels(measured_variance + row, x, width);
    const Ints has_prediction = d > INVALID;
    const Ints has_measurement = z > INVALID;
    const Floats escaped = EGOSGM_ESCAPED_VARIANCE_PX2;
    const Ints has_both = has_prediction & has_measurement;
    const Ints agrees = (fabs(z - d) <= gate) & (r < escaped);
    const Ints fuses = has_both & agrees;
    const Ints predicts = has_prediction & ((Ints)(keep_predicted) != 0);

    const Floats zero = 0.0f;
    const Floats least = min_variance;
    const Floats sum = p + r;
    const Floats gain = sum > zero ? p / sum : zero;
    const Floats fused = d + gain * (z - d);
    const Floats fused_variance = (1.0f - gain) * p;

    const Floats value = fuses ? fused : has_measurement ? z : predicts ? d : INVALID;
    const Floats contradicted = r < escaped ? escaped : r;
    const Floats variance = fuses ? fused_variance : has_both ? contradicted : has_measurement ? r : p;
    const Floats bounded = variance < least ? least : variance;
    store_pixels(value, updated + row, x, width);
    store_pixels((has_measurement | predicts) ? bounded : zero, updated_variance + row, x, width);
  }
}
