// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/disparity_io.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>

#include "egosgm/error.h"
#include "egosgm/vision/image_io.h"
#include "host/cpu_clones.h"
#include "vision/file_io.h"
#include "vision/frame_names.h"
#include "vision/image_bounds.h"
#include "vision/image_values.h"
#include "vision/npy.h"
#include "vision/png.h"

namespace egosgm::vision {
namespace {

constexpr float kKittiStepsPerPx = 256.0f;
constexpr std::size_t kMaxMapFileBytes = static_cast<std::size_t>(kMaxImagePixels) * sizeof(double) + 256;

void require_map(const Image& map, const std::filesystem::path& file) {
  if (map.empty() || map.type != kF32) {
    throw InvalidArgument(file.string() + ": only a non-empty float32 map can be written");
  }
}

inline bool fits_png(float disparity) { return (disparity >= 0) & (disparity < 65536.0f / kKittiStepsPerPx); }

// Without branches, which would keep compilers from vectors.
EGOSGM_CPU_CLONES
void store_row(const float* __restrict disparity, int width, std::uint16_t* __restrict stored) {
  for (int x = 0; x < width; ++x) {
    const float steps = disparity[x] * kKittiStepsPerPx, least = steps < 1.0f ? 1.0f : steps;
    stored[x] = static_cast<std::uint16_t>(static_cast<int>(fits_png(disparity[x]) ? least : 0.0f));
  }
}

EGOSGM_CPU_CLONES
int count_outside(const float* disparity, int width) {
  int count = 0;
  for (int x = 0; x < width; ++x) {
    const float d = disparity[x];
    const bool is_valid = (d > kInvalidDisparity) & (d <= std::numeric_limits<float>::max());
    count += is_valid & !fits_png(d);
  }
  return count;
}

Image parse_disparity_png(std::string_view bytes, const std::filesystem::path& file, float steps_per_px) {
  const Image stored = decode_png(bytes, file);
  if (stored.type != kU16) {
    throw InvalidArgument(file.string() + ": not a disparity map: KITTI's are 16-bit grey PNG, this one has " +
                          std::to_string(stored.type.channels) + " channel(s) of " +
                          std::to_string(8 * stored.type.channel_bytes()) + " bit");
  }
  Image disparity = as_floats(stored);
  for (int y = 0; y < stored.rows; ++y) {
    auto* row = disparity.row<float>(y);
    for (int x = 0; x < stored.cols; ++x) row[x] /= steps_per_px;
  }
  set_where(disparity, kInvalidDisparity, stored, [](auto value) { return value == 0; });
  return disparity;
}

struct PfmHeader {
  Size size;
  std::endian byte_order = std::endian::little;
  std::size_t bytes = 0;  // up to the first pixel
};

[[noreturn]] void refuse_pfm(const std::filesystem::path& file, const std::string& why) {
  throw InvalidArgument(file.string() + ": not a readable PFM (truncated?): " + why +
                        "; give an intact one-channel PFM");
}

bool is_space(char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }

/// The next number of the header, and what separates it from the last one.
template <typename Number>
Number parse_header_number(std::string_view bytes, std::size_t& position, const std::filesystem::path& file) {
  constexpr std::size_t kMaxHeaderBytes = 200;
  const std::string_view header = bytes.substr(0, kMaxHeaderBytes);
  const std::size_t begin = position;
  while (position < header.size() && is_space(header[position])) ++position;
  Number number{};
  const auto [end, error] = std::from_chars(header.data() + position, header.data() + header.size(), number);
  if (begin == position || error != std::errc()) refuse_pfm(file, "its header is not `Pf WIDTH HEIGHT SCALE`");
  position = static_cast<std::size_t>(end - header.data());
  return number;
}

PfmHeader parse_pfm_header(std::string_view bytes, const std::filesystem::path& file) {
  if (bytes.starts_with("PF")) refuse_pfm(file, "it has three channels");
  if (!bytes.starts_with("Pf")) refuse_pfm(file, "it does not start with `Pf`");
  std::size_t position = 2;
  const auto width = parse_header_number<std::int64_t>(bytes, position, file);
  const auto height = parse_header_number<std::int64_t>(bytes, position, file);
  const auto scale = parse_header_number<double>(bytes, position, file);
  if (width <= 0 || height <= 0) refuse_pfm(file, "its width or height is not positive");
  if (width > kMaxImageSide || height > kMaxImageSide || width * height > kMaxImagePixels) {
    refuse_pfm(file, std::to_string(width) + "x" + std::to_string(height) + " is larger than the limit of " +
                         std::to_string(kMaxImageSide) + " a side and " + std::to_string(kMaxImagePixels) + " pixels");
  }
  if (scale == 0 || !std::isfinite(scale)) refuse_pfm(file, "its scale is zero or not a number");
  if (position >= bytes.size() || !is_space(bytes[position])) refuse_pfm(file, "it ends in its header");
  return {.size = {static_cast<int>(width), static_cast<int>(height)},
          .byte_order = scale < 0 ? std::endian::little : std::endian::big,
          .bytes = position + 1};
}

float load_float(const char* bytes, std::endian byte_order) {
  std::uint32_t word = 0;
  std::memcpy(&word, bytes, sizeof word);
  if (byte_order != std::endian::native) word = __builtin_bswap32(word);
  return std::bit_cast<float>(word);
}

Image parse_pfm(std::string_view bytes, const std::filesystem::path& file) {
  const PfmHeader header = parse_pfm_header(bytes, file);
  const std::size_t expected = static_cast<std::size_t>(header.size.area()) * sizeof(float);
  const std::size_t found = bytes.size() - header.bytes;
  if (found != expected) {
    refuse_pfm(file, "it holds " + std::to_string(found) + " bytes of pixels instead of " + std::to_string(expected));
  }
  Image map(header.size, kF32);
  const char* next = bytes.data() + header.bytes;
  for (int y = map.rows - 1; y >= 0; --y) {
    auto* row = map.row<float>(y);
    for (int x = 0; x < map.cols; ++x, next += sizeof(float)) {
      const float value = load_float(next, header.byte_order);
      row[x] = is_valid_disparity(value) ? value : kInvalidDisparity;
    }
  }
  return map;
}

}  // namespace

Image read_disparity(const std::filesystem::path& file, double png_steps_per_px) {
  if (!(png_steps_per_px > 0 && std::isfinite(png_steps_per_px))) {
    throw InvalidArgument("PNG steps a pixel are " + std::to_string(png_steps_per_px) + ": must be positive");
  }
  const std::string bytes = read_file(file, kMaxMapFileBytes);
  if (starts_like_png(bytes)) return parse_disparity_png(bytes, file, static_cast<float>(png_steps_per_px));
  if (starts_like_npy(bytes)) {
    Image map = parse_npy(bytes, file);
    set_where(map, kInvalidDisparity, map, [](float d) { return !(d > 0 && is_valid_disparity(d)); });
    return map;
  }
  if (bytes.starts_with("Pf") || bytes.starts_with("PF")) return parse_pfm(bytes, file);
  throw InvalidArgument(file.string() + ": not a readable disparity map (truncated?): neither PNG nor PFM nor .npy");
}

Image read_values(const std::filesystem::path& file) {
  const std::string bytes = read_file(file, kMaxMapFileBytes);
  if (starts_like_png(bytes)) {
    const Image stored = decode_png(bytes, file);
    if (stored.type.channels != 1) throw InvalidArgument(file.string() + ": has three channels; give a grey PNG");
    return as_floats(stored);
  }
  if (starts_like_npy(bytes)) return parse_npy(bytes, file);
  Image values = parse_pfm(bytes, file);
  set_where(values, std::numeric_limits<float>::quiet_NaN(), values,
            [](auto value) { return value == kInvalidDisparity; });
  return values;
}

std::int64_t write_disparity(const std::filesystem::path& file, const Image& disparity) {
  const std::string extension = lower(file.extension().string());
  if (extension == ".png") return write_disparity_png(file, disparity);
  if (extension != ".pfm") throw InvalidArgument(file.string() + ": a disparity map's name must end in .png or .pfm");
  write_pfm(file, disparity);
  return 0;
}

std::int64_t write_disparity_png(const std::filesystem::path& file, const Image& disparity) {
  require_map(disparity, file);
  Image stored(disparity.size(), kU16);
  for (int y = 0; y < disparity.rows; ++y) {
    store_row(disparity.row<float>(y), disparity.cols, stored.row<std::uint16_t>(y));
  }
  write_png(file, stored);
  return count_outside_png(disparity);
}

void write_flow_png(const std::filesystem::path& file, const Image& flow) {
  if (flow.type != kFlow) throw InvalidArgument(file.string() + ": only an optical flow can be written");
  const auto steps = [](float px) { return std::round(px * 64 + 32768); };
  Image stored(flow.size(), kBgr16, 0);
  for (int y = 0; y < flow.rows; ++y) {
    const auto* from = flow.row<float>(y);
    auto* to = stored.row<std::uint16_t>(y);
    for (int x = 0; x < flow.cols; ++x, from += 2, to += 3) {
      const float u = steps(from[0]), v = steps(from[1]);
      if (!(u >= 0 && u <= 65535 && v >= 0 && v <= 65535)) continue;
      to[0] = 1, to[1] = static_cast<std::uint16_t>(v), to[2] = static_cast<std::uint16_t>(u);
    }
  }
  write_png(file, stored);
}

std::int64_t count_outside_png(const Image& disparity) {
  if (disparity.type != kF32) throw InvalidArgument("count_outside_png: the map must be float32");
  std::int64_t outside = 0;
  for (int y = 0; y < disparity.rows; ++y) outside += count_outside(disparity.row<float>(y), disparity.cols);
  return outside;
}

Image read_pfm(const std::filesystem::path& file) { return parse_pfm(read_file(file, kMaxMapFileBytes), file); }

void write_pfm(const std::filesystem::path& file, const Image& map) {
  require_map(map, file);
  std::string bytes = "Pf\n" + std::to_string(map.cols) + " " + std::to_string(map.rows) + "\n-1.0\n";
  const std::size_t header_bytes = bytes.size();
  bytes.resize(header_bytes + map.pixels() * sizeof(float));
  char* next = bytes.data() + header_bytes;
  for (int y = map.rows - 1; y >= 0; --y) {
    const auto* row = map.row<float>(y);
    for (int x = 0; x < map.cols; ++x, next += sizeof(float)) {
      const float value = is_valid_disparity(row[x]) ? row[x] : std::numeric_limits<float>::infinity();
      auto word = std::bit_cast<std::uint32_t>(value);
      if constexpr (std::endian::native == std::endian::big) word = __builtin_bswap32(word);
      std::memcpy(next, &word, sizeof word);
    }
  }
  write_file(file, bytes);
}

}  // namespace egosgm::vision
