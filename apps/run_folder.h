// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "egosgm/vision/dataset.h"

namespace egosgm::app {

/// The frames of the run that wrote `path`, by its report.json: their numbers, names and left images, which need no
/// longer be there. `path` is OUT, or a file or folder in it. Nothing where no run is known. Throws InvalidArgument
/// where that report is no JSON.
std::optional<vision::StereoSequence> frames_of_run(const std::filesystem::path& path);

}  // namespace egosgm::app
