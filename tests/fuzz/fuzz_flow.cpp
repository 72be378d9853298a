// SPDX-License-Identifier: Apache-2.0
// Optical flow: KITTI's PNG and .flo.
#include "host/vision/flow_io.h"
#include "tests/fuzz/png_seed.h"
#include "tests/fuzz/target.h"

namespace egosgm::fuzz {

std::vector<std::string> seeds() {
  return {png_seed(CV_16UC3), std::string("PIEH\x02\0\0\0\x01\0\0\0", 12) + std::string(16, '\x3f')};
}

void run(std::string_view input) {
  read_png_bytes(input, [](const std::filesystem::path& file) { vision::read_flow(file); });
}

}  // namespace egosgm::fuzz
