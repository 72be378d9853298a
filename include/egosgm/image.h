// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace egosgm {

/// The value of a pixel without a disparity, in every map that goes in or out. It lies below every disparity
/// that a pipeline can be built for, so `d > kInvalidDisparity` asks for validity.
inline constexpr float kInvalidDisparity = -32768.0f;

enum class PixelType { kU8, kU16 };

/// A grey image in the caller's memory, rows from top to bottom. Nothing is owned or copied.
/// REQUIRES: `data` points to `height` rows, `stride_bytes` apart (negative: bottom-up), of `width` pixels each.
struct ImageView {
  const void* data = nullptr;
  int width = 0;
  int height = 0;
  std::ptrdiff_t stride_bytes = 0;
  PixelType type = PixelType::kU8;
};

/// A map in the caller's memory for the library to fill. An empty view (`data == nullptr`) is not filled.
template <typename T>
struct MapView {
  T* data = nullptr;
  int width = 0;
  int height = 0;
  std::ptrdiff_t stride_bytes = 0;
};

}  // namespace egosgm
