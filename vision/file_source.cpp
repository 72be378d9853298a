// SPDX-License-Identifier: Apache-2.0
#include <utility>

#include "egosgm/error.h"
#include "vision/frame_source.h"
#include "vision/image_pairs.h"

namespace egosgm::vision {

FileSource::FileSource(StereoSequence sequence) {
  sequence_ = std::move(sequence);
  size_ = check_image_sizes(sequence_);
  type_ = first_readable_image(sequence_.frames).type.channel == ChannelType::kU16 ? PixelType::kU16 : PixelType::kU8;
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
