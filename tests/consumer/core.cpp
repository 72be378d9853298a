// SPDX-License-Identifier: Apache-2.0
// Shifted noise has the disparity that it was shifted by.
#include <egosgm/error.h>
#include <egosgm/named_options.h>
#include <egosgm/pipeline.h>

#include <cstdio>
#include <vector>

int main() try {
  constexpr int kWidth = 96, kHeight = 48, kShift_px = 5;
  std::vector<std::uint8_t> left(kWidth * kHeight), right(left.size());
  unsigned state = 1;
  for (auto& pixel : left) pixel = static_cast<std::uint8_t>((state = 1664525u * state + 1013904223u) >> 24);
  for (std::size_t i = 0; i + kShift_px < left.size(); ++i) right[i] = left[i + kShift_px];
  egosgm::PipelineOptions options;
  egosgm::set_option(options, "disparities", "16");
  egosgm::Pipeline pipeline({.fx = 100, .fy = 100, .cx = 48, .cy = 24, .baseline_m = 0.5}, kWidth, kHeight, options);
  std::vector<float> disparity(left.size());
  egosgm::FrameOutputs outputs;
  outputs.disparity = {disparity.data(), kWidth, kHeight, kWidth * sizeof(float)};
  pipeline.process({left.data(), kWidth, kHeight, kWidth}, {right.data(), kWidth, kHeight, kWidth}, {}, outputs);
  const float found = disparity[kHeight / 2 * kWidth + kWidth / 2];
  try {
    egosgm::Device::select("no such device");
  } catch (const egosgm::Error&) {  // an exception crosses the library's edge with its type
    std::printf("disparity %.2f\n", found);
    return found > kShift_px - 0.5 && found < kShift_px + 0.5 ? 0 : 1;
  }
  return 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
