// SPDX-License-Identifier: Apache-2.0
// Kalman update of every pixel: K = p' / (p' + r), d = d' + K (z - d'), p = (1 - K) p'. Beyond the gate the measurement
// is taken.
#include "shared.h"

kernel void update(const ImageSize size, const float gate, const int keep_predicted, const float min_variance,
                   global const float* predicted, global const float* predicted_variance, global const float* measured,
                   global const float* measured_variance, global float* updated, global float* updated_variance) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t i = ((size_t)get_global_id(2) * size.height + get_global_id(1)) * size.width + x;

  const float d = predicted[i];
  const float z = measured[i];
  const float p = predicted_variance[i];
  const float r = measured_variance[i];
  const bool has_prediction = d > EGOSGM_INVALID_DISPARITY;
  const bool has_measurement = z > EGOSGM_INVALID_DISPARITY;
  const bool fuses = has_prediction && has_measurement && fabs(z - d) <= gate;
  const bool predicts = has_prediction && !has_measurement && keep_predicted;

  const float sum = p + r;
  const float gain = sum > 0.0f ? p / sum : 0.0f;
  const float fused = d + gain * (z - d);
  const float fused_variance = (1.0f - gain) * p;

  const float value = fuses ? fused : has_measurement ? z : predicts ? d : EGOSGM_INVALID_DISPARITY;
  const float variance = fuses ? fused_variance : has_measurement ? r : p;
  updated[i] = value;
  updated_variance[i] = !(has_measurement || predicts) ? 0.0f : variance < min_variance ? min_variance : variance;
}
