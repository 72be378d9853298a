// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/ocl/context.h"

namespace egosgm::bench {

/// Bytes read and written a second [GB/s] by a kernel that copies 256 MB from one buffer to another: what a pass over
/// memory can reach on this device. The best of nine.
double copy_gb_s(ocl::Context& context);

}  // namespace egosgm::bench
