// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/poses_io.h"
#include "tests/fuzz/memory_file.h"
#include "tests/fuzz/target.h"

namespace egosgm::fuzz {

std::vector<std::string> seeds() {
  return {"1 0 0 0 0 1 0 0 0 0 1 0\n0.8 0 0.6 1.5 0 1 0 -2e-1 -0.6 0 0.8 12\n",
          std::string(3000, '\n') + "1 0 0 0 0 1 0 0 0 0 1 0\n"};
}

void run(std::string_view input) {
  const MemoryFile file(input);
  vision::read_poses(file.path());
}

}  // namespace egosgm::fuzz
