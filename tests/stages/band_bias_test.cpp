// SPDX-License-Identifier: Apache-2.0
// Lanes of a band that cannot win take part in the paths. They must not draw surfaces to one side, whatever the band's
// width is.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "host/stages/matcher.h"
#include "host/stages/search_band.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

constexpr shared::ImageSize kSize{320, 160};
constexpr shared::DisparityRange kRange{0, 64};

float truth_at(int x, int y) { return 20.0f + 0.021f * static_cast<float>(x) + 0.033f * static_cast<float>(y); }

/// A slanted surface whose texture is so many grey values strong, with noise of two grey values.
std::vector<cl_uchar> slanted_pair(double texture, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<cl_uchar> pixels(2 * pixel_count(kSize));
  for (int y = 0; y < kSize.height; ++y) {
    std::vector<double> row(kSize.width + 80);
    for (double& grey : row) grey = 120 + texture * normal(random);
    for (int x = 0; x < kSize.width; ++x) {
      // The left pixel x is the right pixel x - d: the surface is painted in columns of the right view.
      const auto grey_at = [&](double column) {
        const int whole = static_cast<int>(std::floor(column));
        return row[whole + 40] + (column - whole) * (row[whole + 41] - row[whole + 40]);
      };
      const auto noisy = [&](double grey) { return static_cast<cl_uchar>(std::lround(grey + 2 * normal(random))); };
      pixels[y * kSize.width + x] = noisy(grey_at(x - truth_at(x, y)));
      pixels[pixel_count(kSize) + y * kSize.width + x] = noisy(grey_at(x));
    }
  }
  return pixels;
}

/// Matches frame after frame in bands of a half-width around what the frame before gave, the first in bands around the
/// surface; half-width 0: in the full range. The mean signed error of the last one [px], of what lies near the surface.
double bias(double texture, float half_width_px, int frames, Scheduling scheduling) {
  ocl::Context& context = testing::shared_context();
  BandedSgmOptions options;
  options.scheduling = scheduling;
  testing::HostMaps surface = testing::empty_maps(kSize);
  const int pixels = kSize.width * kSize.height;
  for (int i = 0; i < 2 * pixels; ++i) {
    const int x = i % kSize.width, y = i % pixels / kSize.width;
    surface.disparity[i] = truth_at(x, y);
    surface.variance[i] = 0.01f;
  }
  SearchBand search_band(context, kSize, kRange, {.min_half_width_px = half_width_px, .from_neighbours = false});
  SearchBands bands(context, kSize, kRange);
  Matcher matcher(context, kSize, kRange, options);
  matcher.prepare(PixelType::kU8);
  FrameImages images{ocl::Buffer<cl_uchar>(context, 2 * pixel_count(kSize)), PixelType::kU8};
  StereoMaps predicted = testing::upload(context, kSize, surface);
  StereoMaps matched(context, kSize);
  for (int frame = 0; frame < frames; ++frame) {
    images.pixels.write(context, slanted_pair(texture, 7 + frame));
    if (half_width_px > 0) search_band.narrow(predicted, nullptr, bands, Views::kBoth);
    matcher.match(images, bands, matched, Views::kBoth);
    predicted.disparity.write(context, matched.disparity.read(context));
  }
  const std::vector<float> disparity = matched.disparity.read(context);
  double sum = 0;
  int count = 0;
  for (int i = 0; i < pixels; ++i) {
    const int x = i % kSize.width;
    if (x < 60 || x >= kSize.width - 20) continue;
    const double error = disparity[i] - truth_at(x, i / kSize.width);
    if (half_width_px == 0 && std::abs(error) > 3) continue;
    sum += error;
    ++count;
  }
  return sum / count;
}

class BandBiasTest : public ::testing::TestWithParam<Scheduling> {};

constexpr int kFrames = 6;  // errors add up from frame to frame

// Noise of two grey values covers texture that is fainter.
TEST_P(BandBiasTest, NarrowBandsDrawNoPlainSurfaceToASide) {
  for (const double texture : {0.5, 1.0, 2.0, 6.0}) {
    const double most = std::abs(bias(texture, 0, 1, GetParam())) + 0.05;
    for (const float half_width : {2.0f, 2.5f, 3.0f, 3.5f}) {
      EXPECT_LT(std::abs(bias(texture, half_width, kFrames, GetParam())), most)
          << "texture " << texture << ", half-width " << half_width;
    }
  }
}

TEST_P(BandBiasTest, NorDoWideOnesAFaintlyTexturedOne) {
  for (const double texture : {2.0, 6.0}) {
    const double of_full_range = bias(texture, 0, 1, GetParam());
    for (const float half_width : {5.0f, 7.0f, 10.0f}) {
      EXPECT_NEAR(bias(texture, half_width, kFrames, GetParam()), of_full_range, 0.05)
          << "texture " << texture << ", half-width " << half_width;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Schedulings, BandBiasTest, ::testing::Values(Scheduling::kWavefront, Scheduling::kPaths));

}  // namespace
}  // namespace egosgm
