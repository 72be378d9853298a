// SPDX-License-Identifier: Apache-2.0
#include "host/stages/reasons.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <initializer_list>
#include <random>

#include "host/stages/banded_sgm.h"
#include "host/stages/census.h"
#include "tests/reference/reasons.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::kNone;

PixelType type_of(const reference::ReasonInputs& inputs) {
  return inputs.white == 255 ? PixelType::kU8 : PixelType::kU16;
}

/// Of both views; black is what `inputs` does not have.
FrameImages upload_images(ocl::Context& context, shared::ImageSize size, const reference::ReasonInputs& inputs) {
  std::vector<cl_uchar> bytes = testing::bytes_of(inputs.images, type_of(inputs));
  bytes.resize(4 * pixel_count(size));
  return {testing::on_device(context, bytes), type_of(inputs)};
}

/// Fills in the codes of the inputs.
std::vector<cl_uchar> reasons_of(shared::ImageSize size, const MethodOptions& options, reference::ReasonInputs& inputs,
                                 int pixels = 0) {
  ocl::Context& context = testing::shared_context();
  const FrameImages images = upload_images(context, size, inputs);
  inputs.code_padding = BandedSgm::code_padding(range_of(options));
  Census census(context, size, images.type, options.banded_sgm.cost, inputs.code_padding);
  ocl::Buffer<cl_uint> codes(context, Census::words(options.banded_sgm.cost, size, inputs.code_padding));
  census.encode(images.pixels, codes);
  const std::vector<cl_uint> made = codes.read(context);
  inputs.codes.assign(made.begin(), made.end());

  Prediction prediction(context, size);
  if (!inputs.warped.empty()) prediction.warped.disparity.write(context, inputs.warped);
  if (!inputs.hidden.empty()) prediction.hidden.write(context, inputs.hidden);
  const StereoMaps belief = testing::upload(context, size, inputs.belief);
  const StereoMaps measured = testing::upload(context, size, {inputs.measured, inputs.measured});
  const FlagMap doubtful = testing::on_device(context, inputs.doubtful);
  FlagMap evidence(context, 2 * pixel_count(size));
  if (!inputs.evidence.empty()) evidence.write(context, inputs.evidence);
  std::vector<int> blocks = inputs.block_evidence;
  blocks.resize(static_cast<std::size_t>((size.width + 3) / 4) * ((size.height + 3) / 4));
  const auto block_evidence = testing::on_device(context, testing::in_padded_rows(size, blocks));
  std::vector<cl_ushort> begins;
  for (const float d : inputs.consistent) begins.push_back(d == kNone ? 0xffff : 0);
  const auto runs = testing::on_device(context, begins);
  auto found = testing::on_device<cl_uchar>(context, pixel_count(size), 99);
  Reasons reasons(context, size, images.type, options, Reasons::repeats(context, size), pixels);
  reasons.explain(
      {{images, codes, inputs.grey_step, measured, options.speckle_removal.max_size_px > 0 ? &runs : nullptr},
       inputs.warped.empty() ? nullptr : &prediction,
       {belief, belief.disparity, doubtful, inputs.evidence.empty() ? nullptr : &evidence, block_evidence}},
      inputs.row_step, found);
  return found.read(context);
}

/// A picture with texture, a part that repeats, one that is flat and one that is white; and maps that often agree.
reference::ReasonInputs random_inputs(shared::ImageSize size, int white, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> grey(1, white - 1), tenth(0, 9), little(0, 2);
  reference::ReasonInputs inputs;
  inputs.white = white;
  inputs.grey_step = static_cast<float>(white / 255);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const int part = 5 * x / size.width;
      inputs.images.push_back(part == 0   ? (x * 37 + y * 53) % 7 * white / 8
                              : part == 1 ? white / 2 + little(random) * white / 255
                              : part == 2 ? (tenth(random) < 7 ? white : grey(random))
                              : part == 3 ? (tenth(random) < 5 ? 0 : grey(random))
                                          : grey(random));
    }
  }
  inputs.belief = testing::random_maps(size, 0, 30, 0.3, seed + 1);
  inputs.warped = testing::random_maps(size, 0, 30, 0.3, seed + 2).disparity;
  inputs.consistent = testing::random_maps(size, 0, 30, 0.3, seed + 3).disparity;
  inputs.measured = inputs.consistent;
  inputs.doubtful.assign(inputs.measured.size(), 0);
  for (std::size_t i = 0; i < inputs.measured.size(); ++i) {
    if (tenth(random) < 2) inputs.measured[i] = kNone;
    if (tenth(random) < 6 && inputs.belief.disparity[i] != kNone) inputs.warped[i] = inputs.belief.disparity[i];
    if (tenth(random) < 2 && inputs.belief.disparity[i] != kNone) {
      inputs.doubtful[i] = 1;
    }
    inputs.hidden.push_back(inputs.belief.disparity[i] == kNone && tenth(random) < 2);
    inputs.evidence.push_back(static_cast<std::uint8_t>(tenth(random) < 7 ? 128 : 94 + tenth(random) % 4));
    inputs.block_evidence.push_back(tenth(random) < 7   ? 72 + tenth(random)
                                    : tenth(random) < 3 ? 0
                                                        : 71 - 9 * tenth(random));
  }
  inputs.block_evidence.resize(static_cast<std::size_t>((size.width + 3) / 4) * ((size.height + 3) / 4));
  return inputs;
}

class ReasonsTest : public ::testing::TestWithParam<shared::ImageSize> {};

TEST_P(ReasonsTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  for (const int white : {255, 65535}) {
    for (const MatchingCost cost : {MatchingCost::kCensus5x5, MatchingCost::kCensus9x7, MatchingCost::kSad3x3}) {
      for (const bool has_prediction : {false, true}) {
        MethodOptions options;
        options.disparities = 21;
        options.banded_sgm.cost = cost;
        reference::ReasonInputs inputs = random_inputs(size, white, 31);
        if (!has_prediction) inputs.warped.clear(), inputs.hidden.clear(), inputs.evidence.clear();
        if (has_prediction) inputs.row_step = 2;
        for (const int pixels : {1, 16}) {
          const std::vector<cl_uchar> actual = reasons_of(size, options, inputs, pixels);
          EXPECT_TRUE(testing::same_bits(actual, reference::reasons(size, options, inputs), size))
              << white << ", cost " << static_cast<int>(cost) << ", by " << pixels;
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, ReasonsTest, ::testing::ValuesIn(testing::kSizes), testing::size_name);

/// 64x40 pixels of strong texture, all of them measured, predicted and believed to be 10.
struct Scene {
  static constexpr shared::ImageSize kSize{64, 40};
  static constexpr std::size_t kMiddle = 20 * 64 + 32;
  reference::ReasonInputs inputs;
  MethodOptions options;

  Scene() {
    std::mt19937 random(5);
    std::uniform_int_distribution<int> grey(1, 254);
    const std::size_t pixels = 64 * 40;
    for (std::size_t i = 0; i < pixels; ++i) inputs.images.push_back(grey(random));
    const std::vector<float> ten(2 * pixels, 10.0f);
    inputs.warped = inputs.consistent = inputs.measured = ten;
    inputs.belief = {ten, std::vector<float>(2 * pixels, 0.5f)};
    inputs.hidden.assign(2 * pixels, 0);
    inputs.doubtful = inputs.hidden;
    inputs.block_evidence.assign(16 * 10, 72);
    options.disparities = 32;
  }

  float& measured() { return inputs.measured[kMiddle]; }
  float& consistent() { return inputs.consistent[kMiddle]; }
  float& believed() { return inputs.belief.disparity[kMiddle]; }
  float& warped(int beside = 0) { return inputs.warped[kMiddle + beside]; }
  std::uint8_t& evidence() { return inputs.evidence[kMiddle]; }
  void paint(int grey_of_column(int x, int y)) {
    for (int i = 0; i < 64 * 40; ++i) inputs.images[i] = grey_of_column(i % 64, i / 64);
  }
  Reason in_the_middle() {
    inputs.images.resize(64 * 40);
    for (int i = 0; i < 64 * 40; ++i) inputs.images.push_back(inputs.images[i / 64 * 64 + std::min(i % 64 + 10, 63)]);
    const std::vector<cl_uchar> found = reasons_of(kSize, options, inputs);
    EXPECT_EQ(reference::reasons(kSize, options, inputs), found);
    return static_cast<Reason>(found[kMiddle]);
  }
};

/// Changes of a scene, each on top of those before it, and what the pixel in the middle tells then.
struct Change {
  void (*change)(Scene& scene);
  Reason reason;
  const char* why = "";
};
void expect_after_each(std::initializer_list<Change> changes) {
  Scene scene;
  int count = 0;
  for (const Change& change : changes) {
    change.change(scene);
    EXPECT_EQ(scene.in_the_middle(), change.reason) << "change " << ++count << " " << change.why;
  }
}

TEST(Reasons, TrustsWhatIsMeasuredAsPredicted) { EXPECT_EQ(Scene().in_the_middle(), Reason::kTrusted); }

TEST(Reasons, TellsAValueThatIsPredictedOnly) {
  expect_after_each({{[](Scene& s) { s.measured() = s.consistent() = kNone; }, Reason::kPredicted},
                     {[](Scene& s) { s.believed() = kNone; }, Reason::kUnconfirmed},
                     {[](Scene& s) { s.consistent() = 10; }, Reason::kSpeckle},
                     {[](Scene& s) { s.options.speckle_removal.max_size_px = 0; }, Reason::kUnconfirmed,
                      "nothing is dropped as a speckle"}});
}

TEST(Reasons, TellsAContradiction) {
  expect_after_each({{[](Scene& s) { s.inputs.doubtful[Scene::kMiddle] = 1; }, Reason::kContradicted},
                     {[](Scene& s) { s.warped() = kNone; }, Reason::kTrusted, "nothing was predicted that could"},
                     {[](Scene& s) { s.warped() = 12, s.believed() = kNone; }, Reason::kContradicted},
                     {[](Scene& s) { s.warped() = 11; }, Reason::kUnconfirmed}});
}

TEST(Reasons, TellsWhatCameIntoViewBesideSomethingNearer) {
  const auto hole = [](Scene& s) {
    for (int x = -4; x <= 4; ++x) s.warped(x) = kNone;
  };
  expect_after_each(
      {{hole, Reason::kTrusted, "a hole in a surface"},
       {[](Scene& s) { s.warped(8) = 13.5f; }, Reason::kUncovered},
       {[](Scene& s) { s.believed() = kNone; }, Reason::kUncovered},
       {[](Scene& s) { s.warped(8) = kNone, s.warped(9) = 13.5f; }, Reason::kUnconfirmed, "too far off"}});
}

TEST(Reasons, TellsWhatIsHiddenByWhatIsNearerThanTheRange) {
  expect_after_each({{[](Scene& s) { s.inputs.hidden[Scene::kMiddle] = 1; }, Reason::kNearer}});
}

TEST(Reasons, TrustsNothingThatTheImagesHardlySay) {
  expect_after_each(
      {{[](Scene& s) { s.inputs.evidence.assign(s.inputs.doubtful.size(), 96); }, Reason::kTrusted},
       {[](Scene& s) { s.evidence() = 95; }, Reason::kFlat},
       {[](Scene& s) { s.measured() = kNone; }, Reason::kPredicted, "nothing was measured"},
       {[](Scene& s) { s.measured() = 10, s.believed() = kNone; }, Reason::kUnconfirmed, "no value, no evidence"},
       {[](Scene& s) { s.inputs.block_evidence[5 * 16 + 8] = 0; }, Reason::kUnconfirmed, "nothing was matched there"},
       {[](Scene& s) { s.inputs.block_evidence[5 * 16 + 8] = 71; }, Reason::kFlat, "no better than noise"},
       {[](Scene& s) { s.believed() = 10, s.evidence() = 96; }, Reason::kTrusted, "it has a value"}});
}

TEST(Reasons, CallsFlatWhatChangesByLessThanTwoGreyLevels) {
  Scene scene;
  scene.paint([](int x, int) { return 64 + x; });
  EXPECT_NE(scene.in_the_middle(), Reason::kFlat);
  scene.paint([](int x, int y) { return 64 + x - (x > 32 && y == 20); });
  EXPECT_EQ(scene.in_the_middle(), Reason::kFlat);
}

TEST(Reasons, TrustsWhatHasEvidenceHoweverDarkItIs) {
  Scene scene;
  scene.paint([](int x, int) { return 4 + x % 2; });
  EXPECT_EQ(scene.in_the_middle(), Reason::kFlat) << "a value without evidence";
  scene.inputs.evidence.assign(scene.inputs.doubtful.size(), 96);
  EXPECT_EQ(scene.in_the_middle(), Reason::kFlat) << "it began with that much";
  scene.evidence() = 97;
  EXPECT_NE(scene.in_the_middle(), Reason::kFlat);
  scene.believed() = kNone;
  EXPECT_EQ(scene.in_the_middle(), Reason::kFlat) << "a hole says why it is one";
}

TEST(Reasons, TellsWhatTheImageCannotTell) {
  Scene scene;
  scene.paint([](int x, int y) { return 10 + (x * 37 + y * 53) % 3; });
  scene.inputs.grey_step = 0.25f;
  EXPECT_NE(scene.in_the_middle(), Reason::kFlat) << "a dark image fills few levels";
  static constexpr auto kRepeats = [](int x, int y) { return 60 + (x % 12 * 37 + y * 17) % 101; };  // every 12 columns
  expect_after_each(
      {{[](Scene& s) { s.paint([](int x, int) { return 100 + x % 2; }); }, Reason::kFlat},
       {[](Scene& s) { s.paint([](int x, int y) { return 10 + (x * 37 + y * 53) % 3; }); }, Reason::kFlat},
       {[](Scene& s) { s.paint([](int, int) { return 255; }); }, Reason::kSaturated},
       {[](Scene& s) { s.paint([](int, int) { return 0; }); }, Reason::kSaturated},
       {[](Scene& s) { s.paint(kRepeats); }, Reason::kAmbiguous},
       {[](Scene& s) { s.options.disparities = 12; }, Reason::kTrusted, "no disparity takes one for the other"}});
}

}  // namespace
}  // namespace egosgm
