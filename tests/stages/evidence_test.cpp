// SPDX-License-Identifier: Apache-2.0
#include "host/stages/evidence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "host/stages/banded_sgm.h"
#include "host/stages/coarse_match.h"
#include "tests/reference/census.h"
#include "tests/reference/evidence.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::kNone;
constexpr int kDisparities = 24, kEarlier = 12345;

MethodOptions options() {
  MethodOptions options;
  options.disparities = kDisparities;
  return options;
}

/// Both views of an image with 16 bits, and of it at a quarter of the resolution.
struct Images {
  shared::ImageSize size;
  std::vector<std::uint16_t> full[2], coarse[2];

  explicit Images(shared::ImageSize size) : size(size) {
    const shared::ImageSize quarter = shared::coarse_size(size);
    for (int view = 0; view < 2; ++view)
      full[view].resize(pixel_count(size)), coarse[view].resize(pixel_count(quarter));
  }
  shared::ImageSize coarse_size() const { return shared::coarse_size(size); }

  reference::ViewCodes codes() const {
    return {size,
            {reference::codes(size, full[0], 16, MatchingCost::kCensus9x7),
             reference::codes(size, full[1], 16, MatchingCost::kCensus9x7)}};
  }
  reference::ViewCodes coarse_codes() const {
    return {coarse_size(),
            {reference::codes(coarse_size(), coarse[0], 16, MatchingCost::kCensus9x7),
             reference::codes(coarse_size(), coarse[1], 16, MatchingCost::kCensus9x7)}};
  }
  reference::ViewCodes coarse_alike() const {
    return {coarse_size(),
            {reference::alike_codes(coarse_size(), coarse[0]), reference::alike_codes(coarse_size(), coarse[1])}};
  }
};

Images noise(shared::ImageSize size, unsigned seed) {
  std::mt19937 random(seed);
  Images images(size);
  for (int view = 0; view < 2; ++view) {
    for (std::uint16_t& grey : images.full[view]) grey = static_cast<std::uint16_t>(random() % 65536);
    for (std::uint16_t& grey : images.coarse[view]) grey = static_cast<std::uint16_t>(random() % 65536);
  }
  return images;
}

/// The right view of it shows each column `disparity` to the left, at a quarter of the resolution as well.
Images shifted(Images images, int disparity) {
  const auto shift = [](std::vector<std::uint16_t>(&views)[2], shared::ImageSize size, int by) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x + by < size.width; ++x) views[1][y * size.width + x] = views[0][y * size.width + x + by];
    }
  };
  shift(images.full, images.size, disparity);
  shift(images.coarse, images.coarse_size(), disparity / 4);
  return images;
}

/// What the device says, without the gaps of its rows.
reference::BlockEvidence evidence_of(const Images& images, bool has_coarse, const std::vector<float>& found,
                                     const testing::HostMaps& predicted, const testing::HostMaps& measured, int pixels,
                                     Views views = Views::kBoth) {
  ocl::Context& context = testing::shared_context();
  const shared::ImageSize size = images.size, quarter = images.coarse_size();
  const int padding = BandedSgm::code_padding(range_of(options()));
  const reference::ViewCodes of_views = images.codes();
  const auto codes = testing::on_device(context, reference::padded_codes(size, of_views.of_view[0], of_views.of_view[1],
                                                                         padding, MatchingCost::kCensus9x7));
  std::vector<std::uint16_t> greys = images.coarse[0];
  greys.insert(greys.end(), images.coarse[1].begin(), images.coarse[1].end());
  const FrameImages coarse_images = testing::images_of(context, greys, PixelType::kU16);
  const Map coarse_disparity = testing::on_device(context, found);
  const CoarseView coarse{coarse_images.pixels, coarse_disparity};
  const StereoMaps prediction = testing::upload(context, size, predicted);
  const StereoMaps measurement = testing::upload(context, size, measured);
  BlockEvidence blocks(context, size);
  blocks.evidence.write(context, std::vector<cl_int>(blocks.evidence.size(), kEarlier));
  blocks.found.write(context, std::vector<float>(blocks.found.size(), 777));
  Evidence evidence(context, size, options(), pixels);
  evidence(codes, has_coarse ? &coarse : nullptr, prediction.disparity, measurement.disparity, blocks, views);
  const std::vector<cl_int> padded = blocks.evidence.read(context);
  const std::vector<float> padded_found = blocks.found.read(context);
  const int stride = static_cast<int>(padded.size()) / (2 * quarter.height);
  reference::BlockEvidence result;
  for (int row = 0; row < 2 * quarter.height; ++row) {
    for (int x = 0; x < quarter.width; ++x) {
      result.evidence.push_back(padded[row * stride + x]);
      result.found.push_back(padded_found[row * stride + x]);
    }
  }
  return result;
}

testing::HostMaps everywhere(shared::ImageSize size, float disparity) {
  return {std::vector<float>(2 * pixel_count(size), disparity), std::vector<float>(2 * pixel_count(size), 1.0f)};
}

std::vector<float> nothing_found(const Images& images) {
  return std::vector<float>(2 * pixel_count(images.coarse_size()), kNone);
}

double mean(const std::vector<int>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

EGOSGM_TEST_AT_ALL_SIZES(EvidenceTest);

TEST_P(EvidenceTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  const Images images = shifted(noise(size, 3), 8);
  testing::HostMaps predicted = testing::random_maps(size, 0, kDisparities - 1, 0.3, 4);
  const testing::HostMaps measured = testing::random_maps(size, 0, kDisparities - 1, 0.3, 5);
  for (std::size_t i = 0; i < predicted.disparity.size(); ++i) {
    if (i % 3 == 0) predicted.disparity[i] = 8;
    if (i % 7 == 0) predicted.disparity[i] = 8.5f;  // a tie of rounding
  }
  std::vector<float> found = testing::random_maps(images.coarse_size(), 0, 5, 0.3, 6).disparity;
  for (const bool has_coarse : {true, false}) {
    std::optional<reference::CoarseView> coarse;
    if (has_coarse) coarse = reference::CoarseView{images.coarse_codes(), images.coarse_alike(), found};
    const reference::BlockEvidence expected = reference::block_evidence(3, images.codes(), coarse, predicted, measured);
    const std::size_t blocks = expected.evidence.size();
    for (const int pixels : {1, 16}) {
      SCOPED_TRACE("by " + std::to_string(pixels) + (has_coarse ? " with" : " without") + " a coarse match");
      const reference::BlockEvidence actual = evidence_of(images, has_coarse, found, predicted, measured, pixels);
      EXPECT_EQ(actual.evidence, expected.evidence);
      EXPECT_EQ(actual.found, expected.found);
      const auto of_left = evidence_of(images, has_coarse, found, predicted, measured, pixels, Views::kLeft).evidence;
      EXPECT_EQ(of_left, testing::left_and_right(expected.evidence, std::vector<int>(blocks, kEarlier)));
    }
  }
}

constexpr shared::ImageSize kSize{320, 97};

TEST(Evidence, IsNothingInNoise) {
  const Images images = noise(kSize, 1);
  const testing::HostMaps predicted = everywhere(kSize, 9);
  const auto blocks = evidence_of(images, true, nothing_found(images), predicted, predicted, 0);
  // The least of five means lies a little below the mean, by how much noise scatters.
  EXPECT_LT(mean(blocks.evidence), 0);
  EXPECT_GT(mean(blocks.evidence), 16 * -3);
  // A window asks one row of four, 100 pixels, whose means scatter by so much.
  EXPECT_LT(*std::max_element(blocks.evidence.begin(), blocks.evidence.end()), 16 * 9) << "9 bits";
}

TEST(Evidence, CountsFourPixelsWithoutADisparityAsOneWithNone) {
  const Images images = shifted(noise(kSize, 1), 8);
  const testing::HostMaps everything = everywhere(kSize, 8);
  testing::HostMaps half = everything;
  for (std::size_t i = 0; i < half.disparity.size(); i += 2) half.disparity[i] = kNone;
  const auto all = evidence_of(images, false, nothing_found(images), everything, everything, 0);
  const auto sparse = evidence_of(images, false, nothing_found(images), half, half, 0);
  EXPECT_NEAR(mean(sparse.evidence) / mean(all.evidence), 4.0 / (4 + 1), 0.02);
}

TEST(Evidence, IsAThirdOfTheBitsOfAMatchWithoutNoise) {
  const Images images = shifted(noise(kSize, 1), 8);
  const testing::HostMaps right = everywhere(kSize, 8), wrong = everywhere(kSize, 12);
  const auto confirmed = evidence_of(images, true, nothing_found(images), right, right, 0);
  const auto fine = evidence_of(images, false, nothing_found(images), right, right, 0);
  const auto chance = evidence_of(images, true, nothing_found(images), wrong, wrong, 0);
  EXPECT_GT(mean(confirmed.evidence), 16 * 30) << "both resolutions";
  EXPECT_GT(mean(fine.evidence), 16 * 20) << "one";
  EXPECT_LT(mean(fine.evidence), 16 * 31);
  EXPECT_LT(mean(chance.evidence), 0);
}

// Beside a textured wall, a plain place has none: the half of its window that has no texture says so.
TEST(Evidence, DoesNotReachOverAnEdge) {
  Images images = shifted(noise(kSize, 1), 8);
  const Images other = noise(kSize, 2);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < kSize.width; ++x) images.full[1][y * kSize.width + x] = other.full[1][y * kSize.width + x];
  }
  const testing::HostMaps predicted = everywhere(kSize, 8);
  const auto blocks = evidence_of(images, false, nothing_found(images), predicted, predicted, 0);
  const int columns = images.coarse_size().width;
  const auto row = [&](int y) {
    return mean({blocks.evidence.begin() + y * columns + 4, blocks.evidence.begin() + (y + 1) * columns - 4});
  };
  EXPECT_GT(row(16), 16 * 15) << "well within the texture";
  EXPECT_LT(row(11), 16 * 5) << "the last plain row but its census window";
  EXPECT_LT(row(9), 24);
}

// A plain place beside a bright thing, whose outline the codes at a quarter of the resolution show from afar.
TEST(Evidence, DoesNotSeeAnOutlineFromAfar) {
  Images images = noise(kSize, 1);
  const int columns = images.coarse_size().width, rows = images.coarse_size().height, edge = columns / 2;
  for (int view = 0; view < 2; ++view) {
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < columns; ++x) {
        std::uint16_t& grey = images.coarse[view][y * columns + x];
        grey = static_cast<std::uint16_t>(grey % 512 + (x + 2 * view < edge ? 20000 : 60000));
      }
    }
  }
  const testing::HostMaps predicted = everywhere(kSize, 8);
  const auto blocks = evidence_of(images, true, nothing_found(images), predicted, predicted, 0);
  std::vector<int> beside;
  for (int y = 4; y + 4 < rows; ++y) {
    for (int x = edge - 4; x < edge; ++x) beside.push_back(blocks.evidence[y * columns + x]);
  }
  EXPECT_LT(mean(beside), 24) << "the noise of the plain place is all that is asked";
}

TEST(Evidence, AsksThePredictionUnlessTheMeasurementContradictsIt) {
  const Images images = shifted(noise(kSize, 1), 8);
  const testing::HostMaps right = everywhere(kSize, 8), wrong = everywhere(kSize, 15), none = everywhere(kSize, kNone);
  const auto of = [&](const testing::HostMaps& predicted, const testing::HostMaps& measured) {
    return mean(evidence_of(images, false, nothing_found(images), predicted, measured, 0).evidence) / 16;
  };
  EXPECT_GT(of(right, none), 20);
  EXPECT_GT(of(none, right), 20);
  EXPECT_GT(of(wrong, right), 20) << "contradicted: the measurement is asked";
  EXPECT_LT(of(everywhere(kSize, 10), right), 2) << "within the gate: the prediction is";
  EXPECT_EQ(of(none, none), 0);
}

TEST(Evidence, GivesOutWhatHasMuchOrIsSupported) {
  constexpr shared::ImageSize kSmall{65, 37};
  testing::HostMaps maps = testing::random_maps(kSmall, 0, 9, 0.2, 8);
  maps.disparity[10] = 5.5f;
  for (std::size_t i = 0; i < maps.disparity.size(); ++i) {
    maps.evidence.push_back(static_cast<std::uint8_t>(i % 7 < 5 ? 28 + i * 5 % 8 : 94 + i % 4));
  }
  for (const int pixels : {1, 16}) {
    for (const Views tracked : {Views::kBoth, Views::kLeft}) {
      ocl::Context& context = testing::shared_context();
      const StereoMaps on_device = testing::upload(context, kSmall, maps);
      FlagMap evidence = testing::on_device(context, maps.evidence);
      Map published = testing::upload(context, kSmall, testing::random_maps(kSmall, 0, 9, 0.2, 9)).disparity;
      Evidence stage(context, kSmall, options(), pixels);
      const std::vector<float> expected = reference::confirmed(kSmall, maps, tracked == Views::kLeft);
      stage.publish(on_device.disparity, evidence, published, Views::kBoth, tracked);
      EXPECT_TRUE(testing::same_bits(published.read(context), expected, kSmall)) << "by " << pixels;
    }
  }
}

// A pixel without evidence of its own, on the surface of some that are 8, 16 and 24 px away.
TEST(Evidence, PublishesWhatHasLittleWithinASurface) {
  constexpr shared::ImageSize kSurface{65, 65};
  struct Place {
    int dx, dy;
  };
  using Places = std::vector<Place>;
  const auto publishes = [&](float d, const Places& supporters, int of_them, int of_pixel, int x = 32, int y = 32) {
    testing::HostMaps maps = testing::empty_maps(kSurface);
    maps.evidence.assign(maps.disparity.size(), 0);
    const auto set = [&](int u, int v, float disparity, int evidence) {
      maps.disparity[v * kSurface.width + u] = disparity;
      maps.evidence[v * kSurface.width + u] = static_cast<std::uint8_t>(evidence);
    };
    set(x, y, d, of_pixel);
    for (const Place& place : supporters) set(x + place.dx, y + place.dy, 20, of_them);
    ocl::Context& context = testing::shared_context();
    FlagMap evidence = testing::on_device(context, maps.evidence);
    Map published(context, maps.disparity.size());
    Evidence(context, kSurface, options())
        .publish(testing::upload(context, kSurface, maps).disparity, evidence, published, Views::kBoth, Views::kBoth);
    return published.read(context)[y * kSurface.width + x] == d;
  };
  const Places around = {{-8, 0}, {8, 0}, {0, -8}, {0, 8}};
  EXPECT_TRUE(publishes(20, around, 64, 0));
  EXPECT_TRUE(publishes(20, {{-24, -24}, {24, 24}}, 64, 0)) << "corners lie on two sides each";
  EXPECT_FALSE(publishes(20, {{8, 0}, {0, -8}, {0, 8}}, 64, 95)) << "none on the left";
  EXPECT_FALSE(publishes(20, {{-8, 0}, {0, -8}, {0, 8}}, 64, 95)) << "none on the right";
  EXPECT_FALSE(publishes(20, {{-8, 0}, {8, 0}, {0, 8}}, 64, 95)) << "none above";
  EXPECT_FALSE(publishes(20, {{-8, 0}, {8, 0}, {0, -8}}, 64, 95)) << "none below";
  EXPECT_FALSE(publishes(20, {{-32, 0}, {32, 0}, {0, -32}, {0, 32}}, 64, 95)) << "too far";
  EXPECT_FALSE(publishes(20, around, 63, 95)) << "not confirmed";
  EXPECT_TRUE(publishes(24, around, 64, 0)) << "a slope";
  EXPECT_FALSE(publishes(24.5f, around, 64, 0)) << "another surface";
  EXPECT_TRUE(publishes(20, {}, 0, 96)) << "it has much itself";
  EXPECT_TRUE(publishes(20, {{8, 0}, {0, 8}}, 64, 0, 7, 7)) << "the image ends on the left and above";
  EXPECT_TRUE(publishes(20, {{-8, 0}, {0, -8}}, 64, 0, 57, 57)) << "the image ends on the right and below";
  EXPECT_FALSE(publishes(20, {{8, 0}, {0, 8}}, 64, 95, 8, 7)) << "it does not end on the left yet";
  EXPECT_FALSE(publishes(20, {{-8, 0}, {0, -8}}, 64, 95, 56, 57)) << "nor on the right";
  EXPECT_FALSE(publishes(20, {{8, 0}, {0, 8}}, 64, 95, 7, 8)) << "nor above";
  EXPECT_FALSE(publishes(20, {{-8, 0}, {0, -8}}, 64, 95, 57, 56)) << "nor below";
}

TEST(Evidence, NeedsCodesOfTwoWords) {
  MethodOptions method;
  EXPECT_TRUE(Evidence::is_of(method));
  method.banded_sgm.cost = MatchingCost::kSad3x3;
  EXPECT_FALSE(Evidence::is_of(method));
  EXPECT_FALSE(Evidence::is_of(PipelineOptions::paper()));
}

}  // namespace
}  // namespace egosgm
