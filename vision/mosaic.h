// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/export.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// Whether a grey image is the mosaic of a colour sensor (Bayer), whose neighbouring pixels saw other colours: then the
/// columns of even and of odd numbers differ in brightness nearly everywhere. REQUIRES: kU8. Thread-safe.
EGOSGM_EXPORT bool holds_mosaic(const Image& grey);

/// Whether the two bytes of each pixel are exchanged: as they stand they are noise, and smooth the other way round.
/// False of images of 8 bits. REQUIRES: kU8 or kU16. Thread-safe.
EGOSGM_EXPORT bool holds_swapped_bytes(const Image& grey);

}  // namespace egosgm::vision
