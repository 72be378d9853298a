// SPDX-License-Identifier: Apache-2.0
#include "apps/feed.h"

#include <utility>

#include "apps/interrupt.h"
#include "egosgm/error.h"
#include "egosgm/vision/image_io.h"

namespace egosgm::app {

FileFeed::FileFeed(vision::StereoSequence sequence) {
  sequence_ = std::move(sequence);
  size_ = vision::check_image_sizes(sequence_);
  for (const vision::StereoFrame& frame : sequence_.frames) {
    try {
      type_ = vision::read_pixel_type(frame.left);
      break;
    } catch (const Error&) {  // the pair is left out
    }
  }
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
