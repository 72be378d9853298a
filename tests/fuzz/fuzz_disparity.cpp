// SPDX-License-Identifier: Apache-2.0
// Disparity maps: KITTI's PNG, PFM of both byte orders and .npy.
#include "egosgm/vision/disparity_io.h"
#include "tests/fuzz/png_seed.h"
#include "tests/fuzz/target.h"

namespace egosgm::fuzz {

std::vector<std::string> seeds() {
  const std::string npy = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }\n";
  const std::string npy_start("\x93NUMPY\x01\x00", 8);
  return {npy_start + static_cast<char>(npy.size()) + '\0' + npy + std::string(24, '\x3f'), png_seed(CV_16UC1),
          "Pf\n3 2\n-1.0\n" + std::string(24, '\x3f'), "Pf\n3 2\n1.0\n" + std::string(24, '\x3f')};
}

void run(std::string_view input) {
  read_png_bytes(input, [](const std::filesystem::path& file) { vision::read_disparity(file); });
}

}  // namespace egosgm::fuzz
