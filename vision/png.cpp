// SPDX-License-Identifier: Apache-2.0
#include "vision/png.h"

#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstdint>
#include <cstring>
#include <string>

#include "egosgm/error.h"
#include "egosgm/vision/image_io.h"
#include "vision/foreign_file.h"
#include "vision/image_bounds.h"
#include "vision/plain_png.h"

namespace egosgm::vision {
namespace {

constexpr std::string_view kSignature("\x89PNG\r\n\x1a\n", 8);
constexpr png_alloc_size_t kMaxAncillaryBytes = 4 << 20;

std::uint32_t big_endian_at(std::string_view bytes, std::size_t offset) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<std::uint8_t>(bytes[offset + i]);
  return value;
}

/// The state that libpng's callbacks reach. libpng leaves an error by longjmp: no object with a destructor may live in
/// the frames between.
struct Decoder {
  png_structp png = nullptr;
  png_infop info = nullptr;
  const char* next = nullptr;
  std::size_t left = 0;
  std::jmp_buf on_error;
  char message[128] = "";

  Decoder() = default;
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;
  ~Decoder() { png_destroy_read_struct(&png, &info, nullptr); }
};

void handle_error(png_structp png, png_const_charp message) {
  auto* decoder = static_cast<Decoder*>(png_get_error_ptr(png));
  std::strncpy(decoder->message, message, sizeof decoder->message - 1);
  std::longjmp(decoder->on_error, 1);
}

void ignore_warning(png_structp, png_const_charp) {}

void read_bytes(png_structp png, png_bytep out, std::size_t count) {
  auto* decoder = static_cast<Decoder*>(png_get_io_ptr(png));
  if (count > decoder->left) png_error(png, "the file ends too early");
  std::memcpy(out, decoder->next, count);
  decoder->next += count;
  decoder->left -= count;
}

struct Layout {
  int channels = 0;
  int bit_depth = 0;
  int passes = 0;
};

bool read_layout(Decoder& decoder, Layout& layout) {
  if (setjmp(decoder.on_error)) return false;
  png_set_user_limits(decoder.png, kMaxImageSide, kMaxImageSide);
  png_set_chunk_malloc_max(decoder.png, kMaxAncillaryBytes);
  png_set_chunk_cache_max(decoder.png, 1);  // texts and unknown chunks are skipped: each might take as much
  png_set_read_fn(decoder.png, &decoder, read_bytes);
  png_read_info(decoder.png, decoder.info);
  png_set_expand(decoder.png);
  png_set_strip_alpha(decoder.png);
  if constexpr (std::endian::native == std::endian::little) {
    if (png_get_bit_depth(decoder.png, decoder.info) == 16) png_set_swap(decoder.png);
  }
  layout.passes = png_set_interlace_handling(decoder.png);
  png_read_update_info(decoder.png, decoder.info);
  layout.channels = png_get_channels(decoder.png, decoder.info);
  layout.bit_depth = png_get_bit_depth(decoder.png, decoder.info);
  return true;
}

bool read_rows(Decoder& decoder, const Layout& layout, std::uint8_t* rows, std::size_t stride_bytes, int height) {
  if (setjmp(decoder.on_error)) return false;
  for (int pass = 0; pass < layout.passes; ++pass) {
    for (int y = 0; y < height; ++y) png_read_row(decoder.png, rows + y * stride_bytes, nullptr);
  }
  png_read_end(decoder.png, nullptr);
  return true;
}

}  // namespace

bool starts_like_png(std::string_view bytes) { return bytes.starts_with(kSignature); }

Size parse_png_size(std::string_view bytes, const std::filesystem::path& file) {
  if (bytes.empty()) refuse_image(file, "the file is empty");
  if (!starts_like_png(bytes)) {
    const std::string kind = foreign_kind(bytes, file);
    if (kind.empty()) refuse_image(file, "it does not start like a PNG");
    throw InvalidArgument(file.string() + ": is no PNG or JPEG; " + kind);
  }
  if (bytes.size() < kPngHeaderBytes) refuse_image(file, "the file ends in its header");
  if (bytes.substr(12, 4) != "IHDR") refuse_image(file, "its header is damaged");
  const std::int64_t width = big_endian_at(bytes, 16);
  const std::int64_t height = big_endian_at(bytes, 20);
  return checked_image_size(width, height, file);
}

Image decode_png(std::string_view bytes, const std::filesystem::path& file) {
  const Size size = parse_png_size(bytes, file);
  if (std::optional<Image> plain = decode_plain_png(bytes, size, file)) return *std::move(plain);
  Decoder decoder;
  decoder.next = bytes.data();
  decoder.left = bytes.size();
  decoder.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &decoder, handle_error, ignore_warning);
  if (decoder.png) decoder.info = png_create_info_struct(decoder.png);
  if (!decoder.info) throw std::bad_alloc();
  Layout layout;
  if (!read_layout(decoder, layout)) refuse_image(file, decoder.message);
  const ImageType type{layout.bit_depth == 16 ? ChannelType::kU16 : ChannelType::kU8, layout.channels};
  check_decoded_bytes(size, type, bytes.size(), file);  // as widened: one bit may become three bytes
  Image pixels(size, type);
  if (!read_rows(decoder, layout, pixels.data, pixels.stride_bytes, size.height)) refuse_image(file, decoder.message);
  return pixels;
}

}  // namespace egosgm::vision
