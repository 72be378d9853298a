// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/pipeline.h"
#include "host/align/vertical_alignment.h"
#include "host/maps.h"

namespace egosgm {

/// All that survives a frame. A value: copies share the device's memory, so that going back to one is an assignment.
struct Belief {
  StereoMaps maps;
  VerticalOffset offset;
  Unpredicted missing = Unpredicted::kFirstFrame;  // why there are no maps; kNo: there are

  /// Of nothing.
  Belief(ocl::Context& context, shared::ImageSize size) : maps(context, size), offset(context) {}

  /// Forgets all.
  void forget(Unpredicted why) {
    missing = why;
    offset.is_known = false;
  }

  bool shares_memory_with(const Belief& other) const { return maps.disparity.get()() == other.maps.disparity.get()(); }
};

}  // namespace egosgm
