// SPDX-License-Identifier: Apache-2.0
// PNG: images of all kinds and their sizes.
#include <opencv2/imgcodecs.hpp>

#include "egosgm/vision/image_io.h"
#include "tests/fuzz/png_seed.h"
#include "tests/fuzz/target.h"

namespace egosgm::fuzz {

std::vector<std::string> seeds() {
  return {png_seed(CV_8UC1), png_seed(CV_8UC3), png_seed(CV_8UC4), png_seed(CV_16UC1)};
}

void run(std::string_view input) {
  read_png_bytes(input, [](const std::filesystem::path& file) {
    vision::read_image_size(file);
    vision::read_grey_image(file);
  });
}

}  // namespace egosgm::fuzz
