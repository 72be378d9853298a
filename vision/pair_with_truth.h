// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/vision/dataset.h"

namespace egosgm::vision {

/// An estimate and the truth it is compared with.
struct EvaluationPair {
  std::filesystem::path estimate, truth;
  std::string name;       // the estimate's, without extension
  bool same_name = true;  // false: they belong together by the numbers in their names only; say so
};

struct EvaluationPairs {
  std::vector<EvaluationPair> pairs;                    // in the order of names, never empty
  std::vector<std::filesystem::path> without_estimate;  // truth files that no estimate belongs to
  std::vector<std::filesystem::path> without_truth;     // estimates that no truth belongs to
};

struct PairingOptions {
  FrameRange frames;                               // only maps whose names end in one of these numbers
  std::map<std::string, std::string> image_names;  // name of a map -> name of the image it is of, where that is known
};

/// Pairs files with truth. FILE and FILE are a pair. Of folders, the *.png and *.pfm are paired; an output folder
/// stands for its `disparity`, a data set's folder for its truth (of non-occluded pixels where it has that). Equal
/// names without extension belong together, as do the name of an estimate's image and its truth's. Where no names are
/// equal, `000010` belongs to the only truth whose numbers end in the same one, `000151_10`; not where the image's name
/// is known and has other numbers. Throws InvalidArgument where nothing belongs together or the truth is ambiguous.
/// Thread-safe.
EGOSGM_EXPORT EvaluationPairs pair_with_truth(const std::filesystem::path& estimate, const std::filesystem::path& truth,
                                              const PairingOptions& options = {});

/// The maps that `estimate` stands for in pair_with_truth, in the order of their names. Throws InvalidArgument where
/// there are none. Thread-safe.
EGOSGM_EXPORT std::vector<std::filesystem::path> list_maps(const std::filesystem::path& estimate,
                                                           const FrameRange& frames = {});

}  // namespace egosgm::vision
