// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/image_io.h"

#include <opencv2/imgproc.hpp>
#include <string>
#include <string_view>

#include "egosgm/error.h"
#include "egosgm/vision/render.h"
#include "host/vision/file_io.h"
#include "host/vision/image_bounds.h"
#include "host/vision/jpeg.h"
#include "host/vision/plain_png.h"
#include "host/vision/png.h"

namespace egosgm::vision {

namespace {

/// By what the file holds, not by its name.
cv::Mat decode_image(const std::filesystem::path& file) {
  const std::string bytes = read_file(file, kMaxImageFileBytes);
  return starts_like_jpeg(bytes) ? decode_jpeg(bytes, file) : decode_png(bytes, file);
}

}  // namespace

cv::Mat read_grey_image(const std::filesystem::path& file) {
  const cv::Mat pixels = decode_image(file);
  if (pixels.channels() == 1) return pixels;
  cv::Mat grey;
  cv::cvtColor(pixels, grey, cv::COLOR_RGB2GRAY);
  return grey;
}

cv::Mat read_stored_image(const std::filesystem::path& file) {
  cv::Mat pixels = decode_image(file);
  if (pixels.channels() == 3) cv::cvtColor(pixels, pixels, cv::COLOR_RGB2BGR);
  return pixels;
}

cv::Mat read_color_image(const std::filesystem::path& file) {
  cv::Mat pixels = decode_image(file), picture;
  if (pixels.channels() == 1) return color_grey(pixels);
  if (pixels.depth() == CV_16U) pixels.convertTo(pixels, CV_8U, 1.0 / 256.0, -0.5);  // rounds, so half a step down
  cv::cvtColor(pixels, picture, cv::COLOR_RGB2BGR);
  return picture;
}

bool holds_8_bits_in_16(const cv::Mat& grey) { return grey.type() == CV_16UC1 && cv::norm(grey, cv::NORM_INF) < 256; }

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
