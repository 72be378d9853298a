// SPDX-License-Identifier: Apache-2.0
#include <string>
#include <utility>
#include <vector>

#include "egosgm/error.h"
#include "vision/frame_source.h"

namespace egosgm::vision {
namespace {

/// Throws InvalidArgument where no pair can be read: a header alone may ask for a pipeline of any size.
PixelType type_of_first_readable_pair(const std::vector<StereoFrame>& frames) {
  std::string why;
  for (const StereoFrame& frame : frames) {
    try {
      return read_images(frame).left.type == kU16 ? PixelType::kU16 : PixelType::kU8;
    } catch (const Error& error) {
      if (why.empty()) why = error.what();
    }
  }
  const std::string count = std::to_string(frames.size());
  throw InvalidArgument(count + " of " + count + (frames.size() == 1 ? " pair" : " pairs") +
                        " could not be read: " + why);
}

}  // namespace

FileSource::FileSource(StereoSequence sequence) {
  sequence_ = std::move(sequence);
  size_ = check_image_sizes(sequence_);
  type_ = type_of_first_readable_pair(sequence_.frames);
}

std::optional<VideoPair> FileSource::next() {
  if (next_ == sequence_.frames.size()) return std::nullopt;
  VideoPair pair;
  pair.frame = sequence_.frames[next_++];
  try {
    pair.images = read_images(pair.frame);
  } catch (const Error& error) {
    pair.unreadable = error.what();
  }
  return pair;
}

}  // namespace egosgm::vision
