// SPDX-License-Identifier: Apache-2.0
// Truncated and mutated files: every reader gives a result or InvalidArgument, prints nothing and allocates in
// proportion.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "egosgm/error.h"
#include "egosgm/vision/calibration_io.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/file_io.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/poses_io.h"
#include "tests/vision/temporary_folder.h"

namespace egosgm::vision {
namespace {

constexpr int kInputs = 1000;

using Read = std::function<void(const std::filesystem::path&)>;

std::size_t below(std::mt19937& random, std::size_t end) { return end == 0 ? 0 : random() % end; }

/// One of: cut, flip a bit, set bytes, insert, erase, repeat a part; some of them several times.
std::string mutate(std::string bytes, std::mt19937& random) {
  static const std::vector<std::string> kTokens = {"nan",
                                                   "inf",
                                                   "-1",
                                                   "0",
                                                   "1e309",
                                                   "99999999999999999999",
                                                   "\n",
                                                   " ",
                                                   ":",
                                                   "=",
                                                   "[",
                                                   std::string("\0\0\0\0", 4),
                                                   "\xff\xff\xff\xff",
                                                   "\x7f\xff\xff\xff",
                                                   "Pf",
                                                   "P_rect_00:",
                                                   "cam0="};
  for (std::size_t round = 1 + below(random, 4); round > 0; --round) {
    const std::size_t at = below(random, bytes.size());
    const std::string& token = kTokens[below(random, kTokens.size())];
    switch (below(random, 7)) {
      case 0:
        bytes.resize(at);
        break;
      case 1:
        if (!bytes.empty()) bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(random, 8)));
        break;
      case 2:
        if (!bytes.empty()) bytes[at] = static_cast<char>(random());
        break;
      case 3:
        bytes.insert(at, token);
        break;
      case 4:
        bytes.erase(at, 1 + below(random, 16));
        break;
      case 5:
        bytes.insert(at, bytes.substr(below(random, bytes.size() + 1), 1 + below(random, 40)));
        break;
      default:
        bytes.replace(at, std::min(token.size(), bytes.size() - at), token);
    }
  }
  return bytes;
}

long peak_kib() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

void expect_result_or_refusal(const std::string& valid, const Read& read, unsigned seed) {
  const TemporaryFolder folder;
  std::mt19937 random(seed);
  int refused = 0;
  const long before_kib = peak_kib();
  ::testing::internal::CaptureStderr();
  for (int i = 0; i < kInputs; ++i) {
    const auto file = folder / std::to_string(i);  // a fresh name: replacing a file flushes it on some file systems
    write_file(file, mutate(valid, random));
    try {
      read(file);
    } catch (const InvalidArgument& error) {
      ++refused;
      const std::string line = error.what();
      EXPECT_NE(line.find(file.string()), std::string::npos) << line;
      EXPECT_EQ(line.find('\n'), std::string::npos) << line;
    } catch (const std::exception& error) {
      ADD_FAILURE() << "input " << i << " of seed " << seed << ": " << error.what();
    }
  }
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
  EXPECT_GT(refused, kInputs / 10);
  EXPECT_LT(peak_kib() - before_kib, 64 * 1024) << "KiB";
}

std::string encoded(const cv::Mat& image) {
  const TemporaryFolder folder;
  write_png(folder / "valid.png", image);
  return read_file(folder / "valid.png", 1 << 20);
}

cv::Mat ramp(int type) {
  cv::Mat image(9, 14, type);
  for (int y = 0; y < image.rows; ++y) {
    auto* row = image.ptr<std::uint8_t>(y);
    for (std::size_t i = 0; i < image.cols * image.elemSize(); ++i)
      row[i] = static_cast<std::uint8_t>(y * 31 + static_cast<int>(i) * 7);
  }
  return image;
}

TEST(ReadersRobustness, GreyPng) { expect_result_or_refusal(encoded(ramp(CV_8UC1)), read_grey_png, 1); }

TEST(ReadersRobustness, ColorPng) { expect_result_or_refusal(encoded(ramp(CV_8UC3)), read_grey_png, 2); }

TEST(ReadersRobustness, PngHeader) { expect_result_or_refusal(encoded(ramp(CV_8UC1)).substr(0, 40), read_png_size, 3); }

TEST(ReadersRobustness, DisparityPng) { expect_result_or_refusal(encoded(ramp(CV_16UC1)), read_disparity, 4); }

TEST(ReadersRobustness, DisparityPfm) {
  expect_result_or_refusal(std::string("Pf\n3 2\n-1.0\n") + std::string(24, '\x3f'), read_disparity, 5);
  expect_result_or_refusal(std::string("Pf\n3 2\n1.0\n") + std::string(24, '\x3f'), read_pfm, 6);
}

TEST(ReadersRobustness, Calibrations) {
  const Read read = [](const std::filesystem::path& file) {
    for (KittiCameras cameras : {KittiCameras::kAny, KittiCameras::kColor}) read_calibration(file, cameras).validate();
  };
  const std::string p = ": 7.2e+02 0 6.0e+02 ", q = " 0 7.2e+02 1.7e+02 0 0 0 1 0\n";
  std::string odometry, raw = "calib_time: 09-Jan-2012 13:57:47\n";
  for (const auto& [camera, tx] : {std::pair{"0", "0"}, {"1", "-380"}, {"2", "45"}, {"3", "-340"}}) {
    odometry += std::string("P") + camera + p + tx + q;
    raw += std::string("P_rect_0") + camera + p + tx + q;
  }
  expect_result_or_refusal(odometry, read, 7);
  expect_result_or_refusal(raw, read, 8);
  expect_result_or_refusal(
      "cam0=[99.4 0 94.1; 0 99.4 52.9; 0 0 1]\ncam1=[99.4 0 96.9; 0 99.4 52.9; 0 0 1]\ndoffs=2.8\nbaseline=193\n", read,
      9);
  expect_result_or_refusal("fx = 721.5\nfy = 721.5\ncx = 609.6\ncy = 172.9\nbaseline_m = 0.54\ndoffs_px = 0\n", read,
                           10);
}

TEST(ReadersRobustness, Poses) {
  expect_result_or_refusal("1 0 0 0 0 1 0 0 0 0 1 0\n0.8 0 0.6 1.5 0 1 0 -2e-1 -0.6 0 0.8 12\n", read_poses, 11);
}

}  // namespace
}  // namespace egosgm::vision
