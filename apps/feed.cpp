// SPDX-License-Identifier: Apache-2.0
#include "apps/feed.h"

#include <utility>

#include "apps/interrupt.h"
#include "egosgm/error.h"
#include "vision/image_pairs.h"

namespace egosgm::app {

FileFeed::FileFeed(vision::StereoSequence sequence) {
  sequence_ = std::move(sequence);
  size_ = vision::check_image_sizes(sequence_);
  type_ = vision::first_readable_image(sequence_.frames).depth() == CV_16U ? PixelType::kU16 : PixelType::kU8;
}

std::optional<FedFrame> FileFeed::next() {
  if (next_ == sequence_.frames.size()) return std::nullopt;
  FedFrame fed;
  fed.frame = sequence_.frames[next_++];
  try {
    fed.images = vision::read_images(fed.frame);
  } catch (const Error& error) {
    if (interrupted()) throw;  // a pipe that was waited for
    fed.unreadable = error.what();
  }
  return fed;
}

}  // namespace egosgm::app
