// SPDX-License-Identifier: Apache-2.0
#include <egosgm/error.h>
#include <egosgm/vision/disparity_io.h>
#include <egosgm/vision/odometry.h>
#include <egosgm/vision/synthetic.h>

#include <cstdio>

int main() try {
  egosgm::vision::SyntheticSequence street({.frames = 1, .width = 64, .height = 32, .supersampling = 1});
  egosgm::vision::StereoOdometry odometry(street.calibration());
  egosgm::vision::write_disparity("street.pfm", street.render(0).left_disparity);
  egosgm::vision::read_disparity("no such file.png");
  return 1;
} catch (const egosgm::InvalidArgument& error) {
  std::printf("%s\n", error.what());
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
