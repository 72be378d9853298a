// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "egosgm/pipeline.h"
#include "host/method_options.h"
#include "tests/support/frame_memory.h"
#include "tests/support/scene.h"

namespace egosgm::testing {

/// Three frames of the scene, and what pipelines make of them.
class ShortVideo {
 public:
  static constexpr shared::ImageSize kSize{127, 61};
  static constexpr int kFrames = 3;

  explicit ShortVideo(PixelType type = PixelType::kU8) : scene_(kSize), type_(type) {
    for (int index = 0; index < kFrames; ++index) {
      const ScenePair pair = scene_.frame(index);
      for (int view = 0; view < 2; ++view) images_.emplace_back(kSize, pair.greys, view, type);
    }
  }

  static MethodOptions options() {
    MethodOptions options;
    options.disparities = 32;
    options.speckle_removal.max_size_px = 12;
    return options;
  }

  Pipeline pipeline(const Device& device, const MethodOptions& chosen = options()) const {
    return Pipeline(scene_.calibration(), kSize.width, kSize.height, chosen, device);
  }
  ImageView image(int index, int view) const { return images_[2 * index + view].view(); }
  PixelType type() const { return type_; }
  Motion motion(int index) const { return scene_.motion(index); }

  /// Of all frames, through a new pipeline.
  std::vector<OutputMemory> through(const Device& device, const MethodOptions& chosen = options()) const {
    Pipeline processing = pipeline(device, chosen);
    std::vector<OutputMemory> outputs;
    for (int index = 0; index < kFrames; ++index) {
      outputs.emplace_back(kSize);
      processing.process(image(index, EGOSGM_LEFT), image(index, EGOSGM_RIGHT), motion(index), outputs.back().views());
    }
    return outputs;
  }

 private:
  Scene scene_;
  PixelType type_;
  std::vector<ImageMemory> images_;
};

}  // namespace egosgm::testing
