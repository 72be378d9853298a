// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "host/method_options.h"
#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// Codes of both views, of all pixels of an image.
struct ViewCodes {
  shared::ImageSize size;
  std::vector<std::uint64_t> of_view[2];
};

/// Of blocks of 4x4 pixels of both views, without gaps: evidence [1/16 bit], and what the coarse match found [px].
struct BlockEvidence {
  std::vector<int> evidence;
  std::vector<float> found;
};

/// Codes, those of what is alike, and disparities [coarse px]: of the images at a quarter of the resolution.
struct CoarseView {
  ViewCodes codes, alike;
  std::vector<float> disparity;
};
BlockEvidence block_evidence(float gate_px, const ViewCodes& codes, const std::optional<CoarseView>& coarse,
                             const testing::HostMaps& predicted, const testing::HostMaps& measured);

/// What KalmanUpdate is told of a frame.
struct FrameEvidence {
  std::vector<std::uint8_t> before;  // that moved with the prediction
  BlockEvidence blocks;
  bool repeats = false, sees_again = false;
  cl_int row_step = 1;
};

/// The evidence of a pixel after a frame [1/16 bit], whether it lives, and whether its measurement counts.
struct Verdict {
  int evidence;
  bool lives, counts;
};
Verdict judge(shared::ImageSize size, float gate_px, const FrameEvidence& frame, int view, int x, int y,
              float predicted, float measured);

/// The supporters of a pixel: how many there are, and to which sides, or whether the image ends there.
struct Supporters {
  int count;
  bool left, right, above, below;
  bool surround() const { return left && right && above && below; }
};

/// Of the 48 pixels 8, 16 and 24 px around one of the view that begins at `view`, those that differ from `d` by at most
/// `most`. Where the maps have evidence, those count that are confirmed.
Supporters supporters_of(shared::ImageSize size, const testing::HostMaps& maps, std::size_t view, int x, int y, float d,
                         float most);

/// What is published of a belief with its evidence: what has much, and what confirmed pixels around support. `by_left`:
/// a right pixel has the evidence of the left pixel that it sees, and must be confirmed itself.
std::vector<float> confirmed(shared::ImageSize size, const testing::HostMaps& belief, bool by_left);

}  // namespace egosgm::reference
