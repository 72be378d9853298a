// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "egosgm/export.h"

namespace egosgm::vision {

/// Whether each file name is of the frame after the one before it: only the last number in them differs, by no more
/// than one and a half times the median of such differences (a larger one is a gap). Thread-safe.
EGOSGM_EXPORT std::vector<bool> find_successors(const std::vector<std::string>& names);

}  // namespace egosgm::vision
