// SPDX-License-Identifier: Apache-2.0
#include "host/vision/flow_io.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>

#include "egosgm/error.h"
#include "egosgm/vision/image_io.h"
#include "host/vision/file_io.h"
#include "host/vision/png.h"

namespace egosgm::vision {
namespace {

constexpr std::string_view kFloMagic = "PIEH";
constexpr std::size_t kFloHeaderBytes = 12;
constexpr float kFloUnknown = 1e9f;  // what is larger is unknown
constexpr std::size_t kMaxFlowFileBytes = static_cast<std::size_t>(kMaxImagePixels) * 2 * sizeof(float) + 12;

const cv::Vec2f kNone(std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::quiet_NaN());

cv::Mat parse_kitti(std::string_view bytes, const std::filesystem::path& file) {
  const cv::Mat stored = decode_png(bytes, file);
  if (stored.type() != CV_16UC3) {
    throw InvalidArgument(file.string() + ": not optical flow: KITTI's is 16-bit RGB PNG, this one has " +
                          std::to_string(stored.channels()) + " channel(s) of " +
                          std::to_string(8 * stored.elemSize1()) + " bit");
  }
  cv::Mat flow(stored.size(), CV_32FC2);
  for (int y = 0; y < stored.rows; ++y) {
    for (int x = 0; x < stored.cols; ++x) {
      const auto& rgb = stored.at<cv::Vec3w>(y, x);
      const auto px = [](std::uint16_t value) { return (static_cast<float>(value) - 32768.0f) / 64.0f; };
      flow.at<cv::Vec2f>(y, x) = rgb[2] == 0 ? kNone : cv::Vec2f(px(rgb[0]), px(rgb[1]));
    }
  }
  return flow;
}

std::uint32_t little_endian_at(std::string_view bytes, std::size_t offset) {
  std::uint32_t word = 0;
  std::memcpy(&word, bytes.data() + offset, sizeof word);
  if constexpr (std::endian::native == std::endian::big) word = __builtin_bswap32(word);
  return word;
}

cv::Mat parse_flo(std::string_view bytes, const std::filesystem::path& file) {
  if (bytes.size() < kFloHeaderBytes) throw InvalidArgument(file.string() + ": not a readable .flo (truncated?)");
  const std::int64_t width = static_cast<std::int32_t>(little_endian_at(bytes, 4));
  const std::int64_t height = static_cast<std::int32_t>(little_endian_at(bytes, 8));
  if (width < 1 || height < 1 || width > kMaxImageSide || height > kMaxImageSide || width * height > kMaxImagePixels ||
      static_cast<std::int64_t>(bytes.size() - kFloHeaderBytes) != 8 * width * height) {
    throw InvalidArgument(file.string() + ": not a readable .flo (truncated?): " + std::to_string(width) + "x" +
                          std::to_string(height) + " pixels do not fit its " + std::to_string(bytes.size()) + " bytes");
  }
  cv::Mat flow(static_cast<int>(height), static_cast<int>(width), CV_32FC2);
  std::size_t at = kFloHeaderBytes;
  for (int y = 0; y < flow.rows; ++y) {
    for (int x = 0; x < flow.cols; ++x, at += 8) {
      const cv::Vec2f value(std::bit_cast<float>(little_endian_at(bytes, at)),
                            std::bit_cast<float>(little_endian_at(bytes, at + 4)));
      const bool known = std::abs(value[0]) < kFloUnknown && std::abs(value[1]) < kFloUnknown;
      flow.at<cv::Vec2f>(y, x) = known ? value : kNone;
    }
  }
  return flow;
}

}  // namespace

cv::Mat read_flow(const std::filesystem::path& file) {
  const std::string bytes = read_file(file, kMaxFlowFileBytes);
  if (starts_like_png(bytes)) return parse_kitti(bytes, file);
  if (bytes.starts_with(kFloMagic)) return parse_flo(bytes, file);
  throw InvalidArgument(file.string() + ": not readable optical flow (truncated?): neither KITTI's PNG nor .flo");
}

}  // namespace egosgm::vision
