// SPDX-License-Identifier: Apache-2.0
// Calibrations: KITTI odometry's, KITTI raw's, Middlebury's and this project's own.
#include "egosgm/vision/calibration_io.h"
#include "tests/fuzz/memory_file.h"
#include "tests/fuzz/target.h"

namespace egosgm::fuzz {

std::vector<std::string> seeds() {
  const std::string p = ": 7.2e+02 0 6.0e+02 ", q = " 0 7.2e+02 1.7e+02 0 0 0 1 0\n";
  std::string odometry, raw = "calib_time: 09-Jan-2012 13:57:47\n";
  for (const auto& [camera, tx] : {std::pair{"0", "0"}, {"1", "-380"}, {"2", "45"}, {"3", "-340"}}) {
    odometry += std::string("P") + camera + p + tx + q;
    raw += std::string("P_rect_0") + camera + p + tx + q;
  }
  std::string many;
  for (int i = 0; i < 300; ++i) many += "k" + std::to_string(i) + ":\n";
  return {odometry,
          raw,
          "cam0=[99.4 0 94.1; 0 99.4 52.9; 0 0 1]\ncam1=[99.4 0 96.9; 0 99.4 52.9; 0 0 1]\ndoffs=2.8\nbaseline=193\n",
          "fx = 721.5\nfy = 721.5\ncx = 609.6\ncy = 172.9\nbaseline_m = 0.54\ndoffs_px = 0\n",
          many + odometry,
          "fx = " + std::string(3000, '7') + "\n"};
}

void run(std::string_view input) {
  const MemoryFile file(input);
  for (const vision::KittiCameras cameras : {vision::KittiCameras::kAny, vision::KittiCameras::kColor}) {
    vision::read_calibration(file.path(), cameras).validate();
  }
}

}  // namespace egosgm::fuzz
