// SPDX-License-Identifier: Apache-2.0
// Lanes of a band that cannot win take part in the paths. They must not draw surfaces to one side, whatever the band's
// width is.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "host/match/matcher.h"
#include "host/search/search_band.h"
#include "tests/support/device.h"
#include "tests/support/device_maps.h"

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

/// The mean signed error [px] of what is matched near the surface, in bands of this half-width; 0: the full range.
double bias(double texture, float half_width_px, Scheduling scheduling) {
  ocl::Context context(testing::any_device());
  BandedSgmOptions options;
  options.scheduling = scheduling;
  FrameImages images{ocl::Buffer<cl_uchar>(context, 2 * pixel_count(kSize)), PixelType::kU8};
  images.pixels.write(context, slanted_pair(texture, 7));
  testing::HostMaps surface = testing::empty_maps(kSize);
  for (int i = 0; i < kSize.width * kSize.height; ++i) {
    surface.disparity[i] = truth_at(i % kSize.width, i / kSize.width);
    surface.variance[i] = 0.01f;
  }
  const StereoMaps predicted = testing::upload(context, kSize, surface);
  SearchBand search_band(context, kSize, kRange, {.min_half_width_px = half_width_px, .from_neighbours = false});
  SearchBands bands(context, kSize, kRange);
  if (half_width_px > 0) search_band(predicted, nullptr, bands, Views::kBoth);
  Matcher matcher(context, kSize, kRange, options);
  matcher.prepare(PixelType::kU8);
  Measurement matched(context, kSize);
  matcher(images, bands, matched, Views::kBoth);
  const std::vector<float> disparity = matched.disparity.read(context);
  double sum = 0;
  int count = 0;
  for (int i = 0; i < kSize.width * kSize.height; ++i) {
    const double error = disparity[i] - truth_at(i % kSize.width, i / kSize.width);
    if (i % kSize.width < 40 || !(std::abs(error) <= 3)) continue;
    sum += error;
    ++count;
  }
  return sum / count;
}

class BandBiasTest : public ::testing::TestWithParam<Scheduling> {};

TEST_P(BandBiasTest, NoWidthDrawsASlantedSurfaceToASide) {
  for (const double texture : {2.0, 6.0}) {
    const double of_full_range = bias(texture, 0, GetParam());
    for (const float half_width : {2.0f, 2.5f, 3.0f, 3.5f, 5.0f, 7.0f, 10.0f}) {
      EXPECT_NEAR(bias(texture, half_width, GetParam()), of_full_range, 0.05)
          << "texture " << texture << ", half-width " << half_width;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Schedulings, BandBiasTest, ::testing::Values(Scheduling::kWavefront, Scheduling::kPaths));

}  // namespace
}  // namespace egosgm
