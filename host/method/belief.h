// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "egosgm/pipeline.h"
#include "host/pair_hash.h"
#include "host/stages/dynamic_map.h"
#include "host/stages/maps.h"
#include "host/stages/vertical_alignment.h"

namespace egosgm {

/// All that survives a frame. A value: copies share the device's memory, so that going back to one is an assignment.
struct Belief {
  StereoMaps maps;
  FlagMap evidence;  // of each pixel (kernels/method.h); what has enough of it is published
  VerticalOffset offset;
  ocl::Buffer<cl_ushort> halved;   // the left image at half of the resolution (DynamicMap)
  bool has_halved = false;         // the frame's `dynamic` was wanted
  std::optional<PairHash> images;  // that it is of; none where the host does not know them
  Motion since;                    // of the camera, since its images: where they repeat, no motion counts yet
  std::optional<Unpredicted> why_not = Unpredicted::kFirstFrame;  // there are no maps

  /// Starts empty.
  Belief(ocl::Context& context, shared::ImageSize size)
      : maps(context, size),
        evidence(context, 2 * pixel_count(size)),
        offset(context),
        halved(context, pixel_count(DynamicMap::half(size))) {}

  /// Forgets all.
  void forget(Unpredicted why) {
    why_not = why;
    offset.is_known = false;
  }

  bool shares_memory_with(const Belief& other) const { return maps.disparity.get()() == other.maps.disparity.get()(); }
};

}  // namespace egosgm
