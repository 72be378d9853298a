// SPDX-License-Identifier: Apache-2.0
#include "host/frame/check_frame.h"

#include <cstdint>
#include <cstdlib>
#include <string>

#include "egosgm/error.h"
#include "host/frame_outputs.h"

namespace egosgm {
namespace {

constexpr int kMaxSide = 16384;

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

void check_image(const char* name, const ImageView& image, shared::ImageSize size) {
  const std::string view = std::string(name) + " image: ";
  if (!image.data) throw InvalidArgument(view + "no data: give a pointer to its pixels");
  if (image.width != size.width || image.height != size.height) {
    throw InvalidArgument(view + size_text(image.width, image.height) + ", the pipeline was built for " +
                          size_text(size.width, size.height) + ": build another pipeline for another size");
  }
  check_rows(view, image);
}

template <typename T>
void check_map(const char* name, const MapView<T>& map, shared::ImageSize size) {
  if (!map.data) return;
  if (map.width != size.width || map.height != size.height) {
    throw InvalidArgument(std::string("output ") + name + ": " + size_text(map.width, map.height) +
                          ", the pipeline was built for " + size_text(size.width, size.height) +
                          ": give a map of that size");
  }
  const std::int64_t row = static_cast<std::int64_t>(map.width) * sizeof(T);
  if (map.height > 1 && std::abs(static_cast<std::int64_t>(map.stride_bytes)) < row) {
    throw InvalidArgument(std::string("output ") + name + ": a stride of " + std::to_string(map.stride_bytes) +
                          " bytes is shorter than a row of " + std::to_string(row));
  }
}

}  // namespace

void check_size(int width, int height) {
  if (width >= 1 && height >= 1 && width <= kMaxSide && height <= kMaxSide) return;
  throw InvalidArgument("image size " + size_text(width, height) + ": choose 1x1 to " + size_text(kMaxSide, kMaxSide));
}

void check_type(const std::string& what, PixelType type) {
  if (type != PixelType::kU8 && type != PixelType::kU16)
    throw InvalidArgument(what + "unknown pixel type: give kU8 or kU16");
}

void check_rows(const std::string& view, const ImageView& image) {
  check_type(view, image.type);
  const std::int64_t row = static_cast<std::int64_t>(image.width) * (image.type == PixelType::kU8 ? 1 : 2);
  if (image.height > 1 && std::abs(static_cast<std::int64_t>(image.stride_bytes)) < row) {
    throw InvalidArgument(view + "a stride of " + std::to_string(image.stride_bytes) +
                          " bytes is shorter than a row of " + std::to_string(row));
  }
}

void check_frame(shared::ImageSize size, const ImageView& left, const ImageView& right, const FrameOutputs& outputs) {
  check_image("left", left, size);
  check_image("right", right, size);
  if (left.type != right.type)
    throw InvalidArgument("left and right image differ in type: give both with 8 or both with 16 bits");
  for_each_output(outputs, [&](const OutputText& text, const auto& map) { check_map(text.name, map, size); });
}

}  // namespace egosgm
