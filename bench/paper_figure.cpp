// SPDX-License-Identifier: Apache-2.0
// The stages of a frame as the paper draws them, of a synthetic street: one picture.
#include <cstdio>
#include <cstdlib>

#include "egosgm/error.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/image.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/render.h"
#include "egosgm/vision/synthetic.h"
#include "host/frame/frame_queue.h"
#include "vision/file_io.h"
#include "vision/picture_sheet.h"

namespace egosgm::bench {
namespace {

constexpr const char* kHelp =
    "egosgm_paper_figure FILE.png: a frame of the preset `paper` on a synthetic street, stage by stage.\n";
constexpr int kFrames = 4;  // the last one is drawn
constexpr int kColumns = 2, kCellWidth = 480;

/// The left view's map.
vision::Image left_of(FrameQueue& frames, const Map& maps) {
  std::vector<float> values = maps.read(frames.context());
  return vision::Image(frames.size().height, frames.size().width, vision::kF32, values.data(),
                       frames.size().width * sizeof(float))
      .clone();
}

void draw(const std::string& file) {
  const vision::SyntheticSequence street({.frames = kFrames, .width = kCellWidth, .height = 180});
  const shared::ImageSize size{street.options().width, street.options().height};
  PipelineOptions options = PipelineOptions::paper();
  options.disparities = 64;
  FrameQueue frames(street.calibration(), size, options, Device::select(), PixelType::kU8);
  vision::Image filled;
  frames.method().observer = [&](Step step) {
    if (step == Step::kPredict) filled = left_of(frames, frames.method().workspace().prediction.filled.disparity);
  };
  vision::Image previous, measured(size.height, size.width, vision::kF32), updated = measured.clone();
  for (int k = 0; k < kFrames; ++k) {
    previous = updated.clone();
    const vision::SyntheticFrame images = street.render(k);
    FrameOutputs outputs;
    outputs.disparity = vision::map_view(updated);
    outputs.debug.measured = vision::map_view(measured);
    frames.submit(vision::image_view(images.left), vision::image_view(images.right), street.motion(k), outputs);
    frames.collect();
  }
  const Prediction& prediction = frames.method().workspace().prediction;
  const vision::ColorRange range = vision::disparity_range(updated);
  std::vector<vision::CaptionedPicture> pictures;
  const auto add = [&](const char* caption, const vision::Image& map) {
    pictures.push_back({vision::color_disparity(map, range), caption});
  };
  add("1. map of the frame before", previous);
  add("2. prediction: moved by the camera's motion", left_of(frames, prediction.warped.disparity));
  add("3. beside jumps dropped, holes filled", filled);
  add("4. left and right agree", left_of(frames, prediction.maps.disparity));
  add("5. matched around the prediction", measured);
  add("6. updated, and checked by the images", updated);
  vision::write_png(file, vision::compose(pictures, kColumns, kCellWidth));
}

}  // namespace
}  // namespace egosgm::bench

int main(int argc, char** argv) {
  if (argc != 2 || argv[1][0] == '-') {
    std::fputs(egosgm::bench::kHelp, stderr);
    return EXIT_FAILURE;
  }
  try {
    egosgm::bench::draw(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "egosgm_paper_figure: %s\n", error.what());
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
