// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/ocl/context.h"

namespace egosgm::bench {

/// Bytes read and written a second [GB/s] by a kernel that copies 256 MB from one buffer to another: what a pass over
/// memory can reach on this device. The best of nine.
double copy_gb_s(ocl::Context& context);

/// What a device reaches at most, each by a small kernel that does nothing else, by the device's clock. The best of
/// some rounds.
struct Roofs {
  double copy_gb_s = 0;
  double min_add_g_s = 0;   // additions and minima of 16 bits, 10^9 a second
  double popcount_g_s = 0;  // counts of the bits of 32, 10^9 a second
  double launch_us = 0;     // a kernel that does nothing
  double enqueue_us = 0;    // one of many of these, each with an event, by the host's clock
  // Of work-groups, on GPUs; else 0.
  double local_gb_s = 0;  // local memory read and written
  double barrier_ns = 0;
};

Roofs roofs_of(ocl::Context& context);

}  // namespace egosgm::bench
