// SPDX-License-Identifier: Apache-2.0
#include <egosgm/error.h>
#include <egosgm/vision/disparity_io.h>
#include <egosgm/vision/frame_maps.h>
#include <egosgm/vision/moving_objects.h>
#include <egosgm/vision/odometry.h>
#include <egosgm/vision/synthetic.h>

#include <cstdio>

static_assert(alignof(egosgm::vision::MovingObject) == alignof(double));
static_assert(alignof(egosgm::vision::SyntheticObject) == alignof(double));

int main() try {
  egosgm::vision::SyntheticOptions options;
  options.frames = options.supersampling = 1;
  options.width = 64;
  options.height = 32;
  egosgm::vision::SyntheticSequence street(options);
  egosgm::vision::StereoOdometry odometry(street.calibration());
  const egosgm::vision::SyntheticFrame frame = street.render(0);
  egosgm::Pipeline pipeline(street.calibration(), 64, 32);
  const auto maps = egosgm::vision::process(pipeline, frame.left, frame.right, {});
  if (maps.report.density <= 0) return 1;
  egosgm::vision::write_disparity("street.pfm", maps.disparity);
  egosgm::vision::read_disparity("no such file.png");
  return 1;
} catch (const egosgm::InvalidArgument& error) {
  std::printf("%s\n", error.what());
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
