// SPDX-License-Identifier: Apache-2.0
#include "vision/image_pairs.h"

#include <system_error>

#include "egosgm/error.h"
#include "egosgm/vision/image_io.h"

namespace egosgm::vision {
namespace {

namespace fs = std::filesystem;

using Kind = NamePattern::Kind;

void require_image(const fs::path& file) {
  if (std::error_code none; fs::is_directory(file, none)) {
    throw InvalidArgument(file.string() + ": is a folder; give a pattern of its images, '" + (file / "*.png").string() +
                          "' for example");
  }
  if (!is_file(file)) throw MissingPath(file.string(), "no such image; give an existing PNG or JPEG file");
}

}  // namespace

std::vector<NamedPair> pairs_of_patterns(const NamePattern& left, const NamePattern& right,
                                         const std::string& left_text, const std::string& right_text, PairBy pair_by) {
  if ((left.kind == Kind::kPlain) != (right.kind == Kind::kPlain)) {
    throw InvalidArgument("patterns '" + left_text + "' and '" + right_text +
                          "': both must hold a %d or a *, or neither");
  }
  if (left.kind == Kind::kPlain) {
    require_image(left.folder / left.prefix);
    require_image(right.folder / right.prefix);
  }
  return pair_files(left, right, pair_by);
}

ImagePairs find_pairs(const std::string& left, const std::string& right, PairBy pair_by) {
  ImagePairs result;
  for (NamedPair& pair : pairs_of_patterns(parse_pattern(left), parse_pattern(right), left, right, pair_by)) {
    if (pair.is_alone()) {
      result.alone.push_back(pair.left.empty() ? pair.right : pair.left);
    } else {
      result.pairs.emplace_back(std::move(pair.left), std::move(pair.right));
    }
  }
  return result;
}

Image first_readable_image(const std::vector<StereoFrame>& frames) {
  for (const StereoFrame& frame : frames) {
    try {
      return read_stored_image(frame.left);
    } catch (const Error&) {  // who reads the pair says so
    }
  }
  return {};
}

std::vector<fs::path> find_images(const std::string& pattern) { return files_in_order(parse_pattern(pattern)); }

}  // namespace egosgm::vision
