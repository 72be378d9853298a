// SPDX-License-Identifier: Apache-2.0
// minimal SEQUENCE: writes 000000.png, ... (KITTI's disparity format) for a folder in a layout of KITTI's or
// Middlebury's.
#include <egosgm/odometry.h>
#include <egosgm/pipeline.h>
#include <egosgm/vision/dataset.h>
#include <egosgm/vision/disparity_io.h>
#include <egosgm/vision/frame_maps.h>

#include <cstdio>

using namespace egosgm;

int main(int argc, char** argv) try {
  const vision::StereoSequence sequence = vision::open_folder(argc > 1 ? argv[1] : ".");
  const vision::Size size = vision::check_image_sizes(sequence);
  Pipeline pipeline(sequence.calibration, size.width, size.height);
  StereoOdometry odometry(sequence.calibration);
  for (const vision::StereoFrame& frame : sequence.frames) {
    const auto [left, right] = vision::read_images(frame);
    const auto motion = odometry.process(vision::image_view(left), vision::image_view(right)).motion;
    const vision::FrameMaps maps = vision::process(pipeline, left, right, motion);
    vision::write_disparity(frame.name + ".png", maps.disparity);
  }
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
