// SPDX-License-Identifier: Apache-2.0
// Images and maps in memory of their own. With OpenCV, opencv.h converts them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "egosgm/export.h"
#include "egosgm/image.h"

namespace egosgm::vision {

struct Size {
  int width = 0, height = 0;

  bool empty() const { return width <= 0 || height <= 0; }
  int area() const { return width * height; }
  friend bool operator==(Size a, Size b) { return a.width == b.width && a.height == b.height; }
  friend bool operator!=(Size a, Size b) { return !(a == b); }
};

enum class ChannelType { kU8, kU16, kF32 };

/// How an image stores a pixel: channels of one type, side by side.
struct ImageType {
  ChannelType channel = ChannelType::kU8;
  int channels = 1;

  constexpr std::size_t channel_bytes() const {
    return channel == ChannelType::kU8 ? 1 : channel == ChannelType::kU16 ? 2 : 4;
  }
  constexpr std::size_t pixel_bytes() const { return channel_bytes() * static_cast<std::size_t>(channels); }
  friend constexpr bool operator==(ImageType a, ImageType b) {
    return a.channel == b.channel && a.channels == b.channels;
  }
  friend constexpr bool operator!=(ImageType a, ImageType b) { return !(a == b); }
};

inline constexpr ImageType kU8{ChannelType::kU8}, kU16{ChannelType::kU16}, kF32{ChannelType::kF32},
    kBgr8{ChannelType::kU8, 3}, kBgr16{ChannelType::kU16, 3}, kFlow{ChannelType::kF32, 2};

/// A pixel of kBgr8: blue, green, red.
using Color = std::array<std::uint8_t, 3>;

/// An image, a part of one, or a view of somebody else's memory. Copies share the memory, as std::shared_ptr does.
struct EGOSGM_EXPORT Image {
  int rows = 0, cols = 0;
  ImageType type{};
  std::size_t stride_bytes = 0;  // from one row to the next
  std::uint8_t* data = nullptr;
  std::shared_ptr<void> owner{};  // keeps the memory; null: it is somebody else's, who must keep it

  Image() = default;
  /// Pixels without values yet.
  Image(Size size, ImageType of_type) { create(size, of_type); }
  Image(int height, int width, ImageType of_type) { create({width, height}, of_type); }
  /// All channels of all pixels have this value.
  Image(Size size, ImageType of_type, float value) : Image(size, of_type) { fill(value); }
  Image(int height, int width, ImageType of_type, float value) : Image(height, width, of_type) { fill(value); }
  /// A view of memory that must outlive it.
  Image(int height, int width, ImageType of_type, void* memory, std::size_t row_bytes)
      : rows(height), cols(width), type(of_type), stride_bytes(row_bytes), data(static_cast<std::uint8_t*>(memory)) {}

  /// Gives it memory for this size and type, without values yet; what has both already keeps its own.
  void create(Size wanted, ImageType of_type);

  Size size() const { return {cols, rows}; }
  bool empty() const { return rows == 0 || cols == 0; }
  std::size_t pixels() const { return static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols); }

  template <typename T = std::uint8_t>
  T* row(int y) {
    return reinterpret_cast<T*>(data + static_cast<std::size_t>(y) * stride_bytes);
  }
  template <typename T = std::uint8_t>
  const T* row(int y) const {
    return reinterpret_cast<const T*>(data + static_cast<std::size_t>(y) * stride_bytes);
  }
  template <typename T>
  T& at(int y, int x) {
    return row<T>(y)[x];
  }
  template <typename T>
  const T& at(int y, int x) const {
    return row<T>(y)[x];
  }

  /// A part that shares its memory. REQUIRES: it lies inside.
  Image part(int x, int y, int width, int height) const;
  /// The same pixels in memory of their own, without gaps between rows.
  Image clone() const;
  /// REQUIRES: `to` has the same size and type.
  void copy_to(Image to) const;
  /// Sets every channel of every pixel. REQUIRES: the type has the value.
  void fill(float value);
  /// REQUIRES: kBgr8.
  void fill(Color color);
};

/// The core's view of an image, which must outlive it. Throws InvalidArgument unless kU8 or kU16.
EGOSGM_EXPORT ImageView image_view(const Image& grey);

/// The core's view of a kF32 map that it is to fill. Throws InvalidArgument for another type.
EGOSGM_EXPORT MapView<float> map_view(Image& map);

}  // namespace egosgm::vision
