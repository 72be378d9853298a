// SPDX-License-Identifier: Apache-2.0
// Disparity maps: KITTI's PNG and PFM of both byte orders.
#include "egosgm/vision/disparity_io.h"
#include "tests/fuzz/png_seed.h"
#include "tests/fuzz/target.h"

namespace egosgm::fuzz {

std::vector<std::string> seeds() {
  return {png_seed(CV_16UC1), "Pf\n3 2\n-1.0\n" + std::string(24, '\x3f'), "Pf\n3 2\n1.0\n" + std::string(24, '\x3f')};
}

void run(std::string_view input) {
  read_png_bytes(input, [](const std::filesystem::path& file) { vision::read_disparity(file); });
}

}  // namespace egosgm::fuzz
