// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/image_io.h"

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include "egosgm/error.h"
#include "vision/file_io.h"
#include "vision/image_bounds.h"
#include "vision/image_values.h"
#include "vision/jpeg.h"
#include "vision/plain_png.h"
#include "vision/png.h"

namespace egosgm::vision {

namespace {

/// By what the file holds, not by its name.
Image decode_image(const std::filesystem::path& file) {
  const std::string bytes = read_file(file, kMaxImageFileBytes);
  return starts_like_jpeg(bytes) ? decode_jpeg(bytes, file) : decode_png(bytes, file);
}

/// RGB becomes BGR, or the other way round.
void reverse_colors(Image& pixels) {
  const auto reverse = [&]<typename T>(T) {
    for (int y = 0; y < pixels.rows; ++y) {
      auto* row = pixels.row<T>(y);
      for (int x = 0; x < pixels.cols; ++x) std::swap(row[3 * x], row[3 * x + 2]);
    }
  };
  pixels.type.channel == ChannelType::kU8 ? reverse(std::uint8_t{}) : reverse(std::uint16_t{});
}

int highest_value(const Image& deep) {
  int highest = 0;
  for (int y = 0; y < deep.rows; ++y) {
    const auto* row = deep.row<std::uint16_t>(y);
    highest = std::max<int>(highest, *std::max_element(row, row + deep.cols * deep.type.channels));
  }
  return highest;
}

}  // namespace

Image grey_of_colors(const Image& colors, ColorOrder order) {
  Image grey(colors.size(), {colors.type.channel, 1});
  const int channels = colors.type.channels, red = order == ColorOrder::kRgb ? 0 : 2;
  const auto weigh = [&]<typename T>(T) {
    for (int y = 0; y < colors.rows; ++y) {
      const T* pixel = colors.row<T>(y);
      for (int x = 0; x < colors.cols; ++x, pixel += channels) {
        const std::uint64_t sum = std::uint64_t{9798} * pixel[red] + std::uint64_t{19235} * pixel[1] +
                                  std::uint64_t{3735} * pixel[2 - red] + (1 << 14);
        grey.at<T>(y, x) = static_cast<T>(sum >> 15);
      }
    }
  };
  colors.type.channel == ChannelType::kU8 ? weigh(std::uint8_t{}) : weigh(std::uint16_t{});
  return grey;
}

Image color_grey(const Image& grey) {
  if (grey.empty() || (grey.type != kU8 && grey.type != kU16)) {
    throw InvalidArgument("color_grey: the image must be uint8 or uint16 and not empty");
  }
  Image bytes = grey, picture(grey.size(), kBgr8);
  if (grey.type.channel == ChannelType::kU16) bytes = as_bytes(grey, 255.0 / std::max(1, highest_value(grey)));
  for (int y = 0; y < bytes.rows; ++y) {
    const std::uint8_t* row = bytes.row(y);
    std::transform(row, row + bytes.cols, picture.row<Color>(y), [](auto v) { return Color{v, v, v}; });
  }
  return picture;
}

Image read_grey_image(const std::filesystem::path& file) {
  const Image pixels = decode_image(file);
  return pixels.type.channels == 1 ? pixels : grey_of_colors(pixels, ColorOrder::kRgb);
}

Image read_stored_image(const std::filesystem::path& file) {
  Image pixels = decode_image(file);
  if (pixels.type.channels == 3) reverse_colors(pixels);
  return pixels;
}

Image read_color_image(const std::filesystem::path& file) {
  Image pixels = decode_image(file);
  if (pixels.type.channels == 1) return color_grey(pixels);
  if (pixels.type.channel == ChannelType::kU16) {
    const int highest = highest_value(pixels);
    int bits = 8;
    while (highest >> bits) ++bits;
    pixels = as_bytes(pixels, 1.0 / (1 << (bits - 8)), -0.499);
  }
  reverse_colors(pixels);
  return pixels;
}

bool holds_8_bits_in_16(const Image& grey) {
  if (grey.type != kU16) return false;
  for (int y = 0; y < grey.rows; ++y) {
    const auto* row = grey.row<std::uint16_t>(y);
    if (std::any_of(row, row + grey.cols, [](std::uint16_t value) { return value > 255; })) return false;
  }
  return true;
}

Size read_image_size(const std::filesystem::path& file) {
  const std::string start = read_file_start(file, kPngHeaderBytes);
  if (!starts_like_jpeg(start)) return parse_png_size(start, file);
  try {
    return parse_jpeg_size(read_file_start(file, kUsualJpegHeaderBytes), file);
  } catch (const InvalidArgument&) {
    return parse_jpeg_size(read_file(file, kMaxImageFileBytes), file);
  }
}

void write_png(const std::filesystem::path& file, const Image& image) {
  const ImageType type = image.type;
  if (image.empty() || type.channel == ChannelType::kF32 || (type.channels != 1 && type.channels != 3)) {
    throw InvalidArgument(file.string() + ": only non-empty images of 8 or 16 bit grey or BGR are written as PNG");
  }
  write_file(file, encode_plain_png(image));
}

}  // namespace egosgm::vision
