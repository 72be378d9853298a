// SPDX-License-Identifier: Apache-2.0
#include "host/stages/vertical_alignment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/reference/vertical_alignment.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

reference::VerticalOffset same_everywhere(float offset_px) { return {{offset_px}, 0}; }

/// A slanted, textured plane seen by two cameras, the right one's rows `offset` further down.
struct Scene {
  shared::ImageSize size;
  PixelType type = PixelType::kU8;
  std::vector<int> images;     // grey values of both views
  testing::HostMaps measured;  // of both views; only the left one means something

  Scene(shared::ImageSize scene_size, float offset_px, PixelType pixel_type = PixelType::kU8, float noise_grey = 0)
      : Scene(scene_size, same_everywhere(offset_px), pixel_type, noise_grey) {}

  Scene(shared::ImageSize scene_size, const reference::VerticalOffset& offset, PixelType pixel_type = PixelType::kU8,
        float noise_grey = 0)
      : size(scene_size), type(pixel_type), images(2 * pixel_count(size)), measured(testing::empty_maps(size)) {
    std::mt19937 random(17);
    std::normal_distribution<float> noise(0, 1);
    std::uniform_real_distribution<float> angle(0, 6.2832f), wavelength(8, 40);
    float waves[6][3];
    for (auto& [along_x, along_y, phase] : waves) {
      const float direction = angle(random), frequency = 6.2832f / wavelength(random);
      along_x = frequency * std::cos(direction), along_y = frequency * std::sin(direction), phase = angle(random);
    }
    const auto texture = [&](float x, float y) {
      float grey = 128;
      for (const auto& [along_x, along_y, phase] : waves) grey += 18 * std::sin(along_x * x + along_y * y + phase);
      return static_cast<int>(std::lround((grey + noise_grey * noise(random)) * (type == PixelType::kU8 ? 1 : 257)));
    };
    const auto disparity = [](float y) { return 2.3f + 0.02f * y; };
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const std::size_t i = static_cast<std::size_t>(y) * size.width + x;
        const float row = static_cast<float>(y), column = static_cast<float>(x);
        const float left_row = row - reference::offset_at(size, offset, x, y);
        images[i] = texture(column, row);
        images[pixel_count(size) + i] = texture(column + disparity(left_row), left_row);
        measured.disparity[i] = disparity(row);
        measured.variance[i] = 1;
      }
    }
  }

  int grey() const { return type == PixelType::kU8 ? 1 : 256; }
};

FrameImages upload(ocl::Context& context, const Scene& scene) {
  return testing::images_of(context, scene.images, scene.type);
}

std::vector<int> download(ocl::Context& context, const FrameImages& images, const Scene& scene) {
  const std::vector<cl_uchar> raw = images.pixels.read(context);
  std::vector<int> values(scene.images.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] = scene.type == PixelType::kU8 ? raw[i] : raw[2 * i] | raw[2 * i + 1] << 8;
  }
  return values;
}

reference::VerticalOffset read(ocl::Context& context, const VerticalOffset& on_device) {
  const std::vector<float> terms = on_device.terms.read(context);
  reference::VerticalOffset offset;
  std::copy_n(terms.begin(), offset.terms_px.size(), offset.terms_px.begin());
  offset.estimates = terms.at(offset.terms_px.size());
  return offset;
}

/// What a pipeline does, without its matcher: two estimates in the first frame, then one a frame.
struct Video {
  ocl::Context& context = testing::shared_context();
  shared::ImageSize size;
  VerticalAlignment alignment;
  VerticalOffset offset{context};

  explicit Video(const Scene& scene, const VerticalAlignmentOptions& options = {})
      : size(scene.size), alignment(context, scene.size, scene.type, options, {context, scene.size}) {}

  FrameImages aligned(const Scene& scene) {
    const FrameImages images = upload(context, scene);
    FrameImages resampled{ocl::Buffer<cl_uchar>(context, images.pixels.size()), scene.type};
    alignment.resample(images, offset, resampled);
    return resampled;
  }

  void frame(const Scene& scene) {
    const StereoMaps measured = testing::upload(context, scene.size, scene.measured);
    const int passes = offset.is_known ? 1 : 2;
    for (int pass = 0; pass < passes; ++pass) {
      VerticalOffset improved(context);
      alignment.estimate(aligned(scene), measured.disparity, offset, improved);
      offset = improved;
    }
  }

  /// What the middle of the next frame will be resampled by.
  float next_offset() { return next().terms_px[0]; }
  reference::VerticalOffset next() { return read(context, offset); }
};

using Case = std::tuple<shared::ImageSize, PixelType, int>;

std::string name(const ::testing::TestParamInfo<Case>& info) {
  const auto [size, type, row_group] = info.param;
  return testing::name_of(size, type) + "_by_" + std::to_string(row_group);
}

class VerticalAlignmentTest : public ::testing::TestWithParam<Case> {};

TEST_P(VerticalAlignmentTest, EqualsReference) {
  const auto [size, type, row_group] = GetParam();
  Scene scene(size, {{-1.1f, 0.3f, -0.2f, 0.5f, 0.2f, -0.1f}}, type, 5.0f);
  const testing::HostMaps holes = testing::random_maps(size, -20, 30, 0.3, 23);
  for (std::size_t i = 0; i < scene.measured.disparity.size(); i += 3) scene.measured.disparity[i] = holes.disparity[i];

  ocl::Context& context = testing::shared_context();
  VerticalAlignment alignment(context, size, type, {.gain = 0.3f}, {context, size}, row_group);
  const FrameImages images = upload(context, scene);
  const StereoMaps measured = testing::upload(context, size, scene.measured);
  FrameImages aligned = upload(context, scene);
  VerticalOffset found(context);
  reference::VerticalOffset expected;
  for (int frame = 0; frame < 5; ++frame) {
    alignment.resample(images, found, aligned);
    const std::vector<int> expected_images = reference::resample(size, expected, scene.images);
    EXPECT_TRUE(testing::same_bits(download(context, aligned, scene), expected_images, size)) << "frame " << frame;
    expected =
        reference::estimate_offset(size, 0.3f, expected_images, scene.grey(), scene.measured.disparity, expected);
    VerticalOffset improved(context);
    VerticalOffset& after = frame == 2 ? found : improved;  // in place, and elsewhere
    alignment.estimate(aligned, measured.disparity, found, after);
    found = after;
    const reference::VerticalOffset offset = read(context, found);
    EXPECT_EQ(offset.terms_px, expected.terms_px) << "frame " << frame;
    EXPECT_EQ(offset.estimates, expected.estimates) << "frame " << frame;
  }
  EXPECT_EQ(expected.estimates, size.height > 90 ? 5 : 0);
}

INSTANTIATE_TEST_SUITE_P(Sizes, VerticalAlignmentTest,
                         ::testing::Combine(::testing::ValuesIn(testing::kSizes),
                                            ::testing::Values(PixelType::kU8, PixelType::kU16),
                                            ::testing::Values(1, 8)),
                         name);
INSTANTIATE_TEST_SUITE_P(WithHalfABlock, VerticalAlignmentTest,
                         ::testing::Combine(::testing::Values(shared::ImageSize{309, 97}),
                                            ::testing::Values(PixelType::kU8, PixelType::kU16), ::testing::Values(1)),
                         name);
INSTANTIATE_TEST_SUITE_P(Large, VerticalAlignmentTest,
                         ::testing::Values(std::tuple{testing::kLargest, PixelType::kU8, 8}), name);

constexpr shared::ImageSize kSize{320, 97};

TEST(VerticalAlignment, RecoversTheOffset) {
  const std::pair<float, PixelType> cases[] = {{-1.2f, PixelType::kU8},  {-0.41f, PixelType::kU16},
                                               {-0.1f, PixelType::kU8},  {0.0f, PixelType::kU8},
                                               {0.18f, PixelType::kU16}, {0.9f, PixelType::kU8}};
  for (const auto& [offset_px, type] : cases) {
    const Scene scene(kSize, offset_px, type, 1.0f);
    Video video(scene);
    video.frame(scene);
    EXPECT_NEAR(video.next_offset(), offset_px, 0.03) << "after the first frame";
    video.frame(scene);
    EXPECT_NEAR(video.next_offset(), offset_px, 0.02) << "after the second";
  }
}

// Of gradients that point against each other the sums are no matrix to step by; then the mean step is left.
TEST(VerticalAlignment, EqualsReferenceWhereTheViewsHaveNothingInCommon) {
  int mean_steps = 0;
  for (unsigned seed = 0; seed < 12; ++seed) {
    Scene scene(kSize, 0);
    std::mt19937 random(seed);
    for (int& grey : scene.images) grey = static_cast<int>(random() % 64);
    Video video(scene);
    video.alignment.estimate(upload(video.context, scene),
                             testing::upload(video.context, kSize, scene.measured).disparity, video.offset,
                             video.offset);
    const reference::VerticalOffset found = video.next();
    const reference::VerticalOffset expected =
        reference::estimate_offset(kSize, 0.25f, scene.images, 1, scene.measured.disparity, {});
    EXPECT_EQ(found.terms_px, expected.terms_px) << "seed " << seed;
    EXPECT_EQ(found.estimates, expected.estimates) << "seed " << seed;
    const auto is_zero = [](float term_px) { return term_px == 0; };
    mean_steps += found.terms_px[0] != 0 && std::all_of(found.terms_px.begin() + 1, found.terms_px.end(), is_zero);
  }
  EXPECT_GT(mean_steps, 0) << "the case that this is about";
}

// What a pair of KITTI has is like the first of these. The prior takes up to a tenth off them.
TEST(VerticalAlignment, RecoversEachTermOfTheOffset) {
  const reference::VerticalOffset offsets[] = {{{-0.45f, 0.1f, 0.05f, 1.2f, -0.4f, 0.0f}},
                                               {{0, 0.8f}},
                                               {{0, 0, -0.8f}},
                                               {{0, 0, 0, 0.8f}},
                                               {{0, 0, 0, 0, 0.8f}},
                                               {{0, 0, 0, 0, 0, -0.8f}}};
  for (const reference::VerticalOffset& offset : offsets) {
    const Scene scene({640, 240}, offset, PixelType::kU8, 1.0f);
    Video video(scene);
    for (int frame = 0; frame < 3; ++frame) video.frame(scene);
    const reference::VerticalOffset found = video.next();
    for (int y = 8; y < scene.size.height; y += 32) {
      for (int x = 8; x < scene.size.width; x += 32) {
        EXPECT_NEAR(reference::offset_at(scene.size, found, x, y), reference::offset_at(scene.size, offset, x, y), 0.15)
            << "at " << x << ", " << y << " of " << ::testing::PrintToString(offset.terms_px);
      }
    }
  }
}

TEST(VerticalAlignment, TakesTheOffsetOfAPatchForThatOfTheImage) {
  Scene scene(kSize, 0.5f, PixelType::kU8, 1.0f);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      if (x < 240 || y < 60)
        scene.measured.disparity[static_cast<std::size_t>(y) * kSize.width + x] = kInvalidDisparity;
    }
  }
  Video video(scene);
  for (int frame = 0; frame < 4; ++frame) video.frame(scene);
  const reference::VerticalOffset found = video.next();
  EXPECT_NEAR(reference::offset_at(kSize, found, 280, 80), 0.5, 0.03);
  EXPECT_NEAR(reference::offset_at(kSize, found, 10, 10), 0.5, 0.3);
}

TEST(VerticalAlignment, IsNotMisledByWrongMatchesOrByExposure) {
  Scene scene(kSize, -0.4f, PixelType::kU8, 1.0f);
  const testing::HostMaps wrong = testing::random_maps(kSize, 0, 60, 0, 29);
  for (std::size_t i = 0; i < scene.measured.disparity.size(); ++i) {
    if (i % 10 < 3) scene.measured.disparity[i] = wrong.disparity[i];
  }
  for (std::size_t i = pixel_count(kSize); i < scene.images.size(); ++i) scene.images[i] += 4;
  Video video(scene);
  for (int frame = 0; frame < 3; ++frame) video.frame(scene);
  EXPECT_NEAR(video.next_offset(), -0.4, 0.06);
}

TEST(VerticalAlignment, SettlesAndThenFollowsSlowly) {
  const Scene before(kSize, 0.2f), after(kSize, 0.6f);
  Video video(before, {.gain = 0.25f});
  for (int frame = 0; frame < 6; ++frame) video.frame(before);
  const float settled = video.next_offset();
  EXPECT_NEAR(settled, 0.2, 0.01);
  video.frame(after);
  EXPECT_NEAR(video.next_offset(), settled + 0.25 * 0.4, 0.02);
}

TEST(VerticalAlignment, KeepsWhatItKnowsWhereAFrameTellsNothing) {
  const Scene scene(kSize, 0.5f);
  Scene flat = scene, unmatched = scene;
  std::fill(flat.images.begin(), flat.images.end(), 90);
  unmatched.measured = testing::empty_maps(kSize);
  Video video(scene);
  video.frame(flat);
  EXPECT_EQ(video.next_offset(), 0);
  for (int frame = 0; frame < 3; ++frame) video.frame(scene);
  const float known = video.next_offset();
  EXPECT_NEAR(known, 0.5, 0.02) << "the empty frame does not weigh";
  video.frame(flat);
  video.frame(unmatched);
  EXPECT_EQ(video.next_offset(), known);
}

TEST(VerticalAlignment, StopsAtTwoPixels) {
  const Scene near(kSize, 1.5f), beyond(kSize, 2.4f);
  Video video(near);
  for (int frame = 0; frame < 2; ++frame) video.frame(near);
  for (int frame = 0; frame < 60; ++frame) video.frame(beyond);
  const reference::VerticalOffset found = video.next();
  for (const float term_px : found.terms_px) EXPECT_LE(std::abs(term_px), 2);
  EXPECT_EQ(found.terms_px[0], 2) << "the middle";
  EXPECT_EQ(reference::offset_at(kSize, {{2, 1, 1, 1, 1, 1}}, 319, 96), 2);
  EXPECT_EQ(reference::offset_at(kSize, {{-2, -1, -1, -1, -1, -1}}, 319, 96), -2);
}

}  // namespace
}  // namespace egosgm
