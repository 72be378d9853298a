// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/frame_maps.h"

namespace egosgm::vision {

FrameMaps process(Pipeline& pipeline, const Image& left, const Image& right, const std::optional<Motion>& motion) {
  FrameMaps maps{Image(left.size(), kF32), Image(left.size(), kF32), {}};
  FrameOutputs outputs;
  outputs.disparity = map_view(maps.disparity);
  outputs.variance = map_view(maps.variance);
  maps.report = pipeline.process(image_view(left), image_view(right), motion, outputs);
  return maps;
}

}  // namespace egosgm::vision
