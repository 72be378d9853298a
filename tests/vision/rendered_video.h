// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "egosgm/vision/synthetic.h"

namespace egosgm::vision {

/// A synthetic sequence with all its frames.
struct RenderedVideo {
  SyntheticSequence sequence;
  std::vector<SyntheticFrame> frames;

  explicit RenderedVideo(const SyntheticOptions& options) : sequence(options) {
    for (int k = 0; k < options.frames; ++k) frames.push_back(sequence.render(k));
  }
};

}  // namespace egosgm::vision
