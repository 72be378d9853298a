// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/vision/dataset.h"
#include "egosgm/vision/image.h"
#include "vision/frame_names.h"

namespace egosgm::vision {

struct ImagePairs {
  std::vector<std::pair<std::filesystem::path, std::filesystem::path>> pairs;  // left and right, in order
  std::vector<std::filesystem::path> alone;                                    // without one of the other camera
};

/// The files that belong together by open_patterns' rules, of any kind and size. Throws as it does, but for files
/// without a partner. Thread-safe.
EGOSGM_EXPORT ImagePairs find_pairs(const std::string& left, const std::string& right, PairBy pair_by = PairBy::kName);

/// The files that one pattern names, in order. Throws as open_patterns. Thread-safe.
EGOSGM_EXPORT std::vector<std::filesystem::path> find_images(const std::string& pattern);

/// The first left image that can be read, as it is stored; empty where there is none. Thread-safe.
EGOSGM_EXPORT Image first_readable_image(const std::vector<StereoFrame>& frames);

/// pair_files, where both patterns name one image or both many.
std::vector<NamedPair> pairs_of_patterns(const NamePattern& left, const NamePattern& right,
                                         const std::string& left_text, const std::string& right_text, PairBy pair_by);

}  // namespace egosgm::vision
