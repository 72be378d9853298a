// SPDX-License-Identifier: Apache-2.0
// own_poses SEQUENCE POSES: as minimal.cpp, but the camera's motion comes from elsewhere: here from a file of KITTI
// poses, as well from an IMU or a SLAM system. A frame without a pose gets no motion, and is searched in full.
#include <egosgm/pipeline.h>
#include <egosgm/vision/dataset.h>
#include <egosgm/vision/disparity_io.h>
#include <egosgm/vision/frame_maps.h>
#include <egosgm/vision/poses_io.h>

#include <cstdio>
#include <stdexcept>

using namespace egosgm;

void run(const char* folder, const char* poses_file) {
  const vision::StereoSequence sequence = vision::open_folder(folder);
  const auto world_from_camera = vision::poses_of_frames(sequence, poses_file);
  const vision::Size size = vision::check_image_sizes(sequence);
  Pipeline pipeline(sequence.calibration, size.width, size.height);
  for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
    std::optional<Motion> motion;
    if (i > 0) {
      motion.emplace();
      motion->current_from_previous = vision::current_from_previous(world_from_camera[i - 1], world_from_camera[i]);
    }
    const auto [left, right] = vision::read_images(sequence.frames[i]);
    const vision::FrameMaps maps = vision::process(pipeline, left, right, motion);
    vision::write_disparity(sequence.frames[i].name + ".png", maps.disparity);
  }
}

int main(int argc, char** argv) try {
  if (argc != 3) throw std::runtime_error("usage: own_poses SEQUENCE POSES");
  run(argv[1], argv[2]);
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
