// SPDX-License-Identifier: Apache-2.0
#include "host/odometry/subpixel.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "host/cpu_clones.h"

namespace egosgm::odometry {
namespace {

constexpr int kReach = 4;  // farthest move [px]
constexpr int kIterations = 10;
constexpr float kSettled_px = 0.01f;
constexpr float kMinEigenvalue = 400.0f;  // of the normal equations [grey value^2 / px^2]
constexpr int kRegion = kPatchRows + 2 * kReach + 1;
constexpr int kRegionStride = 24;
constexpr int kSource = kPatchRows + 2;

// `image` at integer offsets from (x0, y0), the border repeated. Inlined into versions for AVX2, as is `sample`.
template <int kRows, int kColumns>
inline void load(const GreyImage& image, int x0, int y0, float* __restrict out) {
  const bool inside = x0 >= 0 && y0 >= 0 && x0 + kColumns <= image.width && y0 + kRows <= image.height;
  for (int i = 0; i < kRows; ++i) {
    const std::uint8_t* row = image.row(std::clamp(y0 + i, 0, image.height - 1));
    float* to = out + i * kColumns;
    if (inside) {
      for (int j = 0; j < kColumns; ++j) to[j] = row[x0 + j];
    } else {
      for (int j = 0; j < kColumns; ++j) to[j] = row[std::clamp(x0 + j, 0, image.width - 1)];
    }
  }
}

// The pixel before a place among `count`, the border repeated, and how far behind it that lies.
struct Between {
  int first;
  float share;
};

Between between(float at, int count) {
  at = std::clamp(at, 0.0f, static_cast<float>(count - 1));
  const int first = std::min(static_cast<int>(at), count - 2);
  return {first, at - first};
}

inline float sum_inner(const float row[kSource], float sum) {
  for (int j = 1; j <= kPatchRows; ++j) sum += row[j];
  return sum;
}

// The patch with one pixel more on each side. Returns the sum of its inner values.
inline float sample(const GreyImage& image, float x, float y, float scale, float source[kSource][kSource]) {
  const float step = 1 / scale;
  float sum = 0;
  if (scale == 1.0f && x == std::floor(x) && y == std::floor(y)) {
    const int reach = kPatchRadius + 1;
    load<kSource, kSource>(image, static_cast<int>(x) - reach, static_cast<int>(y) - reach, source[0]);
    for (int i = 1; i <= kPatchRows; ++i) sum = sum_inner(source[i], sum);
    return sum;
  }
  int columns[kSource];
  float shares[kSource];
  for (int j = 0; j < kSource; ++j) {
    const auto [first, share] = between(x + (j - kPatchRadius - 1) * step, image.width);
    columns[j] = first;
    shares[j] = share;
  }
  const auto sample_row = [&](int at, float* __restrict to) {
    const std::uint8_t* row = image.row(at);
    std::uint8_t before[kSource], behind[kSource];
    for (int j = 0; j < kSource; ++j) {
      before[j] = row[columns[j]];
      behind[j] = row[columns[j] + 1];
    }
    for (int j = 0; j < kSource; ++j) to[j] = (1 - shares[j]) * before[j] + shares[j] * behind[j];
  };
  float upper[kSource] = {}, lower[kSource] = {};
  int row = -1;  // of the image, in `upper`; the next one is in `lower`
  for (int i = 0; i < kSource; ++i) {
    const auto [first, share] = between(y + (i - kPatchRadius - 1) * step, image.height);
    if (i == 0 || first > row + 1) {
      sample_row(first, upper);
      sample_row(first + 1, lower);
    } else if (first == row + 1) {
      std::copy_n(lower, kSource, upper);
      sample_row(first + 1, lower);
    }
    row = first;
    for (int j = 0; j < kSource; ++j) source[i][j] = (1 - share) * upper[j] + share * lower[j];
    if (i >= 1 && i <= kPatchRows) sum = sum_inner(source[i], sum);
  }
  return sum;
}

struct Sums {
  float x, y;
};

using Columns = Eigen::Array<float, kPatchColumns, 1>;

Eigen::Map<const Columns> columns_at(const float* values) { return Eigen::Map<const Columns>(values); }

// Products of the gradients with the image shifted to (column, row) of the region.
Sums correlate(const Patch& patch, const float* region, float column, float row) {
  const int j0 = static_cast<int>(column), i0 = static_cast<int>(row);
  const float a = column - j0, b = row - i0;
  const float w00 = (1 - a) * (1 - b), w01 = a * (1 - b), w10 = (1 - a) * b, w11 = a * b;
  Columns sum_x = Columns::Zero(), sum_y = Columns::Zero();
  for (int i = 0; i < kPatchRows; ++i) {
    const float* upper = region + (i0 + i) * kRegionStride + j0;
    const float* lower = upper + kRegionStride;
    const Columns values =
        w00 * columns_at(upper) + w01 * columns_at(upper + 1) + w10 * columns_at(lower) + w11 * columns_at(lower + 1);
    sum_x += columns_at(patch.gradient_x[i]) * values;
    sum_y += columns_at(patch.gradient_y[i]) * values;
  }
  Sums sums{0, 0};
  for (int j = 0; j < kPatchColumns; ++j) {
    sums.x += sum_x[j];
    sums.y += sum_y[j];
  }
  return sums;
}

// Root of the summed squared deviation of the region's values, whole pixels from (column, row).
float deviation(const float* region, float column, float row) {
  const auto nearest = [](float position) { return static_cast<int>(std::floor(position + 0.5f)); };
  const float* first = region + nearest(row) * kRegionStride + nearest(column);
  Columns sum = Columns::Zero(), sum2 = Columns::Zero();
  for (int i = 0; i < kPatchRows; ++i) {
    const auto values = columns_at(first + i * kRegionStride);
    sum += values;
    sum2 += values * values;
  }
  float total = 0, total2 = 0;
  for (int j = 0; j < kPatchRows; ++j) {
    total += sum[j];
    total2 += sum2[j];
  }
  return std::sqrt(std::max(0.0f, total2 - total * total / (kPatchRows * kPatchRows)));
}

float correlation(const Patch& patch, const float* region, float column, float row) {
  const int j0 = static_cast<int>(column), i0 = static_cast<int>(row);
  const float a = column - j0, b = row - i0;
  const auto row_at = [&](int i) -> Columns {
    const float* values = region + (i0 + i) * kRegionStride + j0;
    return (1 - a) * columns_at(values) + a * columns_at(values + 1);
  };
  float sum = 0, sum2 = 0, product = 0;
  Columns upper = row_at(0);
  for (int i = 0; i < kPatchRows; ++i) {
    const Columns lower = row_at(i + 1), values = (1 - b) * upper + b * lower;
    for (int j = 0; j < kPatchRows; ++j) {
      sum += values[j];
      sum2 += values[j] * values[j];
      product += values[j] * patch.values[i][j];
    }
    upper = lower;
  }
  const float variance = sum2 - sum * sum / (kPatchRows * kPatchRows);
  return variance > 1.0f ? product / (std::sqrt(variance) * patch.deviation) : 0.0f;
}

}  // namespace

// Sums are in the order of rows and columns, so each waits for its last addition: as many as can be go side by side.
EGOSGM_CPU_CLONES
bool make_patch(const GreyImage& image, float x, float y, float scale, Patch& patch) {
  constexpr int kCount = kPatchRows * kPatchRows;
  float source[kSource][kSource];
  const float mean = sample(image, x, y, scale, source) / kCount;
  float norm2 = 0, mean_x = 0, mean_y = 0, along_x = 0, along_y = 0;
  for (int i = 0; i < kPatchRows; ++i) {
    for (int j = 0; j < kPatchRows; ++j) {
      patch.values[i][j] = source[i + 1][j + 1] - mean;
      patch.gradient_x[i][j] = 0.5f * (source[i + 1][j + 2] - source[i + 1][j]);
      patch.gradient_y[i][j] = 0.5f * (source[i + 2][j + 1] - source[i][j + 1]);
    }
    for (int j = 0; j < kPatchRows; ++j) {
      norm2 += patch.values[i][j] * patch.values[i][j];
      mean_x += patch.gradient_x[i][j];
      mean_y += patch.gradient_y[i][j];
      along_x += patch.gradient_x[i][j] * patch.values[i][j];
      along_y += patch.gradient_y[i][j] * patch.values[i][j];
    }
  }
  if (norm2 < kMinEigenvalue) return false;
  patch.deviation = std::sqrt(norm2);
  mean_x /= kCount;
  mean_y /= kCount;
  along_x /= norm2;
  along_y /= norm2;
  float xx = 0, xy = 0, yy = 0;
  for (int i = 0; i < kPatchRows; ++i) {
    for (int j = 0; j < kPatchRows; ++j) {
      patch.gradient_x[i][j] -= mean_x + along_x * patch.values[i][j];
      patch.gradient_y[i][j] -= mean_y + along_y * patch.values[i][j];
    }
    patch.gradient_x[i][kPatchRows] = patch.gradient_y[i][kPatchRows] = 0;
    for (int j = 0; j < kPatchRows; ++j) {
      xx += patch.gradient_x[i][j] * patch.gradient_x[i][j];
      xy += patch.gradient_x[i][j] * patch.gradient_y[i][j];
      yy += patch.gradient_y[i][j] * patch.gradient_y[i][j];
    }
  }
  const float smaller = 0.5f * (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4 * xy * xy));
  if (smaller < kMinEigenvalue) return false;
  const float determinant = xx * yy - xy * xy;
  patch.inverse_xx = yy / determinant;
  patch.inverse_xy = -xy / determinant;
  patch.inverse_yy = xx / determinant;
  return true;
}

EGOSGM_CPU_CLONES
bool align_patch(const Patch& patch, const GreyImage& image, float min_correlation, float& x, float& y) {
  const int x0 = static_cast<int>(std::floor(x + 0.5f)) - kPatchRadius - kReach;
  const int y0 = static_cast<int>(std::floor(y + 0.5f)) - kPatchRadius - kReach;
  float region[kRegion * kRegionStride];
  load<kRegion, kRegionStride>(image, x0, y0, region);
  float column = x - kPatchRadius - x0, row = y - kPatchRadius - y0;
  // With more contrast than in the patch, a step would overshoot by as much.
  const float contrast = std::max(0.1f, deviation(region, column, row) / patch.deviation);
  bool settled = false;
  for (int k = 0; k < kIterations && !settled; ++k) {
    const Sums sums = correlate(patch, region, column, row);
    const float dx = (patch.inverse_xx * sums.x + patch.inverse_xy * sums.y) / contrast;
    const float dy = (patch.inverse_xy * sums.x + patch.inverse_yy * sums.y) / contrast;
    column -= dx;
    row -= dy;
    if (!(column >= 0 && row >= 0 && column < 2 * kReach && row < 2 * kReach)) return false;
    settled = dx * dx + dy * dy < kSettled_px * kSettled_px;
  }
  if (!settled || correlation(patch, region, column, row) < min_correlation) return false;
  x = column + kPatchRadius + x0;
  y = row + kPatchRadius + y0;
  return true;
}

}  // namespace egosgm::odometry
