// SPDX-License-Identifier: Apache-2.0
// Two frames of shifted noise: odometry finds that the camera stands, and the maps have the disparity of the shift.
#include <egosgm/error.h>
#include <egosgm/named_options.h>
#include <egosgm/odometry.h>
#include <egosgm/pipeline.h>

#include <cstdio>
#include <vector>

// Else -march=native would move what lies behind a motion.
static_assert(alignof(egosgm::Motion) == alignof(double));

int main() try {
  constexpr int kWidth = 320, kHeight = 160, kShift_px = 5;
  std::vector<std::uint8_t> left(kWidth * kHeight), right(left.size());
  unsigned state = 1;
  for (auto& pixel : left) pixel = static_cast<std::uint8_t>((state = 1664525u * state + 1013904223u) >> 24);
  for (std::size_t i = 0; i + kShift_px < left.size(); ++i) right[i] = left[i + kShift_px];
  egosgm::PipelineOptions options;
  egosgm::set_option(options, "disparities", "16");
  const egosgm::Calibration calibration{300, 300, 160, 80, 0.5};
  egosgm::Pipeline pipeline(calibration, kWidth, kHeight, options);
  egosgm::StereoOdometry odometry(calibration);
  std::vector<float> disparity(left.size());
  egosgm::FrameOutputs outputs;
  outputs.disparity = {disparity.data(), kWidth, kHeight, kWidth * sizeof(float)};
  const egosgm::ImageView left_view{left.data(), kWidth, kHeight, kWidth},
      right_view{right.data(), kWidth, kHeight, kWidth};
  bool stands = false;
  for (int k = 0; k < 2; ++k) {
    const egosgm::OdometryResult moved = odometry.process(left_view, right_view);
    pipeline.process(left_view, right_view, moved.motion, outputs);
    stands = moved.standstill;
  }
  const float found = disparity[kHeight / 2 * kWidth + kWidth / 2];
  try {
    egosgm::Device::select("no such device");
  } catch (const egosgm::Error&) {  // an exception crosses the library's edge with its type
    std::printf("disparity %.2f, %s\n", found, stands ? "the camera stands" : "no standstill");
    return stands && found > kShift_px - 0.5 && found < kShift_px + 0.5 ? 0 : 1;
  }
  return 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
