// SPDX-License-Identifier: Apache-2.0
#include "vision/pixel_motion.h"

#include "host/cpu_clones.h"
#include "vision/no_value.h"

namespace egosgm::vision {
namespace {

struct Pointers {
  float *u, *v, *d;
};

/// `m`: the rows of the matrix.
EGOSGM_CPU_CLONES
void move_row(const double* m, int x, int v, const float* d, int count, Pointers to) {
  const double of_v[4] = {m[1] * v + m[3], m[5] * v + m[7], m[9] * v + m[11], m[13] * v + m[15]};
  for (int i = 0; i < count; ++i) {
    const double u = x + i, disparity = d[i];
    const double w = m[12] * u + of_v[3] + m[14] * disparity;
    const double scale = w > kMinDepthRatio ? 1 / w : kNoValue;
    to.u[i] = static_cast<float>((m[0] * u + of_v[0] + m[2] * disparity) * scale);
    to.v[i] = static_cast<float>((m[4] * u + of_v[1] + m[6] * disparity) * scale);
    to.d[i] = static_cast<float>((m[8] * u + of_v[2] + m[10] * disparity) * scale);
  }
}

}  // namespace

void PixelMotion::of_row(int x, int v, const float* d, int count, MovedRow& there) const {
  for (std::vector<float>* each : {&there.u, &there.v, &there.d}) each->resize(static_cast<std::size_t>(count));
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = matrix_;
  move_row(rows.data(), x, v, d, count, {there.u.data(), there.v.data(), there.d.data()});
}

}  // namespace egosgm::vision
