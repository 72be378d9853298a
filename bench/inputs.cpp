// SPDX-License-Identifier: Apache-2.0
#include "bench/inputs.h"

#include <cstdlib>
#include <filesystem>
#include <opencv2/imgproc.hpp>

#include "egosgm/odometry.h"
#include "egosgm/vision/dataset.h"
#include "egosgm/vision/opencv.h"
#include "egosgm/vision/synthetic.h"

namespace egosgm::bench {
namespace {

std::filesystem::path data_folder() {
  const char* variable = std::getenv("EGOSGM_DATA");
  return variable ? std::filesystem::path(variable) : std::filesystem::path(EGOSGM_SOURCE_DIR) / "../shared/data";
}

/// Pixel centres lie at integers: the image's edge is at -0.5.
double scaled_centre(double centre, double scale) { return (centre + 0.5) * scale - 0.5; }

Calibration scaled(const Calibration& c, double scale_x, double scale_y) {
  return {c.fx * scale_x, c.fy * scale_y,      scaled_centre(c.cx, scale_x), scaled_centre(c.cy, scale_y),
          c.baseline_m,   c.doffs_px * scale_x};
}

vision::Image resized(const vision::Image& image, vision::Size size) {
  if (image.size() == size) return image;
  cv::Mat result;
  cv::resize(vision::mat_of(image), result, {size.width, size.height}, 0, 0,
             image.cols > size.width ? cv::INTER_AREA : cv::INTER_LINEAR);
  return vision::image_of(result);
}

Clip load_kitti(const std::filesystem::path& folder, vision::Size size) {
  const vision::StereoSequence sequence = vision::open_kitti_multiview(folder, "000151", {7, 11});
  const vision::Size original = vision::check_image_sizes(sequence);
  Clip clip{sequence.title,
            scaled(sequence.calibration, static_cast<double>(size.width) / original.width,
                   static_cast<double>(size.height) / original.height),
            {}};
  if (original != size) clip.title += ", resized";
  StereoOdometry odometry(sequence.calibration);
  for (const vision::StereoFrame& frame : sequence.frames) {
    const vision::StereoImages images = vision::read_images(frame);
    const auto result = odometry.process(vision::image_view(images.left), vision::image_view(images.right));
    clip.frames.push_back({resized(images.left, size), resized(images.right, size), result.motion});
  }
  return clip;
}

Clip render_clip(vision::Size size) {
  const vision::SyntheticSequence street({.frames = 5, .width = size.width, .height = size.height});
  Clip clip{"a synthetic street (no KITTI data found)", street.calibration(), {}};
  for (int i = 0; i < street.frames(); ++i) {
    const vision::SyntheticFrame frame = street.render(i);
    clip.frames.push_back({frame.left, frame.right, i ? std::optional(street.motion(i)) : std::nullopt});
  }
  return clip;
}

}  // namespace

Clip load_clip(vision::Size size) {
  const std::filesystem::path kitti = data_folder() / "kitti2012/training";
  return std::filesystem::exists(kitti / "image_0/000151_07.png") ? load_kitti(kitti, size) : render_clip(size);
}

}  // namespace egosgm::bench
