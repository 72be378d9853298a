// SPDX-License-Identifier: Apache-2.0
#include "vision/pair_with_truth.h"

#include <algorithm>
#include <map>
#include <set>
#include <system_error>

#include "egosgm/error.h"
#include "vision/frame_names.h"
#include "vision/name_numbers.h"

namespace egosgm::vision {
namespace {

namespace fs = std::filesystem;
using Maps = std::map<std::string, fs::path>;  // name without extension -> file

bool is_map(const fs::path& file) {
  const fs::path extension = file.extension();
  return extension == ".png" || extension == ".pfm" || extension == ".npy" || extension == ".flo";
}

/// Folders in which data sets keep their truth.
constexpr const char* kTruthPlaces[] = {
    "truth/left_disp_noc", "truth/left_disp_occ", "disp_noc", "disp_noc_0", "disp_occ",
    "disp_occ_0",          "disp0GT.pfm",         "disp0.pfm"};

fs::path truth_of(const fs::path& path) {
  std::error_code error;
  for (const fs::path& folder : {path, path / "training"}) {
    for (const char* place : kTruthPlaces) {
      if (is_folder(path) && fs::exists(folder / place, error)) return folder / place;
    }
  }
  return path;
}

Maps maps_of(const fs::path& path) {
  if (!is_folder(path)) return {{path.stem().string(), path}};
  Maps maps;
  std::set<std::string> folders;
  for (const std::string& name : list_folder(path)) {
    const fs::path file = path / name;
    if (is_folder(file)) folders.insert(name);
    if (!is_map(file)) continue;
    const auto [other, is_new] = maps.emplace(file.stem().string(), file);
    if (is_new) continue;
    throw InvalidArgument(file.string() + ": has the name of " + other->second.string() +
                          "; give a folder with one map of each name, or one file");
  }
  if (!maps.empty()) return maps;
  std::string inside;
  for (const std::string& folder : folders) inside += (inside.empty() ? "; inside are the folders " : ", ") + folder;
  throw InvalidArgument(path.string() + ": holds no .png or .pfm or .npy; give a folder of disparity maps" + inside);
}

/// Whether the longer one ends with the shorter one.
bool fit(const Numbers& a, const Numbers& b) {
  const auto common = static_cast<std::ptrdiff_t>(std::min(a.size(), b.size()));
  return std::equal(a.end() - common, a.end(), b.end() - common);
}

bool is_below(const std::string& number, int bound) {
  const std::string other = std::to_string(bound);
  return number.size() != other.size() ? number.size() < other.size() : number < other;
}

/// Throws InvalidArgument, naming what `maps` is of, where none is left.
void keep_frames(Maps& maps, const FrameRange& frames, const fs::path& path) {
  if (!frames.first && !frames.last) return;
  std::erase_if(maps, [&](const auto& map) {
    const Numbers numbers = numbers_in(map.first);
    return numbers.empty() || (frames.first && is_below(numbers.back(), *frames.first)) ||
           (frames.last && !is_below(numbers.back(), *frames.last) && numbers.back() != std::to_string(*frames.last));
  });
  if (maps.empty()) throw InvalidArgument(path.string() + ": holds no map of the chosen frames");
}

class Pairing {
 public:
  Pairing(Maps estimates, Maps truths, const std::map<std::string, std::string>& image_names)
      : estimates_(std::move(estimates)), truths_(std::move(truths)), image_names_(image_names) {
    for (auto truth = truths_.cbegin(); truth != truths_.cend(); ++truth) {
      const Numbers numbers = numbers_in(truth->first);
      if (!numbers.empty()) by_last_number_.emplace(numbers.back(), truth);
    }
  }

  EvaluationPairs operator()() {
    for (const auto& [name, estimate] : estimates_) {
      const auto own = truths_.find(name), image = truths_.find(image_name(name));
      if (own != truths_.end() || image != truths_.end()) add(name, image != truths_.end() ? image : own, true);
    }
    if (result_.pairs.empty()) {
      for (const auto& [name, estimate] : estimates_) pair_by_numbers(name);
    }
    for (const auto& [name, estimate] : estimates_) {
      if (!paired_.contains(estimate)) result_.without_truth.push_back(estimate);
    }
    for (const auto& [name, truth] : truths_) {
      if (!paired_.contains(truth)) result_.without_estimate.push_back(truth);
    }
    return std::move(result_);
  }

 private:
  const std::string& image_name(const std::string& name) const {
    const auto known = image_names_.find(name);
    return known == image_names_.end() ? name : known->second;
  }

  void add(const std::string& name, Maps::const_iterator truth, bool same_name) {
    const fs::path& estimate = estimates_.at(name);
    if (const auto [other, is_new] = paired_.emplace(truth->second, estimate); !is_new) {
      throw InvalidArgument(truth->second.string() + ": belongs to " + other->second.filename().string() + " or to " +
                            estimate.filename().string() + " of " + estimate.parent_path().string() +
                            "; give one estimate instead of the folder");
    }
    paired_.emplace(estimate, truth->second);
    result_.pairs.push_back({estimate, truth->second, name, same_name});
  }

  void pair_by_numbers(const std::string& name) {
    const Numbers numbers = numbers_in(image_name(name));
    if (numbers.empty()) return;
    auto found = truths_.cend();
    const auto [begin, end] = by_last_number_.equal_range(numbers.back());
    for (auto entry = begin; entry != end; ++entry) {
      const auto truth = entry->second;
      if (!fit(numbers, numbers_in(truth->first))) continue;
      if (found != truths_.cend()) {
        throw InvalidArgument(estimates_.at(name).string() + ": belongs to " + found->second.filename().string() +
                              " or to " + truth->second.filename().string() + " of " +
                              truth->second.parent_path().string() + "; give one truth file instead of the folder");
      }
      found = truth;
    }
    if (found != truths_.cend()) add(name, found, false);
  }

  const Maps estimates_, truths_;
  std::multimap<std::string, Maps::const_iterator> by_last_number_;
  const std::map<std::string, std::string>& image_names_;
  std::map<fs::path, fs::path> paired_;  // both ways
  EvaluationPairs result_;
};

/// The reason why no estimate met a truth, with an example.
std::string why_nothing(const Maps& estimates, const std::map<std::string, std::string>& image_names) {
  for (const auto& [name, estimate] : estimates) {
    const auto image = image_names.find(name);
    if (image == image_names.end() || image->second == name) continue;
    return estimate.filename().string() + " is of the image " + image->second +
           ", say; give its truth, or FILE and FILE";
  }
  return "give FILE and FILE, or folders with equal names";
}

}  // namespace

EvaluationPairs pair_with_truth(const fs::path& estimate, const fs::path& truth, const PairingOptions& options) {
  std::error_code error;
  for (const fs::path& path : {estimate, truth}) {
    if (!fs::exists(path, error)) {
      throw MissingPath(path.string(), "no such file or folder; give a disparity map (.png, .pfm) or a folder of them");
    }
  }
  if (!is_folder(estimate) && !is_folder(truth)) {
    return {.pairs = {{estimate, truth, estimate.stem().string(), true}}, .without_estimate = {}, .without_truth = {}};
  }
  Maps estimates = maps_of(is_folder(estimate / "disparity") ? estimate / "disparity" : estimate);
  Maps truths = maps_of(truth_of(truth));
  keep_frames(estimates, options.frames, estimate);
  keep_frames(truths, options.frames, truth);
  EvaluationPairs result = Pairing(estimates, truths, options.image_names)();
  if (result.pairs.empty()) {
    throw InvalidArgument(estimate.string() + ": nothing there belongs to " + truth.string() +
                          " by name or frame number; " + why_nothing(estimates, options.image_names));
  }
  if (!is_folder(estimate)) result.without_estimate.clear();
  if (!is_folder(truth)) result.without_truth.clear();
  return result;
}

std::vector<fs::path> list_maps(const fs::path& estimate, const FrameRange& frames) {
  std::error_code error;
  if (!fs::exists(estimate, error)) {
    throw MissingPath(estimate.string(),
                      "no such file or folder; give a disparity map (.png, .pfm, .npy) or a folder of them");
  }
  Maps maps = maps_of(is_folder(estimate / "disparity") ? estimate / "disparity" : estimate);
  keep_frames(maps, frames, estimate);
  std::vector<fs::path> files;
  for (const auto& [name, file] : maps) files.push_back(file);
  return files;
}

}  // namespace egosgm::vision
