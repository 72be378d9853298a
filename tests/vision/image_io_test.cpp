// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/image_io.h"

#include <gtest/gtest.h>
#include <png.h>

#include <cstdio>
// libjpeg's header needs the line above.
#include <jpeglib.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "egosgm/vision/opencv.h"
#include "tests/fuzz/png_seed.h"
#include "tests/support/expect_refused.h"
#include "tests/support/files.h"
#include "vision/file_io.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

cv::Mat random_image(std::mt19937& random, int width, int height, int type) {
  cv::Mat image(height, width, type);
  for (int y = 0; y < height; ++y) {
    auto* row = image.ptr<std::uint8_t>(y);
    for (std::size_t i = 0; i < image.cols * image.elemSize(); ++i) row[i] = static_cast<std::uint8_t>(random());
  }
  return image;
}

void write_png(const std::filesystem::path& file, const cv::Mat& image) { vision::write_png(file, image_of(image)); }

void expect_equal(const cv::Mat& a, const cv::Mat& b) {
  ASSERT_EQ(a.size(), b.size());
  ASSERT_EQ(a.type(), b.type());
  EXPECT_EQ(cv::norm(a, b, cv::NORM_INF), 0.0);
}

void expect_equal(const Image& found, const cv::Mat& expected) { expect_equal(mat_of(found), expected); }

struct PngForm {
  int color_type = PNG_COLOR_TYPE_GRAY, interlace = PNG_INTERLACE_NONE, filters = PNG_ALL_FILTERS;
  std::size_t chunk_bytes = 8192;
};

/// OpenCV writes neither palettes nor interlaced files, and chooses the filters itself. `write_rows`: by libpng.
template <typename WriteRows>
void write_with_libpng(const std::filesystem::path& file, Size size, int bits, const PngForm& form,
                       WriteRows&& write_rows) {
  std::FILE* stream = std::fopen(file.c_str(), "wb");
  ASSERT_NE(stream, nullptr);
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, stream);
  png_set_filter(png, 0, form.filters);
  png_set_compression_level(png, 9);
  png_set_compression_buffer_size(png, form.chunk_bytes);
  png_set_IHDR(png, info, static_cast<png_uint_32>(size.width), static_cast<png_uint_32>(size.height), bits,
               form.color_type, form.interlace, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_color palette[256];
  for (int i = 0; i < 256; ++i) palette[i] = {static_cast<png_byte>(i), static_cast<png_byte>(255 - i), 7};
  if (form.color_type == PNG_COLOR_TYPE_PALETTE) png_set_PLTE(png, info, palette, 1 << bits);
  png_write_info(png, info);
  write_rows(png, info);
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  std::fclose(stream);
}

void write_with_libpng(const std::filesystem::path& file, const cv::Mat& image, const PngForm& form) {
  const int bits = static_cast<int>(8 * image.elemSize1());
  write_with_libpng(file, {image.cols, image.rows}, bits, form, [&](png_structp png, png_infop) {
    if (image.depth() == CV_16U) png_set_swap(png);
    if (image.channels() == 3) png_set_bgr(png);
    std::vector<png_bytep> rows;
    for (int y = 0; y < image.rows; ++y) rows.push_back(const_cast<png_bytep>(image.ptr(y)));
    png_write_image(png, rows.data());
  });
}

class ImageIo : public ::testing::Test {
 protected:
  void expect_unreadable(std::vector<std::string> named) const {
    named.push_back(file_.string());
    expect_refused([&] { read_grey_image(file_); }, named);
  }
  /// Without a word on the standard error.
  void expect_truncations_unreadable(const std::string& whole) const {
    ::testing::internal::CaptureStderr();
    for (std::size_t bytes = 0; bytes < whole.size(); ++bytes) {
      write_file(file_, whole.substr(0, bytes));
      expect_unreadable({"not a readable image (truncated?)"});
    }
    EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  }

  const TemporaryFolder folder_;
  const std::filesystem::path file_ = folder_ / "image.png";  // JPEGs are known by what they hold
};

TEST_F(ImageIo, GreyImagesKeepEveryBit) {
  std::mt19937 random(1);
  for (int type : {CV_8UC1, CV_16UC1}) {
    for (const auto& [width, height] : {std::pair{1, 1}, {7, 5}, {65, 3}, {127, 33}}) {
      const cv::Mat image = random_image(random, width, height, type);
      write_png(file_, image);
      expect_equal(read_grey_image(file_), image);
      expect_equal(cv::imread(file_.string(), cv::IMREAD_UNCHANGED), image);
      EXPECT_EQ(read_image_size(file_), (Size{width, height}));
    }
  }
}

TEST_F(ImageIo, ColorIsReadAsItIs) {
  std::mt19937 random(3);
  const cv::Mat image = random_image(random, 33, 7, CV_8UC3);
  write_png(file_, image);
  expect_equal(read_color_image(file_), image);
  cv::Mat deep = random_image(random, 33, 7, CV_16UC3);
  write_png(file_, deep);
  expect_equal(cv::imread(file_.string(), cv::IMREAD_UNCHANGED), deep);
  for (const int lower_byte : {0, 255}) {
    image.convertTo(deep, CV_16U, 256, lower_byte);
    ASSERT_TRUE(cv::imwrite((folder_ / "deep.png").string(), deep));
    expect_equal(read_color_image(folder_ / "deep.png"), image);
  }
  image.convertTo(deep, CV_16U, 16, 15);  // of a camera with 12 bits
  write_png(folder_ / "deep.png", deep);
  expect_equal(read_color_image(folder_ / "deep.png"), image);
  write_png(folder_ / "grey.png", cv::Mat(3, 4, CV_8UC1, cv::Scalar(7)));
  expect_equal(read_color_image(folder_ / "grey.png"), cv::Mat(3, 4, CV_8UC3, cv::Scalar::all(7)));
}

TEST_F(ImageIo, ColorBecomesGreyAsInOpenCv) {
  std::mt19937 random(2);
  for (int depth : {CV_8U, CV_16U}) {
    for (int channels : {3, 4}) {
      const cv::Mat image = random_image(random, 31, 17, CV_MAKETYPE(depth, channels));
      ASSERT_TRUE(cv::imwrite(file_.string(), image));
      cv::Mat expected;
      cv::cvtColor(image, expected, channels == 3 ? cv::COLOR_BGR2GRAY : cv::COLOR_BGRA2GRAY);
      expect_equal(read_grey_image(file_), expected);
    }
  }
}

TEST_F(ImageIo, InterlacedAndPaletteAndBilevelFilesAreRead) {
  std::mt19937 random(3);
  const cv::Mat image = random_image(random, 29, 19, CV_8UC1);
  write_with_libpng(folder_ / "interlaced.png", image, {.interlace = PNG_INTERLACE_ADAM7});
  expect_equal(read_grey_image(folder_ / "interlaced.png"), image);

  write_with_libpng(folder_ / "palette.png", image, {.color_type = PNG_COLOR_TYPE_PALETTE});
  cv::Mat expected;
  cv::cvtColor(cv::imread((folder_ / "palette.png").string(), cv::IMREAD_COLOR), expected, cv::COLOR_BGR2GRAY);
  expect_equal(read_grey_image(folder_ / "palette.png"), expected);

  const cv::Mat bilevel = image > 128;
  ASSERT_TRUE(cv::imwrite((folder_ / "bilevel.png").string(), bilevel, {cv::IMWRITE_PNG_BILEVEL, 1}));
  expect_equal(read_grey_image(folder_ / "bilevel.png"), bilevel);
}

TEST_F(ImageIo, PlainFilesOfEveryFilterAreReadAsTheyAre) {
  std::mt19937 random(6);
  for (int type : {CV_8UC1, CV_16UC1, CV_8UC3}) {
    const int color_type = type == CV_8UC3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY;
    for (int filters : {PNG_FILTER_NONE, PNG_FILTER_SUB, PNG_FILTER_UP, PNG_FILTER_AVG, PNG_FILTER_PAETH}) {
      for (const auto& [width, height] : {std::pair{1, 1}, {7, 5}, {65, 3}, {127, 33}}) {
        const cv::Mat image = random_image(random, width, height, type);
        write_with_libpng(file_, image, {.color_type = color_type, .filters = filters, .chunk_bytes = 100});
        expect_equal(read_stored_image(file_), image);
      }
    }
  }
}

TEST_F(ImageIo, EveryTruncationIsRefusedInSilence) {
  std::mt19937 random(4);
  write_png(file_, random_image(random, 23, 11, CV_8UC1));
  expect_truncations_unreadable(read_file(file_, 1 << 20));
}

TEST_F(ImageIo, EveryDamagedByteIsRefused) {
  std::mt19937 random(5);
  write_png(file_, random_image(random, 23, 11, CV_16UC1));
  const std::string whole = read_file(file_, 1 << 20);
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ 4);
    write_file(file_, bytes);
    expect_unreadable({});
  }
}

std::string with_header_size(std::string png, std::uint32_t width, std::uint32_t height) {
  for (std::size_t i = 0; i < 4; ++i) {
    png[16 + i] = static_cast<char>(width >> (24 - 8 * i));
    png[20 + i] = static_cast<char>(height >> (24 - 8 * i));
  }
  return fuzz::with_checksums(png);
}

TEST_F(ImageIo, HugeSizesAreRefusedFromTheHeader) {
  write_png(file_, cv::Mat(2, 2, CV_8UC1, cv::Scalar(0)));
  const std::string small = read_file(file_, 1000);
  ASSERT_LT(small.size(), 100u);
  for (const auto& [width, height] : {std::pair{16385u, 1u}, {1u, 16385u}, {0x7fffffffu, 0x7fffffffu}}) {
    write_file(file_, with_header_size(small, width, height));
    expect_unreadable({"larger than the limit"});
    expect_refused([&] { read_image_size(file_); }, {file_.string(), "larger than the limit"});
  }
  // Within the limits, but no 100 bytes hold so many pixels.
  write_file(file_, with_header_size(small, 16384, 16384));
  expect_unreadable({"too short for 16384x16384"});
  write_with_libpng(file_, cv::Mat(2, 2, CV_8UC1, cv::Scalar(0)), {.interlace = PNG_INTERLACE_ADAM7});
  write_file(file_, with_header_size(read_file(file_, 1000), 16384, 16384));
  expect_unreadable({"too short for 16384x16384"});
  write_file(file_, with_header_size(small, 0, 5));
  expect_unreadable({"zero"});
}

// What is compressed may hold fewer pixels than the header says, or more, which libpng overlooks.
TEST_F(ImageIo, PixelsAreAsManyAsTheHeaderSays) {
  const cv::Mat image = (cv::Mat_<std::uint8_t>(3, 2) << 1, 2, 3, 4, 5, 6);
  write_png(file_, image);
  const std::string whole = read_file(file_, 1000);
  write_file(file_, with_header_size(whole, 2, 4));
  expect_unreadable({"not a readable image (truncated?)"});
  write_file(file_, with_header_size(whole, 2, 2));
  expect_equal(read_grey_image(file_), image.rowRange(0, 2));
}

TEST_F(ImageIo, NonImagesAreRefused) {
  for (const std::string text : {"", "hello", "\xff\xd8\xff\xe0 JFIF", "\xff\xd8\xff"}) {
    write_file(file_, text);
    expect_unreadable({"not a readable image"});
  }
  expect_refused([&] { read_grey_image(folder_ / "none.png"); }, {"none.png", "No such file"});
  expect_refused([&] { vision::write_png(file_, Image()); }, {file_.string()});
  expect_refused([&] { write_png(file_, cv::Mat(1, 1, CV_32FC1)); }, {file_.string()});
}

TEST_F(ImageIo, WhatIsGivenInPlaceOfAnImageIsNamed) {
  const std::pair<std::string, std::string> kinds[] = {
      {"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "git lfs pull"},
      {std::string("\0\0\0\x18", 4) + "ftypmp42", "is a video, which `egosgm run`, `doctor` and `rectify` read"},
      {"RIFF0000AVI LIST", "is a video"},
      {std::string("II*\0", 4) + "12345678", "is a TIFF"},
      {"P5\n2 2\n255\n1234", "is a PGM"},
      {"<!DOCTYPE html>", "is a web page"}};
  for (const auto& [content, named] : kinds) {
    write_file(file_, content);
    expect_unreadable({named});
    expect_refused([&] { read_image_size(file_); }, {file_.string(), named});
  }
}

TEST_F(ImageIo, SixteenBitsMayHoldEight) {
  const cv::Mat grey = (cv::Mat_<std::uint16_t>(1, 2) << 7, 255);
  EXPECT_TRUE(holds_8_bits_in_16(image_of(grey)));
  EXPECT_FALSE(holds_8_bits_in_16(image_of(grey + 1)));
  EXPECT_FALSE(holds_8_bits_in_16(Image(1, 2, kU8, 9)));
}

std::string jpeg_of(const cv::Mat& image, const std::vector<int>& parameters = {}) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", image, bytes, parameters);
  return {bytes.begin(), bytes.end()};
}

/// With enough structure for all coefficients to matter.
cv::Mat smooth_image(int width, int height, int type) {
  std::mt19937 random(6);
  cv::Mat image = random_image(random, width, height, type);
  cv::GaussianBlur(image, image, {5, 5}, 1.5);
  return image;
}

TEST_F(ImageIo, JpegIsReadAsPngIsWhateverItsName) {
  for (const auto& [width, height] : {std::pair{1, 1}, {8, 8}, {65, 33}, {127, 40}}) {
    for (const int type : {CV_8UC1, CV_8UC3}) {
      for (const int progressive : {0, 1}) {
        write_file(file_, jpeg_of(smooth_image(width, height, type), {cv::IMWRITE_JPEG_PROGRESSIVE, progressive}));
        cv::Mat expected = cv::imread(file_.string(), type == CV_8UC1 ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR), grey;
        if (type == CV_8UC3) {
          expect_equal(read_color_image(file_), expected);
          cv::cvtColor(expected, expected, cv::COLOR_BGR2GRAY);
        }
        expect_equal(read_grey_image(file_), expected);
        EXPECT_EQ(read_image_size(file_), (Size{width, height}));
      }
    }
  }
}

TEST_F(ImageIo, AJpegsSizeMayStandBehindALongComment) {
  std::string bytes = jpeg_of(smooth_image(30, 20, CV_8UC1));
  const std::string comment = "\xff\xfe\xff\xff" + std::string(65533, 'x');
  for (int i = 0; i < 3; ++i) bytes.insert(2, comment);
  write_file(file_, bytes);
  EXPECT_EQ(read_image_size(file_), (Size{30, 20}));
  EXPECT_EQ(read_grey_image(file_).size(), (Size{30, 20}));
}

TEST_F(ImageIo, EveryTruncationOfAJpegIsRefusedInSilence) {
  for (const int progressive : {0, 1}) {
    expect_truncations_unreadable(jpeg_of(smooth_image(17, 9, CV_8UC3), {cv::IMWRITE_JPEG_PROGRESSIVE, progressive}));
  }
}

TEST_F(ImageIo, ADamagedJpegIsRefusedInSilence) {
  std::string bytes = jpeg_of(smooth_image(64, 64, CV_8UC1));
  bytes.replace(bytes.size() - 200, 100, std::string(50, '\xff') + std::string(50, '\x01'));  // markers that are none
  write_file(file_, bytes);
  ::testing::internal::CaptureStderr();
  expect_unreadable({"not a readable image (truncated?)"});
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST_F(ImageIo, AJpegWithTheSizeOfALargerOneIsRefused) {
  const std::string bytes = jpeg_of(cv::Mat(8, 8, CV_8UC3, cv::Scalar::all(0)));
  const std::size_t frame = bytes.find("\xff\xc0");
  ASSERT_NE(frame, std::string::npos);
  const auto with_size = [&](const std::string& height, const std::string& width) {
    return std::string(bytes).replace(frame + 5, 4, height + width);
  };
  write_file(file_, with_size("\xf0\xf0", "\xf0\xf0"));
  expect_refused([&] { read_image_size(file_); }, {file_.string(), "61680x61680", "larger than the limit"});
  expect_unreadable({"61680x61680", "larger than the limit"});
  write_file(file_, with_size("\x40" + std::string(1, '\0'), "\x40" + std::string(1, '\0')));
  expect_unreadable({"too short for 16384x16384"});
}

/// Written by libjpeg itself, as `colors` says, by these scans if there are any.
void write_jpeg(const std::filesystem::path& file, const cv::Mat& image, J_COLOR_SPACE colors,
                const std::vector<jpeg_scan_info>& scans = {}) {
  std::FILE* stream = std::fopen(file.c_str(), "wb");
  ASSERT_NE(stream, nullptr);
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  jpeg_stdio_dest(&jpeg, stream);
  jpeg.image_width = static_cast<JDIMENSION>(image.cols);
  jpeg.image_height = static_cast<JDIMENSION>(image.rows);
  jpeg.input_components = image.channels();
  jpeg.in_color_space = colors;
  jpeg_set_defaults(&jpeg);
  if (!scans.empty()) {
    jpeg.scan_info = scans.data();
    jpeg.num_scans = static_cast<int>(scans.size());
  }
  jpeg_start_compress(&jpeg, TRUE);
  cv::Mat pixels = image.clone();
  for (int y = 0; y < pixels.rows; ++y) {
    JSAMPROW row = pixels.ptr(y);
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  std::fclose(stream);
}

/// A progressive file whose first `coefficients` coefficients come one by one, each in two scans.
void write_scans(const std::filesystem::path& file, int coefficients) {
  std::vector<jpeg_scan_info> scans = {{1, {0, 0, 0, 0}, 0, 0, 0, 0}};
  for (const int low : {1, 0}) {
    for (int i = 1; i <= coefficients; ++i) scans.push_back({1, {0, 0, 0, 0}, i, i, low ? 0 : 1, low});
  }
  write_jpeg(file, smooth_image(16, 16, CV_8UC1), JCS_GRAYSCALE, scans);
}

TEST_F(ImageIo, AJpegOfFourColoursIsRefusedForThat) {
  write_jpeg(file_, cv::Mat(8, 8, CV_8UC4, cv::Scalar::all(9)), JCS_CMYK);
  EXPECT_EQ(read_image_size(file_), (Size{8, 8}));
  expect_unreadable({"4 components, like CMYK", "save it as grey or RGB"});
}

TEST_F(ImageIo, AJpegOfManyScansIsRefused) {
  write_scans(file_, 40);
  EXPECT_EQ(read_grey_image(file_).size(), (Size{16, 16}));
  write_scans(file_, 63);
  expect_unreadable({"scans"});
}

/// A file of few bytes and many pixels: one colour, of `bits` bits.
void write_bomb(const std::filesystem::path& file, int side, int color_type, int bits) {
  const PngForm form{.color_type = color_type, .filters = PNG_FILTER_NONE};
  write_with_libpng(file, {side, side}, bits, form, [&](png_structp png, png_infop info) {
    const std::vector<png_byte> row(png_get_rowbytes(png, info));
    for (int y = 0; y < side; ++y) png_write_row(png, row.data());
  });
}

TEST_F(ImageIo, TheBoundHoldsForPixelsAsTheyAreWidened) {
  for (const int color_type : {PNG_COLOR_TYPE_PALETTE, PNG_COLOR_TYPE_GRAY}) {
    write_bomb(file_, 16384, color_type, 1);
    ASSERT_LT(std::filesystem::file_size(file_), 50'000u);
    expect_unreadable({"too short for 16384x16384"});
    write_bomb(file_, 2000, color_type, 1);  // a mask may be as empty as it likes
    EXPECT_EQ(read_grey_image(file_).size(), (Size{2000, 2000}));
  }
  write_bomb(file_, 6000, PNG_COLOR_TYPE_GRAY, 8);  // one grey, as deflate packs it best
  EXPECT_EQ(read_grey_image(file_).size(), (Size{6000, 6000}));
}

}  // namespace
}  // namespace egosgm::vision
