// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/image.h"

#include <algorithm>
#include <cstring>
#include <new>

#include "egosgm/error.h"
#include "vision/image_values.h"

namespace egosgm::vision {

void Image::create(Size wanted, ImageType of_type) {
  if (data && wanted == size() && of_type == type) return;
  constexpr std::align_val_t kAlignment{64};
  rows = wanted.height, cols = wanted.width, type = of_type;
  stride_bytes = static_cast<std::size_t>(cols) * type.pixel_bytes();
  const std::size_t bytes = std::max<std::size_t>(1, stride_bytes * static_cast<std::size_t>(rows));
  data = static_cast<std::uint8_t*>(::operator new(bytes, kAlignment));
  owner = {data, [](void* memory) { ::operator delete(memory, kAlignment); }};
}

Image Image::part(int x, int y, int width, int height) const {
  Image image = *this;
  image.data += static_cast<std::size_t>(y) * stride_bytes + static_cast<std::size_t>(x) * type.pixel_bytes();
  image.rows = height, image.cols = width;
  return image;
}

Image Image::clone() const {
  if (empty()) return *this;
  Image image(size(), type);
  copy_to(image);
  return image;
}

void Image::copy_to(Image to) const {
  for (int y = 0; y < rows; ++y) {
    std::memcpy(to.row(y), row(y), static_cast<std::size_t>(cols) * type.pixel_bytes());
  }
}

void Image::fill(float value) {
  visit_values(*this, [&](auto& stored) { stored = static_cast<std::remove_reference_t<decltype(stored)>>(value); });
}

void Image::fill(Color color) {
  for (int y = 0; y < rows; ++y) std::fill_n(row<Color>(y), cols, color);
}

ImageView image_view(const Image& grey) {
  if (grey.type != kU8 && grey.type != kU16) {
    throw InvalidArgument("image_view: the image must be grey, of uint8 or uint16");
  }
  return {.data = grey.data,
          .width = grey.cols,
          .height = grey.rows,
          .stride_bytes = static_cast<std::ptrdiff_t>(grey.stride_bytes),
          .type = grey.type == kU8 ? PixelType::kU8 : PixelType::kU16};
}

MapView<float> map_view(Image& map) {
  if (map.type != kF32) throw InvalidArgument("map_view: the map must be of float32");
  return {.data = map.row<float>(0),
          .width = map.cols,
          .height = map.rows,
          .stride_bytes = static_cast<std::ptrdiff_t>(map.stride_bytes)};
}

Image as_floats(const Image& stored) {
  Image floats(stored.size(), {ChannelType::kF32, stored.type.channels});
  for (int y = 0; y < stored.rows; ++y) {
    float* to = floats.row<float>(y);
    visit_row(stored, y, [&](const auto* from, int count) { std::copy_n(from, count, to); });
  }
  return floats;
}

Image as_bytes(const Image& stored, double scale, double shift) {
  Image bytes(stored.size(), {ChannelType::kU8, stored.type.channels});
  for (int y = 0; y < stored.rows; ++y) {
    std::uint8_t* to = bytes.row(y);
    visit_row(stored, y, [&](const auto* from, int count) {
      std::transform(from, from + count, to, [&](auto value) {
        return static_cast<std::uint8_t>(std::clamp(std::nearbyint(value * scale + shift), 0.0, 255.0));
      });
    });
  }
  return bytes;
}

}  // namespace egosgm::vision
