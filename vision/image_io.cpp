// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/image_io.h"

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include "egosgm/error.h"
#include "egosgm/vision/render.h"
#include "vision/file_io.h"
#include "vision/grey_bytes.h"
#include "vision/image_bounds.h"
#include "vision/jpeg.h"
#include "vision/plain_png.h"
#include "vision/png.h"

namespace egosgm::vision {

namespace {

/// By what the file holds, not by its name.
cv::Mat decode_image(const std::filesystem::path& file) {
  const std::string bytes = read_file(file, kMaxImageFileBytes);
  return starts_like_jpeg(bytes) ? decode_jpeg(bytes, file) : decode_png(bytes, file);
}

/// RGB becomes BGR, or the other way round.
void reverse_colors(cv::Mat& pixels) {
  const auto reverse = [&]<typename T>(T) {
    for (int y = 0; y < pixels.rows; ++y) {
      auto* row = pixels.ptr<T>(y);
      for (int x = 0; x < pixels.cols; ++x) std::swap(row[3 * x], row[3 * x + 2]);
    }
  };
  pixels.depth() == CV_8U ? reverse(std::uint8_t{}) : reverse(std::uint16_t{});
}

}  // namespace

cv::Mat grey_of_colors(const cv::Mat& colors, ColorOrder order) {
  cv::Mat grey(colors.size(), colors.depth());
  const int channels = colors.channels(), red = order == ColorOrder::kRgb ? 0 : 2;
  const auto weigh = [&]<typename T>(T) {
    for (int y = 0; y < colors.rows; ++y) {
      const T* pixel = colors.ptr<T>(y);
      for (int x = 0; x < colors.cols; ++x, pixel += channels) {
        const std::uint64_t sum = std::uint64_t{9798} * pixel[red] + std::uint64_t{19235} * pixel[1] +
                                  std::uint64_t{3735} * pixel[2 - red] + (1 << 14);
        grey.at<T>(y, x) = static_cast<T>(sum >> 15);
      }
    }
  };
  colors.depth() == CV_8U ? weigh(std::uint8_t{}) : weigh(std::uint16_t{});
  return grey;
}

cv::Mat read_grey_image(const std::filesystem::path& file) {
  const cv::Mat pixels = decode_image(file);
  return pixels.channels() == 1 ? pixels : grey_of_colors(pixels, ColorOrder::kRgb);
}

cv::Mat read_stored_image(const std::filesystem::path& file) {
  cv::Mat pixels = decode_image(file);
  if (pixels.channels() == 3) reverse_colors(pixels);
  return pixels;
}

cv::Mat read_color_image(const std::filesystem::path& file) {
  cv::Mat pixels = decode_image(file);
  if (pixels.channels() == 1) return color_grey(pixels);
  if (pixels.depth() == CV_16U) pixels.convertTo(pixels, CV_8U, 1.0 / 256.0, -0.499);  // rounds, halves to even numbers
  reverse_colors(pixels);
  return pixels;
}

bool holds_8_bits_in_16(const cv::Mat& grey) {
  if (grey.type() != CV_16UC1) return false;
  for (int y = 0; y < grey.rows; ++y) {
    const auto* row = grey.ptr<std::uint16_t>(y);
    if (std::any_of(row, row + grey.cols, [](std::uint16_t value) { return value > 255; })) return false;
  }
  return true;
}

cv::Size read_image_size(const std::filesystem::path& file) {
  const std::string start = read_file_start(file, kPngHeaderBytes);
  if (!starts_like_jpeg(start)) return parse_png_size(start, file);
  try {
    return parse_jpeg_size(read_file_start(file, kUsualJpegHeaderBytes), file);
  } catch (const InvalidArgument&) {
    return parse_jpeg_size(read_file(file, kMaxImageFileBytes), file);
  }
}

PixelType read_pixel_type(const std::filesystem::path& file) {
  constexpr std::size_t kBitDepth = 24;  // the byte of a PNG that holds it
  const std::string start = read_file_start(file, kPngHeaderBytes);
  const bool has_16_bits = !starts_like_jpeg(start) && start.size() > kBitDepth && start[kBitDepth] == 16;
  return has_16_bits ? PixelType::kU16 : PixelType::kU8;
}

void write_png(const std::filesystem::path& file, const cv::Mat& image) {
  const int type = image.type();
  if (image.empty() || (type != CV_8UC1 && type != CV_8UC3 && type != CV_16UC1)) {
    throw InvalidArgument(file.string() +
                          ": only non-empty images of 8 or 16 bit grey or 8 bit BGR are written as PNG");
  }
  write_file(file, encode_plain_png(image));
}

}  // namespace egosgm::vision
