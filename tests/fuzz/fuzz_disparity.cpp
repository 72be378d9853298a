// SPDX-License-Identifier: Apache-2.0
// Disparity maps: KITTI's PNG, PFM of both byte orders and .npy.
#include "egosgm/vision/disparity_io.h"
#include "tests/fuzz/png_seed.h"
#include "tests/fuzz/target.h"

namespace egosgm::fuzz {

namespace {

std::string npy_seed(const std::string& shape) {
  const std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': " + shape + ", }\n";
  return std::string("\x93NUMPY\x01\x00", 8) + static_cast<char>(header.size() & 0xff) +
         static_cast<char>(header.size() >> 8) + header + std::string(24, '\x3f');
}

}  // namespace

std::vector<std::string> seeds() {
  std::string ones;
  for (int i = 0; i < 1000; ++i) ones += "1,";
  return {png_seed(vision::kU16),
          "Pf\n3 2\n-1.0\n" + std::string(24, '\x3f'),
          "Pf\n3 2\n1.0\n" + std::string(24, '\x3f'),
          "Pf\n16384 16384\n-1.0\n",
          npy_seed("(2, 3)"),
          npy_seed("(16384, 16384)"),
          npy_seed('(' + ones + ')')};
}

void run(std::string_view input) {
  read_png_bytes(input, [](const std::filesystem::path& file) { vision::read_disparity(file); });
}

}  // namespace egosgm::fuzz
