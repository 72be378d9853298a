// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>

namespace egosgm::vision {

/// What a folder that is no stereo sequence holds instead, and what to give in its place: "it holds sequences/00: give
/// one of them". Nothing where nothing is known. Thread-safe.
std::optional<std::string> found_instead(const std::filesystem::path& folder);

/// Scenes of a multi-view folder of images: NNNNNN of NNNNNN_FF.png. Throws InvalidArgument where it cannot be listed.
std::set<std::string> list_scenes(const std::filesystem::path& images);

}  // namespace egosgm::vision
