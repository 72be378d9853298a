// SPDX-License-Identifier: Apache-2.0
#include "vision/npy.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "egosgm/error.h"
#include "egosgm/vision/image_io.h"
#include "vision/text_rows.h"

namespace egosgm::vision {
namespace {

constexpr std::string_view kMagic("\x93NUMPY", 6);
constexpr std::size_t kMaxSides = 64;  // of NumPy itself

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& why) {
  throw InvalidArgument(file.string() + ": not a readable .npy: " + why + "; give one H x W array of numbers");
}

/// The text after `'key':` in the header, without blanks before it.
std::string_view value_of(std::string_view header, std::string_view key, const std::filesystem::path& file) {
  const std::size_t at = header.find(key);
  const std::size_t colon = at == std::string_view::npos ? at : header.find(':', at);
  const std::size_t begin = colon == std::string_view::npos ? colon : header.find_first_not_of(' ', colon + 1);
  if (begin == std::string_view::npos) refuse(file, "its header has no " + std::string(key));
  return header.substr(begin);
}

std::vector<std::int64_t> parse_shape(std::string_view text, const std::filesystem::path& file) {
  std::vector<std::int64_t> shape;
  const std::size_t end = text.find(')');
  if (!text.starts_with('(') || end == std::string_view::npos) refuse(file, "its shape is no tuple");
  for (const char *next = text.data() + 1, *last = text.data() + end; next < last;) {
    std::int64_t side = 0;
    const auto [after, error] = std::from_chars(next, last, side);
    if (error != std::errc()) refuse(file, "its shape is no tuple of whole numbers");
    shape.push_back(side);
    if (shape.size() > kMaxSides) refuse(file, "its array has more than " + std::to_string(kMaxSides) + " sides");
    next = std::find_if_not(after, last, [](char c) { return c == ',' || c == ' '; });
  }
  return shape;
}

Size parse_size(std::string_view text, const std::filesystem::path& file) {
  std::vector<std::int64_t> shape = parse_shape(text, file);
  while (shape.size() > 2) {
    const auto one = std::find(shape.begin(), shape.end(), 1);
    if (one == shape.end()) break;
    shape.erase(one);
  }
  if (shape.size() != 2) refuse(file, "its array has " + std::to_string(shape.size()) + " sides instead of two");
  const std::int64_t height = shape[0], width = shape[1];
  if (height < 1 || width < 1) refuse(file, "its width or height is not positive");
  if (width > kMaxImageSide || height > kMaxImageSide || width * height > kMaxImagePixels) {
    refuse(file, std::to_string(width) + "x" + std::to_string(height) + " is larger than the limit of " +
                     std::to_string(kMaxImageSide) + " a side and " + std::to_string(kMaxImagePixels) + " pixels");
  }
  return {static_cast<int>(width), static_cast<int>(height)};
}

template <typename T>
float load(const char* bytes, bool swap) {
  std::array<char, sizeof(T)> own;
  std::memcpy(own.data(), bytes, sizeof(T));
  if (swap) std::reverse(own.begin(), own.end());
  T value;
  std::memcpy(&value, own.data(), sizeof(T));
  return static_cast<float>(value);
}

/// A half of IEEE 754.
struct Half {
  std::uint16_t bits;

  explicit operator float() const {
    const int exponent = (bits >> 10) & 31, fraction = bits & 1023;
    const float size = exponent == 31  ? (fraction ? NAN : INFINITY)
                       : exponent == 0 ? std::ldexp(static_cast<float>(fraction), -24)
                                       : std::ldexp(static_cast<float>(1024 + fraction), exponent - 25);
    return bits >> 15 ? -size : size;
  }
};

struct Numbers {
  std::string_view name;  // after the byte order, as NumPy calls it
  std::size_t bytes;
  float (*load)(const char*, bool);
};

constexpr std::array<Numbers, 11> kNumbers = {{{"f4", 4, load<float>},
                                               {"f8", 8, load<double>},
                                               {"f2", 2, load<Half>},
                                               {"u1", 1, load<std::uint8_t>},
                                               {"u2", 2, load<std::uint16_t>},
                                               {"i2", 2, load<std::int16_t>},
                                               {"i4", 4, load<std::int32_t>},
                                               {"u4", 4, load<std::uint32_t>},
                                               {"i8", 8, load<std::int64_t>},
                                               {"u8", 8, load<std::uint64_t>},
                                               {"i1", 1, load<std::int8_t>}}};

/// The header's length, and where it begins.
std::string_view header_of(std::string_view bytes, const std::filesystem::path& file) {
  const auto byte_at = [&](std::size_t i) { return static_cast<std::size_t>(static_cast<std::uint8_t>(bytes[i])); };
  if (bytes.size() < 12) refuse(file, "it ends in its header");
  const bool first_version = byte_at(6) == 1;
  const std::size_t begin = first_version ? 10 : 12;
  std::size_t length = byte_at(8) | byte_at(9) << 8;
  if (!first_version) length |= byte_at(10) << 16 | byte_at(11) << 24;
  if (length > bytes.size() - begin) refuse(file, "it ends in its header");
  return bytes.substr(begin, length);
}

}  // namespace

bool starts_like_npy(std::string_view bytes) { return bytes.starts_with(kMagic); }

Image parse_npy(std::string_view bytes, const std::filesystem::path& file) {
  const std::string_view header = header_of(bytes, file);
  const std::string_view type = value_of(header, "'descr'", file);  // '<f4'
  const auto* numbers = std::find_if(kNumbers.begin(), kNumbers.end(), [&](const Numbers& n) {
    return type.size() >= 5 && type.substr(2, 2) == n.name && type[4] == type[0];
  });
  if (numbers == kNumbers.end()) {
    const std::size_t end = type.size() > 1 ? type.find(type[0], 1) : type.npos;  // of the text in quotes
    refuse(file, "its numbers are " + quoted(type.substr(1, std::min<std::size_t>(end - 1, 12))) +
                     ", not floats or integers");
  }
  const bool is_big = type[1] == '>';
  const bool swap = numbers->bytes > 1 && is_big != (std::endian::native == std::endian::big);
  const bool columns_first = value_of(header, "'fortran_order'", file).starts_with("True");
  const Size size = parse_size(value_of(header, "'shape'", file), file);
  const std::string_view values = bytes.substr(static_cast<std::size_t>(header.data() - bytes.data()) + header.size());
  const std::size_t expected = static_cast<std::size_t>(size.area()) * numbers->bytes;
  if (values.size() != expected) {
    refuse(file, "it holds " + std::to_string(values.size()) + " bytes of numbers instead of " +
                     std::to_string(expected) + ": was it cut?");
  }
  Image map(size, kF32);
  const char* next = values.data();
  for (int i = 0; i < (columns_first ? size.width : size.height); ++i) {
    for (int j = 0; j < (columns_first ? size.height : size.width); ++j, next += numbers->bytes) {
      (columns_first ? map.at<float>(j, i) : map.at<float>(i, j)) = numbers->load(next, swap);
    }
  }
  return map;
}

}  // namespace egosgm::vision
