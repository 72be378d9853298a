// SPDX-License-Identifier: Apache-2.0
#include "vision/plain_png.h"

#include <isa-l.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <vector>

#include "vision/image_bounds.h"
#include "vision/png.h"

namespace egosgm::vision {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::string_view kSignature("\x89PNG\r\n\x1a\n", 8);
constexpr std::size_t kAroundChunk = 12;  // length, name and checksum
constexpr std::uint8_t kGrey = 0, kRgb = 2;
constexpr std::uint8_t kSub = 1;

const std::uint8_t* data_of(std::string_view bytes) { return reinterpret_cast<const std::uint8_t*>(bytes.data()); }

std::uint32_t number_at(std::string_view bytes, std::size_t at) {
  const std::uint8_t* b = data_of(bytes) + at;
  return std::uint32_t{b[0]} << 24 | std::uint32_t{b[1]} << 16 | std::uint32_t{b[2]} << 8 | b[3];
}

void append_number(std::string& bytes, std::uint32_t number) {
  for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<char>(number >> shift));
}

std::uint32_t checksum_of(std::string_view bytes) { return crc32_gzip_refl(0, data_of(bytes), bytes.size()); }

struct Chunk {
  std::string_view name, data;
};

/// Takes the next chunk off `bytes`; nothing where it is not whole.
std::optional<Chunk> take_chunk(std::string_view& bytes) {
  if (bytes.size() < kAroundChunk) return {};
  const std::size_t length = number_at(bytes, 0);
  if (length > bytes.size() - kAroundChunk) return {};
  if (checksum_of(bytes.substr(4, 4 + length)) != number_at(bytes, 8 + length)) return {};
  const Chunk chunk{bytes.substr(4, 4), bytes.substr(8, length)};
  bytes.remove_prefix(kAroundChunk + length);
  return chunk;
}

/// The type of a plain file's pixels.
std::optional<ImageType> type_of(const Chunk& header) {
  if (header.name != "IHDR" || header.data.size() != 13) return {};
  const std::uint8_t* field = data_of(header.data) + 8;
  const std::uint8_t bits = field[0], color = field[1], compression = field[2], filter = field[3], interlace = field[4];
  if (compression != 0 || filter != 0 || interlace != 0) return {};
  if (color == kGrey && (bits == 8 || bits == 16)) return bits == 8 ? kU8 : kU16;
  return color == kRgb && bits == 8 ? std::optional(kBgr8) : std::nullopt;
}

/// The compressed data of one chunk after the other, to the file's end.
std::optional<std::string> compressed_in(std::string_view chunks) {
  std::string compressed;
  while (const std::optional<Chunk> chunk = take_chunk(chunks)) {
    if (chunk->name == "IEND") return compressed;
    if (chunk->name != "IDAT") return {};
    compressed += chunk->data;
  }
  return {};
}

/// Whether `compressed` holds so many bytes, no more and no less.
bool inflate(std::string& compressed, Bytes& bytes) {
  const auto state = std::make_unique<inflate_state>();
  isal_inflate_init(state.get());
  state->crc_flag = ISAL_ZLIB;
  state->next_in = reinterpret_cast<std::uint8_t*>(compressed.data());
  state->avail_in = static_cast<std::uint32_t>(compressed.size());
  state->next_out = bytes.data();
  state->avail_out = static_cast<std::uint32_t>(bytes.size());
  return isal_inflate_stateless(state.get()) == ISAL_DECOMP_OK && state->avail_out == 0 && state->avail_in == 0;
}

/// Which of the three the sum of the first two less the third is nearest to.
std::uint8_t nearest_of(int left, int above, int above_left) {
  const int to_left = std::abs(above - above_left), to_above = std::abs(left - above_left);
  const int to_above_left = std::abs(left + above - 2 * above_left);
  const int of_two = to_above <= to_above_left ? above : above_left;
  return static_cast<std::uint8_t>(to_left <= to_above && to_left <= to_above_left ? left : of_two);
}

/// Adds to a row what its filter took off. `above`: the row above without its filter; kPixel: bytes of a pixel, which
/// stay in registers from one to the next. False: no such filter.
template <int kPixel>
bool unfilter(int filter, const std::uint8_t* above, std::uint8_t* row, std::size_t count) {
  std::uint8_t left[kPixel] = {}, above_left[kPixel] = {};
  const auto add = [&](const auto& predicted) {
    for (std::size_t x = 0; x < count; x += kPixel) {
      for (int i = 0; i < kPixel; ++i) {
        left[i] = static_cast<std::uint8_t>(row[x + i] + predicted(i, above[x + i]));
        above_left[i] = above[x + i];
        row[x + i] = left[i];
      }
    }
  };
  switch (filter) {
    case 0:
      return true;
    case kSub:
      add([&](int i, int) { return left[i]; });
      return true;
    case 2:
      add([](int, int up) { return up; });
      return true;
    case 3:
      add([&](int i, int up) { return (left[i] + up) / 2; });
      return true;
    case 4:
      add([&](int i, int up) { return nearest_of(left[i], up, above_left[i]); });
      return true;
    default:
      return false;
  }
}

bool unfilter(int filter, const std::uint8_t* above, std::uint8_t* row, std::size_t count, std::size_t pixel) {
  return pixel == 1   ? unfilter<1>(filter, above, row, count)
         : pixel == 2 ? unfilter<2>(filter, above, row, count)
                      : unfilter<3>(filter, above, row, count);
}

template <int kPixel>
void reverse_pixels(const std::uint8_t* from, std::uint8_t* to, std::size_t count) {
  for (std::size_t i = 0; i + kPixel <= count; i += kPixel) {
    for (int byte = 0; byte < kPixel; ++byte) to[i + byte] = from[i + kPixel - 1 - byte];
  }
}

/// A row's bytes in the order of files, and back: of 16 bits the upper ones first, of colours red.
void swap_order(std::size_t pixel, const std::uint8_t* from, std::uint8_t* to, std::size_t count) {
  const auto reverse = pixel == 1   ? reverse_pixels<1>
                       : pixel == 2 ? reverse_pixels<2>
                       : pixel == 3 ? reverse_pixels<3>
                                    : reverse_pixels<6>;
  reverse(from, to, count);
}

/// Each row's filter, and its bytes as that leaves them: the differences to the pixel before, as disparities and grey
/// values leave little else.
Bytes filtered_rows(const Image& image) {
  const std::size_t pixel = image.type.pixel_bytes(), count = pixel * static_cast<std::size_t>(image.cols);
  Bytes all((1 + count) * static_cast<std::size_t>(image.rows)), row(count);
  std::uint8_t* next = all.data();
  for (int y = 0; y < image.rows; ++y, next += count) {
    swap_order(pixel, image.row(y), row.data(), count);
    *next++ = kSub;
    std::copy_n(row.data(), pixel, next);
    for (std::size_t i = pixel; i < count; ++i) next[i] = static_cast<std::uint8_t>(row[i] - row[i - pixel]);
  }
  return all;
}

/// Appends `bytes`, compressed.
void append_deflated(Bytes& bytes, std::string& to) {
  constexpr int kLevel = 3;
  Bytes memory(ISAL_DEF_LVL3_DEFAULT);
  const auto stream = std::make_unique<isal_zstream>();
  isal_deflate_init(stream.get());
  stream->level = kLevel;
  stream->level_buf = memory.data();
  stream->level_buf_size = static_cast<std::uint32_t>(memory.size());
  stream->gzip_flag = IGZIP_ZLIB;
  stream->end_of_stream = 1;
  stream->next_in = bytes.data();
  stream->avail_in = static_cast<std::uint32_t>(bytes.size());
  while (stream->internal_state.state != ZSTATE_END) {
    const std::size_t begin = to.size(), room = bytes.size() / 2 + 1024;
    to.resize(begin + room);
    stream->next_out = reinterpret_cast<std::uint8_t*>(to.data()) + begin;
    stream->avail_out = static_cast<std::uint32_t>(room);
    if (isal_deflate(stream.get()) != COMP_OK) throw std::logic_error("isal_deflate takes no such stream");
    to.resize(begin + room - stream->avail_out);
  }
}

/// Appends a chunk whose data `append` appends.
template <typename Append>
void append_chunk(std::string& bytes, std::string_view name, Append&& append) {
  const std::size_t begin = bytes.size();
  append_number(bytes, 0);
  bytes += name;
  append(bytes);
  std::string length;
  append_number(length, static_cast<std::uint32_t>(bytes.size() - begin - 8));
  bytes.replace(begin, 4, length);
  append_number(bytes, checksum_of(std::string_view(bytes).substr(begin + 4)));
}

}  // namespace

std::optional<Image> decode_plain_png(std::string_view bytes, Size size, const std::filesystem::path& file) {
  std::string_view chunks = bytes.substr(kSignature.size());
  const std::optional<Chunk> header = take_chunk(chunks);
  const std::optional<ImageType> plain = header ? type_of(*header) : std::nullopt;
  if (!plain) return {};
  const ImageType type = *plain;
  check_decoded_bytes(size, type, bytes.size(), file);
  std::optional<std::string> compressed = compressed_in(chunks);
  if (!compressed) return {};

  const std::size_t pixel = type.pixel_bytes(), count = pixel * static_cast<std::size_t>(size.width);
  Bytes rows((1 + count) * static_cast<std::size_t>(size.height));
  if (!inflate(*compressed, rows)) return {};
  Image pixels(size, type);
  const Bytes nothing(count);
  const std::uint8_t* above = nothing.data();
  std::uint8_t* row = rows.data();
  for (int y = 0; y < size.height; ++y, row += count) {
    const int filter = *row++;
    if (!unfilter(filter, above, row, count, pixel)) return {};
    if (type == kU16) {
      swap_order(pixel, row, pixels.row(y), count);
    } else {
      std::copy_n(row, count, pixels.row(y));
    }
    above = row;
  }
  return pixels;
}

std::string encode_plain_png(const Image& image) {
  const bool is_color = image.type.channels == 3;
  std::string bytes(kSignature);
  append_chunk(bytes, "IHDR", [&](std::string& to) {
    append_number(to, static_cast<std::uint32_t>(image.cols));
    append_number(to, static_cast<std::uint32_t>(image.rows));
    to.push_back(static_cast<char>(8 * image.type.channel_bytes()));
    to.push_back(static_cast<char>(is_color ? kRgb : kGrey));
    to.append(3, '\0');
  });
  append_chunk(bytes, "IDAT", [&](std::string& to) {
    Bytes rows = filtered_rows(image);
    append_deflated(rows, to);
  });
  append_chunk(bytes, "IEND", [](std::string&) {});
  return bytes;
}

}  // namespace egosgm::vision
