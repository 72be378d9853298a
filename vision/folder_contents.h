// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>

#include "egosgm/export.h"

namespace egosgm::vision {

/// The contents of a folder that is no stereo sequence, and what to give in its place: "it holds sequences/00: give
/// one of them". Nothing where nothing is known. Thread-safe.
std::optional<std::string> found_instead(const std::filesystem::path& folder);

/// A folder with one folder of images for each camera, or with one for each pair, or the pairs themselves; beside them
/// their calibration, calib.txt or calibration.txt in any case.
struct TwoCameras {
  std::string left, right;            // their patterns
  std::filesystem::path calibration;  // empty where there is none
};

/// left and right, cam0 and cam1, L and R, or others with left and right in their names in `folder`; nothing where they
/// are not both there.
/// Files that say so in their names too (left_1.png, 1_left.png) are paired by the rest of them. Else left.png and
/// right.png, or others with left and right in their names, in `folder`, where numbers tell the pairs apart, or one
/// pair in each folder in it. Thread-safe.
EGOSGM_EXPORT std::optional<TwoCameras> find_two_cameras(const std::filesystem::path& folder);

/// The only file beside the images that may be their calibration, of another name or format than calib.txt; empty where
/// there is none, or more than one; of one for each camera the left one.
std::filesystem::path foreign_calibration(const std::filesystem::path& folder, const TwoCameras& cameras);

/// Scenes of a multi-view folder of images: NNNNNN of NNNNNN_FF.png. Throws InvalidArgument where it cannot be listed.
std::set<std::string> list_scenes(const std::filesystem::path& images);

}  // namespace egosgm::vision
