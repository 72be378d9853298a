// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/disparity_io.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "egosgm/vision/image_io.h"
#include "tests/support/expect_refused.h"
#include "tests/support/files.h"
#include "tests/vision/data_folder.h"
#include "tests/vision/images.h"
#include "vision/file_io.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

constexpr float kInf = std::numeric_limits<float>::infinity();

Image row_map(const std::vector<float>& values) { return map_from(1, values); }

void expect_equal(const Image& a, const Image& b) { EXPECT_EQ(largest_difference(a, b), 0); }

class DisparityIo : public ::testing::Test {
 protected:
  const TemporaryFolder folder_;
  const std::filesystem::path file_ = folder_ / "d.map";
};

TEST_F(DisparityIo, PngStoresAsTheDevelopmentKit) {
  const std::vector<float> values = {kInvalidDisparity, 0.0f,   0.001f, 1.0f / 256, 1.999f / 256, 1.0f,  100.5f,
                                     255.99f,           256.0f, -1.0f,  NAN,        kInf,         -kInf, 1e30f};
  const std::vector<int> stored = {0, 1, 1, 1, 1, 256, 25728, 65533, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(write_disparity_png(folder_ / "d.png", row_map(values)), 3);  // 256, -1, 1e30
  const Image png = read_stored_image(folder_ / "d.png");
  ASSERT_EQ(png.type, kU16);
  for (int x = 0; x < png.cols; ++x) EXPECT_EQ(png.at<std::uint16_t>(0, x), stored[static_cast<std::size_t>(x)]) << x;
  EXPECT_THROW(count_outside_png(png), InvalidArgument);
}

TEST_F(DisparityIo, FlowIsStoredIn64StepsAPixel) {
  const std::pair<std::pair<float, float>, std::vector<int>> cases[] = {
      {{0, 0}, {1, 32768, 32768}},      {{-1.5f, 2.25f}, {1, 32912, 32672}},
      {{-512, 511.98f}, {1, 65535, 0}}, {{NAN, 1}, {0, 0, 0}},
      {{1, kInf}, {0, 0, 0}},           {{512, 0}, {0, 0, 0}}};
  for (const auto& [uv, stored] : cases) {
    Image flow(1, 1, kFlow);
    flow.row<float>(0)[0] = uv.first, flow.row<float>(0)[1] = uv.second;
    write_flow_png(folder_ / "f.png", flow);
    const Image png = read_stored_image(folder_ / "f.png");
    ASSERT_EQ(png.type, kBgr16);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(png.row<std::uint16_t>(0)[i], stored[i]) << uv.first << ", " << i;
  }
  expect_refused([&] { write_flow_png(file_, Image(1, 1, kF32, 0)); }, {file_.string()});
}

TEST_F(DisparityIo, PngRoundTripIsExactOnItsGrid) {
  std::mt19937 random(1);
  std::uniform_int_distribution<int> value(0, 65535);
  Image map(33, 127, kF32);
  visit_values(map, [&](auto& d) {
    const int v = value(random);
    d = v < 1000 ? kInvalidDisparity : static_cast<float>(v) / 256.0f;
  });
  EXPECT_EQ(write_disparity(folder_ / "d.png", map), 0);
  expect_equal(read_disparity(folder_ / "d.png"), map);
}

TEST_F(DisparityIo, OtherPngsAreNoDisparity) {
  write_png(folder_ / "grey.png", Image(3, 3, kU8, 7));
  expect_refused([&] { read_disparity(folder_ / "grey.png"); }, {"grey.png", "16-bit grey", "8 bit"});
  write_png(folder_ / "colour.png", picture_of({3, 3}, {1, 2, 3}));
  expect_refused([&] { read_disparity(folder_ / "colour.png"); }, {"colour.png", "3 channel"});
}

TEST_F(DisparityIo, PfmRoundTripKeepsEveryBit) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> value(-500.0f, 2000.0f);
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 5}, {65, 3}}) {
    Image map(height, width, kF32);
    visit_values(map, [&](auto& d) { d = random() % 4 == 0 ? kInvalidDisparity : value(random); });
    EXPECT_EQ(write_disparity(folder_ / "d.PFM", map), 0);
    expect_equal(read_disparity(folder_ / "d.PFM"), map);
  }
}

TEST_F(DisparityIo, PfmIsBottomUpInBothByteOrders) {
  const std::string little("Pf\n1 3\n-0.5\n\x00\x00\x80\x3f\x00\x00\x00\x40\x00\x00\x80\x7f", 24);
  const std::string big("Pf 1 3 1\n\x3f\x80\x00\x00\x40\x00\x00\x00\x7f\xc0\x00\x00", 21);
  write_file(folder_ / "little.pfm", little);
  write_file(folder_ / "big.pfm", big);
  const Image expected = map_from(3, {kInvalidDisparity, 2.0f, 1.0f});
  expect_equal(read_pfm(folder_ / "little.pfm"), expected);
  expect_equal(read_pfm(folder_ / "big.pfm"), expected);
}

TEST_F(DisparityIo, WrittenPfmHoldsInfinityAndStartsAtTheBottom) {
  write_pfm(folder_ / "d.pfm", map_from(2, {kInvalidDisparity, 1.0f}));
  EXPECT_EQ(read_file(folder_ / "d.pfm", 100), std::string("Pf\n1 2\n-1.0\n\x00\x00\x80\x3f\x00\x00\x80\x7f", 20));
}

/// NumPy's header, padded as NumPy does, and the values.
std::string npy(const std::string& type, const std::string& order, const std::string& shape,
                const std::string& values) {
  std::string header = "{'descr': '" + type + "', 'fortran_order': " + order + ", 'shape': " + shape + ", }";
  header.resize((10 + header.size() + 64) / 64 * 64 - 10, ' ');
  header.back() = '\n';
  return std::string("\x93NUMPY\x01\x00", 8) + static_cast<char>(header.size() & 0xff) +
         static_cast<char>(header.size() >> 8) + header + values;
}

TEST_F(DisparityIo, NpyOfAnyOrderAndType) {
  const Image expected = map_from(2, {1, kInvalidDisparity, 3, 4, 5, 6});
  const std::string rows("\x01\x00\x00\x00\x03\x00\x04\x00\x05\x00\x06\x00", 12);
  const std::string columns("\x01\x04\x00\x05\x03\x06", 6);
  const std::string big("\x00\x01\x00\x00\x00\x03\x00\x04\x00\x05\x00\x06", 12);
  const std::string halves("\x00\x3c\x00\x7e\x00\x42\x00\x44\x00\x45\x00\x46", 12);  // the second is NaN
  std::string longs;  // NumPy's whole numbers, where nothing else is asked for
  for (const char value : {1, 0, 3, 4, 5, 6}) longs += std::string(1, value) + std::string(7, '\0');
  for (const std::string& bytes : {npy("<i8", "False", "(2, 3)", longs), npy("<u2", "False", "(2, 3)", rows),
                                   npy("|u1", "True", "(2, 3)", columns), npy(">i2", "False", "(2, 3)", big),
                                   npy("<f2", "False", "(1, 2, 3, 1)", halves)}) {
    write_file(file_, bytes);
    expect_equal(read_disparity(file_), expected);
  }
  std::string doubles(16, '\0');
  const double values[] = {-2, 7.25};
  std::memcpy(doubles.data(), values, 16);
  write_file(file_, npy("<f8", "False", "(1, 2)", doubles));
  expect_equal(read_disparity(file_), map_from(1, {kInvalidDisparity, 7.25f}));
  expect_equal(read_values(file_), map_from(1, {-2, 7.25f}));
}

TEST_F(DisparityIo, BrokenNpyIsRefused) {
  const std::string four(4, '\1');
  std::string ones;
  for (int i = 0; i < 65; ++i) ones += "1,";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {std::string("\x93NUMPY\x01\x00", 8), "header"},
      {npy("<f4", "False", "(1, 1)", four).substr(0, 40), "header"},
      {npy("<f4", "False", "(1, 1)", ""), "0 bytes of numbers instead of 4"},
      {npy("<f4", "False", "(1, 2)", four), "4 bytes of numbers instead of 8"},
      {npy("<c8", "False", "(1, 1)", four), "are '<c8', not floats"},
      {npy("|b1", "False", "(1, 1)", four), "are '|b1', not floats"},
      {npy("<c\n", "False", "(1, 1)", four), "not floats"},
      {npy("<f4", "False", "(1,)", four), "1 sides"},
      {npy("<f4", "False", "(2, 2, 2)", four), "3 sides"},
      {npy("<f4", "False", "(0, 2)", four), "not positive"},
      {npy("<f4", "False", "(-1, 2)", four), "not positive"},
      {npy("<f4", "False", "(99999, 1)", four), "larger than the limit"},
      {npy("<f4", "False", "[1, 1]", four), "no tuple"},
      {npy("<f4", "False", "(x, 1)", four), "whole numbers"},
      {npy("<f4", "False", "(99999999999999999999, 1)", four), "whole numbers"},
      {npy("<f4", "False", "(9223372036854775807, 9223372036854775807)", four), "larger than the limit"},
      {npy("<f4", "False", '(' + ones + ')', four), "more than 64 sides"},
  };
  for (const auto& [bytes, part] : cases) {
    write_file(file_, bytes);
    expect_refused([&] { read_disparity(file_); }, {file_.string(), part});
  }
}

TEST_F(DisparityIo, PngOfAnotherScale) {
  write_png(file_, image_from<std::uint16_t>(1, {0, 100, 250}));
  expect_equal(read_disparity(file_, 100), map_from(1, {kInvalidDisparity, 1, 2.5f}));
  expect_equal(read_values(file_), map_from(1, {0, 100, 250}));
  expect_refused([&] { read_disparity(file_, 0); }, {"0.000000", "positive"});
}

TEST_F(DisparityIo, BrokenPfmIsRefused) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "neither PNG nor PFM"},
      {"Pf", "header"},
      {"Pf\n2 2\n", "header"},
      {"Pf\n2 2\n-1", "header"},
      {"Pf22-1\n", "header"},
      {"PF\n1 1\n-1\n000011112222", "three channels"},
      {"Pf\n2 2\n-1\n0123", "4 bytes of pixels instead of 16"},
      {"Pf\n1 1\n-1\n01234567", "8 bytes of pixels instead of 4"},
      {"Pf\n0 2\n-1\n", "not positive"},
      {"Pf\n-2 2\n-1\n", "not positive"},
      {"Pf\n1 1\n0\n0123", "scale"},
      {"Pf\n1 1\nnan\n0123", "scale"},
      {"Pf\n16385 1\n-1\n", "larger than the limit"},
      {"Pf\n99999999999999999999 1\n-1\n", "header"},
      {"Pf\n4294967297 4294967297\n-1\n", "larger than the limit"},
      {"Pf\n16384 16384\n-1\n0123", "instead of 1073741824"},
  };
  for (const auto& [bytes, why] : cases) {
    write_file(file_, bytes);
    expect_refused([&] { read_disparity(file_); }, {file_.string(), why});
  }
}

TEST_F(DisparityIo, WrongTypesAndNamesAreRefused) {
  const Image map(2, 2, kF32, 1);
  expect_refused([&] { write_disparity(folder_ / "d.tiff", map); }, {"d.tiff", ".png or .pfm"});
  expect_refused([&] { write_disparity(folder_ / "d.png", Image(2, 2, kU16)); }, {"d.png", "float32"});
  expect_refused([&] { write_disparity(folder_ / "d.pfm", Image()); }, {"d.pfm", "float32"});
  expect_refused<IoError>([&] { write_disparity(folder_ / "none/d.png", map); }, {"none/d.png", "No such file"});
}

}  // namespace
}  // namespace egosgm::vision
