// SPDX-License-Identifier: Apache-2.0
// PNG and JPEG: images of all kinds and their sizes.
#include <opencv2/imgcodecs.hpp>

#include "egosgm/vision/image_io.h"
#include "tests/fuzz/png_seed.h"
#include "tests/fuzz/target.h"

namespace egosgm::fuzz {

namespace {

std::string encoded(const char* extension, const cv::Mat& image, const std::vector<int>& parameters) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(extension, image, bytes, parameters);
  return {bytes.begin(), bytes.end()};
}

}  // namespace

std::vector<std::string> seeds() {
  const cv::Mat mask(1000, 2000, CV_8UC1, cv::Scalar(0)), color(11, 19, CV_8UC3, cv::Scalar(200, 30, 90)),
      four(9, 14, CV_8UC4, cv::Scalar(200, 30, 90, 7));
  return {png_seed(vision::kU8),
          png_seed(vision::kBgr8),
          encoded(".png", four, {}),
          png_seed(vision::kU16),
          encoded(".png", mask, {cv::IMWRITE_PNG_BILEVEL, 1}),  // few bytes, many pixels
          encoded(".jpg", color, {}),
          encoded(".jpg", color, {cv::IMWRITE_JPEG_PROGRESSIVE, 1})};
}

void run(std::string_view input) {
  read_png_bytes(input, [](const std::filesystem::path& file) {
    vision::read_image_size(file);
    vision::read_grey_image(file);
  });
}

}  // namespace egosgm::fuzz
