// SPDX-License-Identifier: Apache-2.0
#include "host/stages/kalman_update.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/reference/kalman_update.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::kNone;

testing::HostMaps update(shared::ImageSize size, const KalmanUpdateOptions& options, const testing::HostMaps& predicted,
                         const testing::HostMaps& measured, int pixels = 0, Views views = Views::kBoth,
                         const reference::FrameEvidence* evidence = nullptr) {
  ocl::Context& context = testing::shared_context();
  KalmanUpdate stage(context, size, options, pixels);
  const StereoMaps prediction = testing::upload(context, size, predicted);
  const StereoMaps measurement = testing::upload(context, size, measured);
  StereoMaps out = testing::upload(context, size, testing::earlier_maps(size));
  const std::vector<cl_uchar> none(predicted.disparity.size());
  const FlagMap hidden = testing::on_device(context, predicted.hidden.empty() ? none : predicted.hidden);
  FlagMap doubtful = testing::on_device<cl_uchar>(context, none.size(), 9);
  BlockEvidence blocks(context, size);
  FlagMap before(context, none.size()), after = testing::on_device<cl_uchar>(context, none.size(), 7);
  if (evidence) {
    before.write(context, evidence->before);
    blocks.evidence.write(context, testing::in_padded_rows(size, evidence->blocks.evidence));
    blocks.found.write(context, testing::in_padded_rows(size, evidence->blocks.found));
  }
  const KalmanUpdate::FrameEvidence of_frame{before, blocks, evidence && evidence->repeats,
                                             evidence && evidence->sees_again};
  stage.update(hidden, prediction, measurement, evidence ? &of_frame : nullptr, out, doubtful, after, views);
  testing::HostMaps maps = testing::download(context, out);
  maps.doubtful = doubtful.read(context);
  maps.evidence = after.read(context);
  return maps;
}

struct Estimate {
  float disparity, variance;
  bool doubtful = false;
  bool operator==(const Estimate&) const = default;
};

constexpr Estimate kNothing{kNone, 0};
constexpr float kWide = 16;  // the variance of what is doubtful

Estimate update_pixel(const KalmanUpdateOptions& options, Estimate predicted, Estimate measured, int is_hidden = 0) {
  const testing::HostMaps updated =
      update({1, 1}, options,
             {{predicted.disparity, kNone}, {predicted.variance, 0}, {static_cast<std::uint8_t>(is_hidden), 0}},
             {{measured.disparity, kNone}, {measured.variance, 0}});
  EXPECT_EQ(updated.disparity[1], kNone);
  EXPECT_EQ(updated.variance[1], 0);
  EXPECT_EQ(updated.doubtful[1], 0);
  return {updated.disparity[0], updated.variance[0], updated.doubtful[0] != 0};
}

EGOSGM_TEST_AT_ALL_SIZES(KalmanUpdateTest);

TEST_P(KalmanUpdateTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  // On the left most are off to the same side.
  testing::HostMaps predicted = testing::random_maps(size, -2, 2, 0.3, 6);
  testing::HostMaps measured = testing::random_maps(size, -3, 3, 0.2, 7);
  for (std::size_t i = 0; i < measured.disparity.size(); ++i) {
    predicted.hidden.push_back(predicted.disparity[i] == kNone && i % 13 < 4);
    if (i % 7 == 0 && predicted.disparity[i] != kNone) predicted.variance[i] += 16;
    if (i % 5 == 0 && measured.disparity[i] != kNone) measured.disparity[i] -= 6;
    if (static_cast<int>(i) % size.width < size.width / 2 && i % 23 != 0) {
      predicted.hidden[i] = 0;
      predicted.disparity[i] = 0;
      measured.disparity[i] = 0.25f * static_cast<float>(i % 9) + 0.5f;
    }
  }
  for (const KalmanUpdateOptions& options :
       {KalmanUpdateOptions{}, KalmanUpdateOptions{.ask_neighbours = false},
        KalmanUpdateOptions{.gate_px = 0, .keep_predicted = false, .min_variance_px2 = 0.5f}}) {
    const testing::HostMaps reference = reference::kalman_update(size, options, predicted, measured);
    const testing::HostMaps expected{reference.disparity, reference.variance, {}, reference.doubtful};
    for (const int pixels : {1, 16}) {
      const testing::HostMaps actual = update(size, options, predicted, measured, pixels);
      EXPECT_TRUE(testing::same_maps(actual, expected, size)) << "gate " << options.gate_px << ", by " << pixels;
    }
  }
}

/// Of which nothing is hidden, and all that is asked has an answer.
reference::FrameEvidence random_evidence(shared::ImageSize size, unsigned seed, bool repeats, bool sees_again) {
  std::mt19937 random(seed);
  reference::FrameEvidence evidence;
  for (std::size_t i = 0; i < 2 * pixel_count(size); ++i) {
    evidence.before.push_back(random() % 3 == 0 ? 0 : static_cast<std::uint8_t>(random() % 161));
  }
  const std::size_t blocks = 2 * static_cast<std::size_t>((size.width + 3) / 4) * ((size.height + 3) / 4);
  for (std::size_t i = 0; i < blocks; ++i) {
    evidence.blocks.evidence.push_back(static_cast<int>(random() % 240) - 80);
    evidence.blocks.found.push_back(random() % 3 == 0 ? kNone : static_cast<float>(random() % 13) - 6);
  }
  evidence.repeats = repeats, evidence.sees_again = sees_again;
  return evidence;
}

TEST_P(KalmanUpdateTest, EqualsReferenceWithEvidence) {
  const shared::ImageSize size = GetParam();
  const testing::HostMaps predicted = testing::random_maps(size, -4, 4, 0.3, 16);
  const testing::HostMaps measured = testing::random_maps(size, -5, 5, 0.2, 17);
  testing::HostMaps before = testing::earlier_maps(size);
  before.doubtful.assign(before.disparity.size(), 9), before.evidence.assign(before.disparity.size(), 7);
  for (const auto& [repeats, sees_again] : {std::pair{false, false}, {true, false}, {false, true}}) {
    SCOPED_TRACE(std::to_string(repeats) + std::to_string(sees_again));
    reference::FrameEvidence evidence = random_evidence(size, 18, repeats, sees_again);
    testing::expect_reference(
        size, before,
        [&](int pixels, Views views) { return update(size, {}, predicted, measured, pixels, views, &evidence); },
        [&](int step) {
          evidence.row_step = step;
          const auto present = [&](const testing::HostMaps& maps) {
            return reference::without_absent_rows(size, step, maps);
          };
          return present(reference::kalman_update(size, {}, present(predicted), present(measured), &evidence));
        });
  }
}

TEST(KalmanUpdate, WeighsByTheVariances) {
  EXPECT_EQ(update_pixel({}, {10, 1}, {12, 1}), (Estimate{11, 0.5f}));
  EXPECT_EQ(update_pixel({}, {10, 3}, {12, 1}), (Estimate{11.5f, 0.75f}));
  EXPECT_EQ(update_pixel({}, {10, 1}, {12, 3}), (Estimate{10.5f, 0.75f}));
}

TEST(KalmanUpdate, TakesTheMeasurementBeyondTheGate) {
  EXPECT_EQ(update_pixel({.gate_px = 2}, {10, 1}, {12, 1}), (Estimate{11, 0.5f}));
  // With a variance for which the next frame searches wide.
  EXPECT_EQ(update_pixel({.gate_px = 2}, {10, 1}, {12.25f, 1}), (Estimate{12.25f, kWide, true}));
  const KalmanUpdateOptions alone{.gate_px = 2, .ask_neighbours = false};
  EXPECT_EQ(update_pixel(alone, {10, 1}, {7.75f, 1}), (Estimate{7.75f, kWide, true}));
  EXPECT_EQ(update_pixel(alone, {10, 1}, {7.75f, 2 * kWide}), (Estimate{7.75f, 2 * kWide, true}));
}

// The paper's update knows of nothing that hides.
TEST(KalmanUpdate, AveragesAllWithoutAGate) {
  const KalmanUpdateOptions plain{.gate_px = 0, .ask_neighbours = false};
  EXPECT_EQ(update_pixel(plain, {10, 1}, {90, 1}), (Estimate{50, 0.5f}));
  EXPECT_EQ(update_pixel(plain, {10, 16}, {14, 48}), (Estimate{11, 12}));
  EXPECT_EQ(update_pixel(plain, kNothing, {12, 3}, /*is_hidden=*/1), (Estimate{12, 3}));
  EXPECT_EQ(update_pixel(plain, kNothing, kNothing, /*is_hidden=*/1), kNothing);
}

TEST(KalmanUpdate, TakesWhatIsThere) {
  EXPECT_EQ(update_pixel({}, kNothing, {12, 3}), (Estimate{12, 3}));
  EXPECT_EQ(update_pixel({.keep_predicted = true}, {10, 5}, kNothing), (Estimate{10, 5}));
  EXPECT_EQ(update_pixel({.keep_predicted = false}, {10, 5}, kNothing), kNothing);
  EXPECT_EQ(update_pixel({}, kNothing, kNothing), kNothing);
}

TEST(KalmanUpdate, DropsWhatIsMeasuredWhereANearerSurfaceHidesIt) {
  for (const bool ask_neighbours : {false, true}) {
    const KalmanUpdateOptions options{.keep_predicted = true, .ask_neighbours = ask_neighbours};
    EXPECT_EQ(update_pixel(options, kNothing, {12, 3}, /*is_hidden=*/1), kNothing);
    EXPECT_EQ(update_pixel(options, kNothing, kNothing, /*is_hidden=*/1), kNothing);
  }
}

/// 20x20 pixels, the window of those in the middle: all are predicted at 20 px and measured `off` nearer, but for the
/// pixel in the middle, in a row that does not count, which is measured at `z`.
struct Window {
  static constexpr shared::ImageSize kSize{20, 20};
  static constexpr int kMiddle = 9 * 20 + 9, kCounted = 200;
  testing::HostMaps predicted, measured;

  Window(float off, float z) : predicted(all(20)), measured(all(20 + off)) { measured.disparity[kMiddle] = z; }

  static testing::HostMaps all(float disparity) {
    const std::size_t pixels = 2 * kSize.width * kSize.height;
    return {std::vector<float>(pixels, disparity), std::vector<float>(pixels, 1)};
  }
  /// The first `count` pixels that count are measured there.
  Window& with(int count, float disparity) {
    for (int i = 0; i < count; ++i) measured.disparity[i / 20 * 40 + i % 20] = disparity;
    return *this;
  }
  Estimate middle(const KalmanUpdateOptions& options = {}) const {
    const testing::HostMaps updated = update(kSize, options, predicted, measured);
    return {updated.disparity[kMiddle], updated.variance[kMiddle], updated.doubtful[kMiddle] != 0};
  }
};

/// A prediction that the pixels around moved by `drift`, fused with z.
Estimate drifted(float drift, float z) {
  const float p = 1 + drift * drift, gain = p / (p + 1);
  return {20 + drift + gain * (z - (20 + drift)), (1 - gain) * p};
}

TEST(KalmanUpdate, MovesThePredictionOfWhatMovesByItself) {
  for (const float sign : {1.0f, -1.0f}) {
    EXPECT_EQ(Window(sign * 0.5f, 20 + sign).middle(), drifted(sign * 0.5f, 20 + sign));
    EXPECT_EQ(Window(sign * 0.5f, 20 + sign).middle({.ask_neighbours = false}), drifted(0, 20 + sign));
    EXPECT_EQ(Window(sign * 0.5f, 20 + sign * 4).middle(), (Estimate{20 + sign * 4, kWide, true})) << "contradicted";
    EXPECT_EQ(Window(sign * 26 / 256, 20 + sign).middle(), drifted(sign * 26 / 256, 20 + sign));
    EXPECT_EQ(Window(sign * 0.5f, 20).middle().disparity, 20) << "no farther than to the measurement";
    EXPECT_EQ(Window(sign * 25 / 256, 20).middle(), drifted(0, 20)) << "too little";
  }
  EXPECT_EQ(Window(0.5f, 21).with(50, 20).middle(), drifted(0.375f, 21)) << "three quarters";
  EXPECT_EQ(Window(0.5f, 21).with(51, 20).middle(), drifted(0, 21)) << "fewer";
  EXPECT_EQ(Window(0.5f, 21).with(100, 19.5f).middle(), drifted(0, 21)) << "to both sides";
  EXPECT_EQ(Window(0.5f, 21).with(100, 20 + 12.0f / 256).middle(), drifted(0, 21)) << "half are hardly off";
  EXPECT_EQ(Window(0.5f, 21).with(140, 28).middle(), drifted(0.5f, 21)) << "60 agree within the gate";
  EXPECT_EQ(Window(0.5f, 21).with(141, 28).middle(), drifted(0, 21)) << "59";
  EXPECT_EQ(Window(0.5f, 21).with(141, kNone).middle(), drifted(0, 21)) << "59 are measured";
}

/// A left pixel in the middle row of 25x49, whose match lies in the image, and its evidence. `supporters`: how many of
/// the pixels at multiples of 8 px around were measured the same.
struct Pixel {
  float predicted = kNone, measured = kNone;
  std::uint8_t before = 0;
  int now = 0;
  float found = kNone;
  bool repeats = false, sees_again = false;
  int supporters = 1;
};
struct Judged {
  Estimate estimate;
  int evidence;
  bool operator==(const Judged&) const = default;
};

Judged judged(const Pixel& pixel, int x = 12) {
  constexpr shared::ImageSize kSize{25, 49};
  constexpr int kPixels = 25 * 49, kBlocks = 7 * 13;
  testing::HostMaps predicted = testing::empty_maps(kSize), measured = predicted;
  const int i = 24 * 25 + x;
  predicted.disparity[i] = pixel.predicted, measured.disparity[i] = pixel.measured;
  int supporters = pixel.supporters;
  for (const int y : {24, 16, 32, 8, 40, 0, 48}) {
    for (const int u : {x + 8, x - 8, x}) {
      if ((u != x || y != 24) && u >= 0 && u < 25 && supporters-- > 0) measured.disparity[y * 25 + u] = pixel.measured;
    }
  }
  predicted.variance[i] = measured.variance[i] = 1;
  reference::FrameEvidence evidence{
      std::vector<std::uint8_t>(2 * kPixels, 0),
      {std::vector<int>(2 * kBlocks, pixel.now), std::vector<float>(2 * kBlocks, pixel.found)},
      pixel.repeats,
      pixel.sees_again};
  evidence.before[i] = pixel.before;
  const testing::HostMaps out = update(kSize, {}, predicted, measured, 0, Views::kBoth, &evidence);
  return {{out.disparity[i], out.variance[i], out.doubtful[i] != 0}, out.evidence[i]};
}

// In sixteenths of a bit: 1.5 bits a frame must be had, 3 more by what was chosen in this frame alone.
TEST(KalmanUpdate, EvidenceAddsUpAndDecays) {
  EXPECT_EQ(judged({.predicted = 5, .measured = 6, .before = 64, .now = 40}), (Judged{{5.5f, 0.5f}, 45 + 40 - 24}));
  EXPECT_EQ(judged({.predicted = 5, .measured = 5, .before = 128, .now = 400}).evidence, 160) << "at most";
  EXPECT_EQ(judged({.measured = 5, .now = 72}), (Judged{{5, 1}, 0})) << "chosen: just alive";
  EXPECT_EQ(judged({.measured = 5, .now = 71}), (Judged{kNothing, 0}));
  EXPECT_EQ(judged({.measured = 5, .now = 24, .found = 11}), (Judged{{5, 1}, 0})) << "the coarse match found it, too";
  EXPECT_EQ(judged({.measured = 5, .now = 24, .found = 11.5f}), (Judged{kNothing, 0})) << "but not that";
  EXPECT_EQ(judged({.predicted = 5, .measured = 6, .before = 64, .now = 40, .found = 11.5f}).evidence, 45 + 40 - 48)
      << "the coarse match contradicts it";
  EXPECT_EQ(judged({.predicted = 5, .measured = 6, .before = 64, .now = 40, .found = 11}).evidence, 45 + 40 - 24);
  EXPECT_EQ(judged({.predicted = 5, .measured = 9, .before = 128, .now = 90}).evidence, 90 - 72)
      << "contradicted: what was believed does not count";
  EXPECT_EQ(judged({.predicted = 5, .measured = 9, .before = 128, .now = 71}), (Judged{{5, 1}, 90 - 24}))
      << "a measurement without evidence contradicts nothing";
}

TEST(KalmanUpdate, AMeasurementAloneDoesNotCountUnlessThePredictionSharesIt) {
  EXPECT_EQ(judged({.measured = 5, .now = 96}), (Judged{{5, 1}, 96 - 72}));
  EXPECT_EQ(judged({.measured = 5, .now = 96, .supporters = 0}), (Judged{kNothing, 0}));
  EXPECT_EQ(judged({.predicted = 5, .measured = 9, .before = 64, .now = 96, .supporters = 0}),
            (Judged{{5, 1}, 45 + 96 - 24}))
      << "it contradicts nothing";
  EXPECT_EQ(judged({.predicted = 5, .measured = 6, .before = 64, .now = 40, .supporters = 0}),
            (Judged{{5.5f, 0.5f}, 45 + 40 - 24}));
}

TEST(KalmanUpdate, WithoutEvidenceAPredictionLivesAFewFrames) {
  int evidence = 160, frames = 0;
  for (; frames < 20; ++frames) {
    const Judged now = judged({.predicted = 5, .measured = 6, .before = static_cast<std::uint8_t>(evidence)});
    if (now.estimate.disparity == kNone) break;
    EXPECT_EQ(now.estimate, (Estimate{5, 1})) << "the measurement moves nothing, and no variance falls";
    evidence = now.evidence;
  }
  EXPECT_EQ(frames, 3);
}

TEST(KalmanUpdate, WhereNothingCanBeAskedEvidenceDecaysAlone) {
  EXPECT_EQ(judged({.predicted = 5, .before = 64, .now = -100}, 3).evidence, 58)
      << "the match lies outside of the image";
  EXPECT_EQ(judged({.predicted = 5, .before = 64, .now = -100}, 5), (Judged{kNothing, 0})) << "and inside";
}

TEST(KalmanUpdate, ARepeatedPairMakesNobodySurer) {
  EXPECT_EQ(judged({.predicted = 5, .measured = 6, .before = 64, .now = 90, .repeats = true}), (Judged{{5, 1}, 64}));
  EXPECT_EQ(judged({.measured = 6, .now = 96, .repeats = true}), (Judged{{6, 1}, 96 - 72})) << "what is new counts";
  EXPECT_EQ(judged({.predicted = 5, .measured = 9, .before = 64, .now = 90, .repeats = true}), (Judged{{5, 1}, 64}));
}

TEST(KalmanUpdate, WhereTheCameraStandsAPixelBeginsWhatIsSharedAndFoundInTheWholeRange) {
  EXPECT_EQ(judged({.measured = 5, .now = 96, .found = 11, .sees_again = true, .supporters = 12}),
            (Judged{{5, 1}, 96 - 24}));
  EXPECT_EQ(judged({.measured = 5, .now = 96, .found = 11, .sees_again = true, .supporters = 11}),
            (Judged{kNothing, 0}));
  EXPECT_EQ(judged({.measured = 5, .now = 160, .sees_again = true, .supporters = 12}), (Judged{kNothing, 0}))
      << "the coarse match did not find it";
  EXPECT_EQ(judged({.predicted = 5, .measured = 9, .before = 128, .now = 90, .sees_again = true}).evidence, 90 - 72)
      << "what moves there contradicts a prediction";
  EXPECT_EQ(judged({.predicted = 5, .before = 64, .now = 40, .sees_again = true}).evidence, 45 + 40 - 24)
      << "a prediction stays";
}

TEST(KalmanUpdate, NeverClaimsMoreThanTheFloor) {
  const KalmanUpdateOptions options{.min_variance_px2 = 0.25f};
  EXPECT_EQ(update_pixel(options, {10, 0.25f}, {10, 0.25f}), (Estimate{10, 0.25f}));
  EXPECT_EQ(update_pixel(options, kNothing, {12, 0.125f}), (Estimate{12, 0.25f}));
  EXPECT_EQ(update_pixel(options, {10, 0.125f}, kNothing), (Estimate{10, 0.25f}));
  EXPECT_EQ(update_pixel(options, {10, 0}, {11, 0}), (Estimate{10, 0.25f}));
}

}  // namespace
}  // namespace egosgm
