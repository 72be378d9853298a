// SPDX-License-Identifier: Apache-2.0
// The frames of an opened sequence: images, rows of files, poses.
#include <algorithm>
#include <exception>
#include <optional>
#include <string>

#include "egosgm/error.h"
#include "egosgm/vision/dataset.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/poses_io.h"

namespace egosgm::vision {

namespace fs = std::filesystem;

namespace {

std::string range(int first, int last) {
  return first == last ? std::to_string(first) : std::to_string(first) + ".." + std::to_string(last);
}

std::string describe(Size size) { return std::to_string(size.width) + "x" + std::to_string(size.height); }

}  // namespace

StereoImages read_images(const StereoFrame& frame) {
  StereoImages images{read_grey_image(frame.left), read_grey_image(frame.right)};
  const auto describe_image = [](const Image& image) {
    return std::to_string(image.cols) + "x" + std::to_string(image.rows) + ", " +
           std::to_string(8 * image.type.channel_bytes()) + " bit";
  };
  if (images.left.size() != images.right.size() || images.left.type != images.right.type) {
    throw InvalidArgument(frame.right.string() + ": " + describe_image(images.right) + ", but its left image " +
                          frame.left.string() + " has " + describe_image(images.left) + "; give a rectified pair");
  }
  return images;
}

Size check_image_sizes(const StereoSequence& sequence) {
  std::optional<Size> expected;
  std::exception_ptr unreadable;
  for (const StereoFrame& frame : sequence.frames) {
    Size of_left;
    for (const fs::path& file : {frame.left, frame.right}) {
      Size size;
      try {
        size = read_image_size(file);
      } catch (const Error&) {
        if (!unreadable) unreadable = std::current_exception();
        continue;
      }
      if (!expected) expected = size;
      if (file == frame.left) of_left = size;
      if (size == *expected) continue;
      const bool is_pair_broken = file != frame.left && !of_left.empty() && of_left != size;
      throw InvalidArgument(file.string() + ": " + describe(size) +
                            (is_pair_broken ? ", but its left image has " + describe(of_left) +
                                                  "; give both of one size, as they were calibrated"
                                            : ", but the sequence began with " + describe(*expected) +
                                                  "; select frames of one size with --frames, or give a pattern that "
                                                  "no other images fit"));
    }
  }
  if (!expected && unreadable) std::rethrow_exception(unreadable);
  const int width = sequence.calibrated_width, height = sequence.calibrated_height;
  if (expected && width > 0 && (expected->width != width || expected->height != height)) {
    throw InvalidArgument(sequence.calibration_file.string() + ": is of images of " + std::to_string(width) + "x" +
                          std::to_string(height) + ", and these have " + describe(*expected) +
                          ": give the calibration of this size");
  }
  return expected.value_or(Size());
}

std::vector<std::size_t> rows_of_frames(const StereoSequence& sequence, std::size_t rows, const fs::path& file,
                                        const std::string& what) {
  const std::vector<StereoFrame>& frames = sequence.frames;
  const std::vector<int>& all = sequence.numbers;
  if (frames.empty()) return {};
  for (const StereoFrame& frame : frames) {
    if (all.empty() || std::binary_search(all.begin(), all.end(), frame.number)) continue;
    throw InvalidArgument(file.string() + ": its " + what + " are of the frames " + range(all.front(), all.back()) +
                          ", and frame " + std::to_string(frame.number) +
                          " is none of them: give those of the same frames");
  }
  const auto by = [&](const auto& row_of) {
    std::vector<std::size_t> found;
    for (const StereoFrame& frame : frames) {
      const auto row = static_cast<std::size_t>(row_of(frame));  // a negative number is a large one
      if (row >= rows) {
        throw InvalidArgument(file.string() + ": holds " + std::to_string(rows) + " " + what + ", and none of frame " +
                              std::to_string(frame.number) + ": give those of the same frames");
      }
      found.push_back(row);
    }
    return found;
  };
  const auto number = [](const StereoFrame& frame) { return frame.number; };
  const auto up_to_last = static_cast<std::size_t>((all.empty() ? frames.back().number : all.back())) + 1;
  if (rows == up_to_last) return by(number);
  if (!all.empty() && rows == all.size()) {
    return by(
        [&](const StereoFrame& frame) { return std::lower_bound(all.begin(), all.end(), frame.number) - all.begin(); });
  }
  if (rows == frames.size()) return by([&](const StereoFrame& frame) { return &frame - frames.data(); });
  if (all.empty() && rows > up_to_last) return by(number);
  std::string fitting = std::to_string(up_to_last) + " (each number from 0)";
  if (!all.empty() && all.size() != up_to_last) {
    fitting += ", " + std::to_string(all.size()) + " (each frame of " + range(all.front(), all.back()) + ")";
  }
  if (frames.size() != up_to_last && frames.size() != all.size()) {
    fitting += ", " + std::to_string(frames.size()) + " (each chosen frame, " +
               range(frames.front().number, frames.back().number) + ")";
  }
  throw InvalidArgument(file.string() + ": holds " + std::to_string(rows) + " " + what +
                        ", which belong to no choice of the frames; it may hold " + fitting);
}

std::vector<Isometry> poses_of_frames(const StereoSequence& sequence, const fs::path& poses_file) {
  const std::vector<Isometry> rows = read_poses(poses_file);
  std::vector<Isometry> poses;
  for (const std::size_t row : rows_of_frames(sequence, rows.size(), poses_file, "poses")) poses.push_back(rows[row]);
  return poses;
}

}  // namespace egosgm::vision
