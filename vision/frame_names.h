// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "egosgm/vision/dataset.h"

namespace egosgm::vision {

/// Names of one camera's images: a prefix, what tells the frames apart, and a suffix.
struct NamePattern {
  enum class Kind { kPlain, kNumber, kAnything };  // nothing, `%06d` or `*` between prefix and suffix

  std::filesystem::path folder;
  std::string prefix, suffix;  // a suffix without a dot stands for those of all kinds of images
  Kind kind = Kind::kPlain;
  int digits = 1;               // least number of them
  bool any_width = false;       // fewer or more digits will do, too
  std::filesystem::path below;  // the file in each folder that matches; empty where files match

  /// The file that `text` in the place of `%06d` or `*` means, whether it is there or not.
  std::filesystem::path file_of(const std::string& text) const;
};

/// A file or a folder that is there stands for itself, whatever its name holds. Throws InvalidArgument where `pattern`
/// otherwise holds more than one `%d` or `*`, or `%d` in a folder's name.
NamePattern parse_pattern(const std::string& pattern);

/// Files of one moment; one of the paths is empty where only the other camera has one.
struct NamedPair {
  static constexpr int kNoNumber = -1;

  std::string text;  // what stands in the place of `%06d` or `*`
  int number = 0;    // the text, where those of pairs are numbers (then what is alone may have none), else the position
  std::filesystem::path left, right;

  bool is_alone() const { return left.empty() || right.empty(); }
};

/// Files that match, in order. Throws InvalidArgument where none belongs to the other camera's, and where two files of
/// one camera mean the same frame.
std::vector<NamedPair> pair_files(const NamePattern& left, const NamePattern& right, PairBy pair_by);

/// The objection of the names to pairs that were made by order: their last numbers go apart, as where a frame is
/// missing on one side. Empty where they do not.
std::string order_note(const std::vector<NamedPair>& pairs);

/// The files that match, in order. Throws as pair_files.
std::vector<std::filesystem::path> files_in_order(const NamePattern& pattern);

/// The frames in `range`; fills `frames`, `numbers`, `note`. What only one camera saw is left out, with a note. Throws
/// InvalidArgument where frames of the range are missing, or most have no partner.
void select_frames(const std::vector<NamedPair>& pairs, const NamePattern& left, FrameRange range,
                   const std::string& what, StereoSequence& sequence);

bool is_image_name(const std::filesystem::path& name);  // .png, .jpg, .jpeg, in any case

/// Names in a folder, sorted, but for hidden ones. Throws InvalidArgument where it cannot be listed.
std::vector<std::string> list_folder(const std::filesystem::path& folder);

/// The order of names, numbers inside by their value: img_9 before img_10. Thread-safe.
EGOSGM_EXPORT bool is_before(const std::string& a, const std::string& b);

bool is_digits(std::string_view text);
std::string lower(std::string text);  // of ASCII
bool is_folder(const std::filesystem::path& path);
bool is_file(const std::filesystem::path& path);

/// A frame's number, if it has room in an int.
std::optional<int> parse_frame_number(std::string_view text);

/// At least `width` digits.
std::string padded(const std::string& digits, int width);

}  // namespace egosgm::vision
