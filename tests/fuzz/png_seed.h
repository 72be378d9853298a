// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "egosgm/error.h"
#include "tests/fuzz/memory_file.h"
#include "vision/plain_png.h"

namespace egosgm::fuzz {

/// A small PNG: kU8, kU16 or kBgr8.
inline std::string png_seed(vision::ImageType type) {
  vision::Image image(9, 14, type);
  for (int y = 0; y < image.rows; ++y) {
    std::uint8_t* row = image.row(y);
    for (std::size_t i = 0; i < image.cols * type.pixel_bytes(); ++i)
      row[i] = static_cast<std::uint8_t>(y * 31 + static_cast<int>(i) * 7);
  }
  return vision::encode_plain_png(image);
}

/// CRC-32 of PNG's chunks.
inline std::uint32_t checksum(std::string_view bytes) {
  std::uint32_t crc = 0xffffffffu;
  for (const char c : bytes) {
    crc ^= static_cast<std::uint8_t>(c);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
  }
  return ~crc;
}

/// The same file with the checksums that its chunks should have: else a reader looks no further than at those.
inline std::string with_checksums(std::string_view input) {
  std::string bytes(input);
  std::size_t at = 8;
  while (at + 12 <= bytes.size()) {
    std::uint32_t length = 0;
    for (int i = 0; i < 4; ++i) length = length << 8 | static_cast<std::uint8_t>(bytes[at + i]);
    if (length > bytes.size() - at - 12) break;
    const std::uint32_t crc = checksum(std::string_view(bytes).substr(at + 4, length + 4));
    for (int i = 0; i < 4; ++i) bytes[at + 8 + length + i] = static_cast<char>(crc >> (24 - 8 * i));
    at += length + 12;
  }
  return bytes;
}

/// Reads the input by `read`, as it is and with checksums. Gives a result if one of the two does.
template <typename Read>
void read_png_bytes(std::string_view input, Read&& read) {
  try {
    const MemoryFile file(input);
    read(file.path());
  } catch (const InvalidArgument&) {
    const MemoryFile repaired(with_checksums(input));
    read(repaired.path());
  }
}

}  // namespace egosgm::fuzz
