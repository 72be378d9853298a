// SPDX-License-Identifier: Apache-2.0
// Frames of any shape, stride and type, with any motion, handed to a pipeline of one size; and pipelines of any size,
// calibration and option that must be refused.
#include "egosgm/error.h"
#include "egosgm/pipeline.h"
#include "host/method_options.h"
#include "tests/fuzz/random_motion.h"
#include "tests/fuzz/target.h"

namespace egosgm::fuzz {
namespace {

constexpr int kWidth = 13, kHeight = 7;
constexpr std::uint8_t kCanary = 0xa5;

Calibration calibration() { return {.fx = 10, .fy = 10, .cx = 6, .cy = 3, .baseline_m = 0.5}; }

Pipeline& pipeline() {
  static Pipeline pipeline = [] {
    MethodOptions options;
    options.disparities = 16;
    return Pipeline(calibration(), kWidth, kHeight, options);
  }();
  return pipeline;
}

/// Mostly what fits, sometimes what does not.
int about(Bytes& bytes, int value) {
  switch (bytes.below(24)) {
    case 0:
      return bytes.take<std::int32_t>();
    case 1:
      return value + bytes.below(5) - 2;
    default:
      return value;
  }
}

/// Rows in memory of exactly their size, with guards around: a stride that is accepted must stay within.
template <typename View>
class Rows {
 public:
  Rows(Bytes& bytes, int pixel_bytes, View& view) {
    const int row = kWidth * pixel_bytes + bytes.below(6) * pixel_bytes;
    const bool bottom_up = bytes.coin();
    memory_.assign(static_cast<std::size_t>(kHeight) * row + 2 * kGuard, kCanary);
    for (std::size_t i = kGuard; i + kGuard < memory_.size(); ++i) memory_[i] = bytes.take<std::uint8_t>();
    std::uint8_t* first = memory_.data() + kGuard + (bottom_up ? static_cast<std::size_t>(kHeight - 1) * row : 0);
    view.data = reinterpret_cast<decltype(view.data)>(first);
    if (bytes.below(40) == 0) view.data = nullptr;
    view.width = about(bytes, kWidth);
    view.height = about(bytes, kHeight);
    view.stride_bytes = bottom_up ? -row : row;
    // Only strides that are too short: a longer one than the memory's the library cannot see.
    if (bytes.below(24) == 0) view.stride_bytes = bytes.below(kWidth * pixel_bytes) * (bytes.coin() ? 1 : -1);
  }
  bool guards_are_whole() const {
    return std::all_of(memory_.begin(), memory_.begin() + kGuard, [](auto b) { return b == kCanary; }) &&
           std::all_of(memory_.end() - kGuard, memory_.end(), [](auto b) { return b == kCanary; });
  }

 private:
  static constexpr int kGuard = 64;
  std::vector<std::uint8_t> memory_;
};

void refuse_or_build(Bytes& bytes) {
  Calibration chosen = calibration();
  double* const values[] = {&chosen.fx, &chosen.fy, &chosen.cx, &chosen.cy, &chosen.baseline_m, &chosen.doffs_px};
  *values[bytes.below(6)] = bytes.number();
  chosen.validate();
  const int width = about(bytes, 0), height = about(bytes, kHeight);
  if (width >= 1 && width <= 16384 && height >= 1 && height <= 16384) return;  // built elsewhere: it takes long
  Pipeline(chosen, width, height);
  throw std::logic_error("a pipeline of " + std::to_string(width) + "x" + std::to_string(height));
}

}  // namespace

std::vector<std::string> seeds() { return random_seeds(31, 900); }

void run(std::string_view input) {
  Bytes bytes(input);
  if (bytes.below(8) == 0) return refuse_or_build(bytes);
  ImageView left, right;
  const bool wide = bytes.coin();
  left.type = right.type = wide ? PixelType::kU16 : PixelType::kU8;
  FrameOutputs outputs;
  const Rows left_rows(bytes, wide ? 2 : 1, left), right_rows(bytes, wide ? 2 : 1, right);
  const Rows disparity(bytes, 4, outputs.disparity), variance(bytes, 4, outputs.variance);
  const Rows predicted(bytes, 4, outputs.debug.predicted);
  const Rows search_width(bytes, 2, outputs.debug.search_width);
  const Rows dynamic(bytes, 1, outputs.debug.dynamic);
  if (bytes.below(24) == 0) right.type = static_cast<PixelType>(bytes.below(4));
  if (bytes.below(12) == 0) pipeline().reset();
  std::optional<Motion> motion;
  if (bytes.below(6) > 0) motion = random_motion(bytes);
  const FrameReport report = pipeline().process(left, right, motion, outputs);
  if (!(report.search_fraction > 0)) throw std::logic_error("searched " + std::to_string(report.search_fraction));
  for (const double fraction : {report.predicted_fraction, report.density}) {
    if (!(fraction >= 0 && fraction <= 1)) throw std::logic_error("a fraction of " + std::to_string(fraction));
  }
  if (!left_rows.guards_are_whole() || !right_rows.guards_are_whole() || !disparity.guards_are_whole() ||
      !variance.guards_are_whole() || !predicted.guards_are_whole() || !search_width.guards_are_whole() ||
      !dynamic.guards_are_whole()) {
    throw std::logic_error("wrote outside of the caller's rows");
  }
}

}  // namespace egosgm::fuzz
