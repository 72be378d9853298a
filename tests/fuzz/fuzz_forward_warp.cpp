// SPDX-License-Identifier: Apache-2.0
// Random maps, calibrations and motions, also degenerate ones, for ForwardWarp in both ways, against the reference.
#include <stdexcept>

#include "host/stages/forward_warp.h"
#include "tests/fuzz/random_motion.h"
#include "tests/fuzz/target.h"
#include "tests/reference/forward_warp.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/device_maps.h"

namespace egosgm::fuzz {
namespace {

constexpr shared::ImageSize kSize{19, 11};
constexpr float kProcessNoisePx2 = 0.25f;

/// A disparity of the range, a hole, or, as no stage gives it, one outside of the range or no number.
float disparity(Bytes& bytes, shared::DisparityRange range) {
  switch (bytes.below(16)) {
    case 0:
    case 1:
      return EGOSGM_INVALID_DISPARITY;
    case 2:
      return static_cast<float>(range.min);
    default:
      return static_cast<float>(range.min) + static_cast<float>(bytes.below(range.count * 8)) / 8;
  }
}

float variance(Bytes& bytes) { return bytes.below(16) == 0 ? 1e30f : static_cast<float>(bytes.below(1000)) / 100; }

Calibration random_calibration(Bytes& bytes) {
  Calibration calibration{.fx = 20, .fy = 18, .cx = 9.5, .cy = 5, .baseline_m = 0.5};
  double* const values[] = {&calibration.fx, &calibration.fy,         &calibration.cx,
                            &calibration.cy, &calibration.baseline_m, &calibration.doffs_px};
  for (int changes = bytes.below(3); changes > 0; --changes) *values[bytes.below(6)] = bytes.number();
  return calibration;
}

}  // namespace

std::vector<std::string> seeds() { return random_seeds(33, 3000); }

void run(std::string_view input) {
  Bytes bytes(input);
  const Calibration calibration = random_calibration(bytes);
  calibration.validate();
  const Motion motion = random_motion(bytes);
  motion.validate();
  const shared::DisparityRange range = bytes.coin() ? shared::DisparityRange{0, 32} : shared::DisparityRange{-9, 21};
  testing::HostMaps belief = testing::empty_maps(kSize);
  for (float& d : belief.disparity) d = disparity(bytes, range);
  for (std::size_t i = 0; i < belief.variance.size(); ++i) {
    if (belief.disparity[i] > EGOSGM_INVALID_DISPARITY) belief.variance[i] = variance(bytes);
    belief.evidence.push_back(static_cast<std::uint8_t>(i * 29));
  }
  const testing::HostMaps expected =
      reference::forward_warp(kSize, range, disparity_motion(calibration, motion, EGOSGM_LEFT),
                              disparity_motion(calibration, motion, EGOSGM_RIGHT), kProcessNoisePx2, belief);
  ocl::Context& context = testing::shared_context();
  const StereoMaps on_device = testing::upload(context, kSize, belief);
  FlagMap evidence(context, belief.evidence.size()), moved(context, belief.evidence.size());
  evidence.write(context, belief.evidence);
  for (const int pixels : {1, 16}) {
    ForwardWarp stage(context, kSize, calibration, {.process_noise_px2 = kProcessNoisePx2}, range, pixels);
    StereoMaps predicted(context, kSize);
    stage.warp(on_device, evidence, motion, predicted, moved, Views::kBoth);
    const testing::HostMaps actual = testing::download_marked(context, predicted);
    if (moved.read(context) != expected.evidence) throw std::logic_error("by " + std::to_string(pixels) + ": evidence");
    if (actual.hidden != expected.hidden) throw std::logic_error("by " + std::to_string(pixels) + ": hidden");
    for (const auto& same : {testing::same_bits(actual.disparity, expected.disparity, kSize),
                             testing::same_bits(actual.variance, expected.variance, kSize)}) {
      if (!same) throw std::logic_error("by " + std::to_string(pixels) + ": " + same.message());
    }
  }
}

}  // namespace egosgm::fuzz
