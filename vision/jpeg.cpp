// SPDX-License-Identifier: Apache-2.0
#include "vision/jpeg.h"

#include <csetjmp>
#include <cstdio>
// libjpeg's header needs the lines above.
#include <jpeglib.h>

#include <string>

#include "egosgm/error.h"
#include "vision/image_bounds.h"

namespace egosgm::vision {
namespace {

constexpr std::string_view kStart("\xff\xd8\xff", 3);
constexpr int kMaxScans = 100;  // each costs a pass over the whole image, however short it is

/// The state that libjpeg's callbacks reach. libjpeg leaves an error by longjmp: no object with a destructor may live in the
/// frames between.
struct Decoder {
  jpeg_error_mgr errors{};
  jpeg_source_mgr source{};
  jpeg_progress_mgr progress{};
  jpeg_decompress_struct jpeg{};
  std::jmp_buf on_error;
  char message[JMSG_LENGTH_MAX] = "";

  Decoder() = default;
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;
  ~Decoder() { jpeg_destroy_decompress(&jpeg); }
};

[[noreturn]] void fail(j_common_ptr jpeg) {
  auto* decoder = static_cast<Decoder*>(jpeg->client_data);
  if (decoder->message[0] == '\0') jpeg->err->format_message(jpeg, decoder->message);
  std::longjmp(decoder->on_error, 1);
}

void fail_at_warning(j_common_ptr jpeg, int level) {
  if (level < 0) fail(jpeg);
}

void print_nothing(j_common_ptr) {}

void count_scans(j_common_ptr jpeg) {
  auto* decoder = static_cast<Decoder*>(jpeg->client_data);
  if (decoder->jpeg.input_scan_number <= kMaxScans) return;
  std::snprintf(decoder->message, sizeof decoder->message, "it has more than %d scans", kMaxScans);
  fail(jpeg);
}

void begin_source(j_decompress_ptr) {}
void end_source(j_decompress_ptr) {}

boolean fail_at_end(j_decompress_ptr jpeg) {
  auto* decoder = static_cast<Decoder*>(jpeg->client_data);
  std::snprintf(decoder->message, sizeof decoder->message, "the file ends too early");
  fail(reinterpret_cast<j_common_ptr>(jpeg));
}

void skip_bytes(j_decompress_ptr jpeg, long count) {
  if (count <= 0) return;
  if (static_cast<std::size_t>(count) > jpeg->src->bytes_in_buffer) fail_at_end(jpeg);
  jpeg->src->next_input_byte += count;
  jpeg->src->bytes_in_buffer -= static_cast<std::size_t>(count);
}

bool read_header(Decoder& decoder, std::string_view bytes) {
  if (setjmp(decoder.on_error)) return false;
  jpeg_create_decompress(&decoder.jpeg);
  decoder.source = {.next_input_byte = reinterpret_cast<const JOCTET*>(bytes.data()),
                    .bytes_in_buffer = bytes.size(),
                    .init_source = begin_source,
                    .fill_input_buffer = fail_at_end,
                    .skip_input_data = skip_bytes,
                    .resync_to_restart = jpeg_resync_to_restart,
                    .term_source = end_source};
  decoder.progress.progress_monitor = count_scans;
  decoder.jpeg.src = &decoder.source;
  decoder.jpeg.progress = &decoder.progress;
  jpeg_read_header(&decoder.jpeg, TRUE);
  return true;
}

/// The decoder with the file's header read.
void open(Decoder& decoder, std::string_view bytes, const std::filesystem::path& file) {
  if (!starts_like_jpeg(bytes)) refuse_image(file, "it does not start like a JPEG");
  decoder.jpeg.err = jpeg_std_error(&decoder.errors);
  decoder.errors.error_exit = fail;
  decoder.errors.emit_message = fail_at_warning;
  decoder.errors.output_message = print_nothing;
  decoder.jpeg.client_data = &decoder;
  if (!read_header(decoder, bytes)) refuse_image(file, decoder.message);
}

bool read_rows(Decoder& decoder, Image& pixels) {
  if (setjmp(decoder.on_error)) return false;
  jpeg_start_decompress(&decoder.jpeg);
  while (decoder.jpeg.output_scanline < decoder.jpeg.output_height) {
    JSAMPROW row = pixels.row(static_cast<int>(decoder.jpeg.output_scanline));
    jpeg_read_scanlines(&decoder.jpeg, &row, 1);
  }
  jpeg_finish_decompress(&decoder.jpeg);
  return true;
}

}  // namespace

bool starts_like_jpeg(std::string_view bytes) { return bytes.starts_with(kStart); }

Size parse_jpeg_size(std::string_view bytes, const std::filesystem::path& file) {
  Decoder decoder;
  open(decoder, bytes, file);
  return checked_image_size(decoder.jpeg.image_width, decoder.jpeg.image_height, file);
}

Image decode_jpeg(std::string_view bytes, const std::filesystem::path& file) {
  Decoder decoder;
  open(decoder, bytes, file);
  const Size size = checked_image_size(decoder.jpeg.image_width, decoder.jpeg.image_height, file);
  const bool grey = decoder.jpeg.jpeg_color_space == JCS_GRAYSCALE;
  if (!grey && decoder.jpeg.num_components != 3) {
    throw InvalidArgument(file.string() + ": its pixels are neither grey nor RGB but have " +
                          std::to_string(decoder.jpeg.num_components) +
                          " components, like CMYK; save it as grey or RGB");
  }
  decoder.jpeg.out_color_space = grey ? JCS_GRAYSCALE : JCS_RGB;
  const ImageType type = grey ? kU8 : kBgr8;
  check_decoded_bytes(size, type, bytes.size(), file);
  Image pixels(size, type);
  if (!read_rows(decoder, pixels)) refuse_image(file, decoder.message);
  return pixels;
}

}  // namespace egosgm::vision
