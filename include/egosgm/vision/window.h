// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "egosgm/export.h"

namespace egosgm::vision {

/// Whether there is a display to open a window on: DISPLAY or WAYLAND_DISPLAY is set. Throws InvalidArgument, naming
/// it, where `open_window` (cv::namedWindow, for example) does not succeed there. That is tried in a process of its
/// own, since windowing libraries end theirs where a display cannot be reached. REQUIRES: one thread in this process,
/// so call it before a Pipeline is made.
EGOSGM_EXPORT bool has_display(const std::function<void()>& open_window);

}  // namespace egosgm::vision
