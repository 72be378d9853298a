// SPDX-License-Identifier: Apache-2.0
// Features of one image, positions below a pixel, and circles of matches.
#include "host/odometry/features.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "host/odometry/matching.h"
#include "host/odometry/subpixel.h"
#include "tests/odometry/motions.h"

namespace egosgm {
namespace {

int filter_response(const odometry::GreyImage& image, int x, int y, bool corner) {
  static const int kBlob[5][5] = {
      {-1, -1, -1, -1, -1}, {-1, 1, 1, 1, -1}, {-1, 1, 8, 1, -1}, {-1, 1, 1, 1, -1}, {-1, -1, -1, -1, -1}};
  static const int kCorner[5][5] = {
      {1, 1, 0, -1, -1}, {1, 1, 0, -1, -1}, {0, 0, 0, 0, 0}, {-1, -1, 0, 1, 1}, {-1, -1, 0, 1, 1}};
  int sum = 0;
  for (int i = -2; i <= 2; ++i) {
    for (int j = -2; j <= 2; ++j) sum += (corner ? kCorner : kBlob)[i + 2][j + 2] * image.row(y + i)[x + j];
  }
  return sum;
}

TEST(OdometryFeatures, EqualsFiltersAndSuppressionAsWrittenInThePaper) {
  std::mt19937 generator(11);
  const odometry::GreyImage image = random_image(generator, 101, 67);
  odometry::FeatureDetector detector;
  odometry::FeatureSet set;
  detector.detect(image, 300, 1 << 20, set);
  int expected = 0;
  for (int c = 0; c < odometry::kFeatureClasses; ++c) {
    const int sign = c % 2 == 0 ? 1 : -1;
    for (int y = 9; y < image.height - 9; ++y) {
      int k = set.first_of_row(c, y);
      for (int x = 9; x < image.width - 9; ++x) {
        const int response = sign * filter_response(image, x, y, c >= 2);
        bool largest = response >= 300;
        for (int i = -2; i <= 2 && largest; ++i) {
          for (int j = -2; j <= 2; ++j) {
            if (sign * filter_response(image, x + j, y + i, c >= 2) > response) largest = false;
          }
        }
        if (!largest) continue;
        ++expected;
        ASSERT_LT(k, set.first_of_row(c, y + 1)) << "class " << c << ": no feature at " << x << ", " << y;
        EXPECT_EQ(set.features[k].x, x) << "class " << c << ", row " << y;
        EXPECT_EQ(set.features[k].y, y);
        EXPECT_EQ(set.features[k].strength, response);
        ++k;
      }
      ASSERT_EQ(k, set.first_of_row(c, y + 1)) << "class " << c << ", row " << y;
    }
  }
  EXPECT_EQ(set.size(), expected);
  EXPECT_GT(expected, 100);
}

TEST(OdometryFeatures, ThoseOfHalfTheSizeLieInTheImageAtTwiceTheirPlace) {
  std::mt19937 generator(13);
  const odometry::GreyImage image = random_image(generator, 203, 145);
  odometry::GreyImage half;
  odometry::halve(image, half);
  ASSERT_EQ(half.width, 101);
  ASSERT_EQ(half.height, 72);
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < half.width; ++x) {
      const int sum = image.row(2 * y)[2 * x] + image.row(2 * y)[2 * x + 1] + image.row(2 * y + 1)[2 * x] +
                      image.row(2 * y + 1)[2 * x + 1];
      ASSERT_EQ(half.row(y)[x], (sum + 2) / 4) << x << ", " << y;
    }
  }
  odometry::FeatureDetector detector;
  odometry::FeatureSet small, set;
  detector.detect(half, 100, 1 << 20, small);
  set = small;
  odometry::enlarge(set, image.height);
  ASSERT_GT(set.size(), 100);
  for (int c = 0; c < odometry::kFeatureClasses; ++c) {
    int k = small.first_of_row(c, 0);
    for (int y = 0; y < image.height; ++y) {
      ASSERT_EQ(set.first_of_row(c, y), k) << "class " << c << ", row " << y;
      for (; k < set.size() && set.classes[k] == c && 2 * small.features[k].y == y; ++k) {
        EXPECT_EQ(set.features[k].x, 2 * small.features[k].x);
        EXPECT_EQ(set.features[k].y, y);
      }
    }
    EXPECT_EQ(set.first_of_row(c, image.height), k);
  }
}

TEST(OdometryFeatures, KeepsTheStrongestOfEveryCell) {
  std::mt19937 generator(17);
  odometry::GreyImage image = random_image(generator, 203, 145);
  for (auto& pixel : image.pixels) pixel &= 0xc0;  // many of the same strength: the upper and left ones stay
  odometry::FeatureDetector detector;
  odometry::FeatureSet all, kept;
  detector.detect(image, 100, 1 << 20, all);
  for (const int per_class : {1, 3}) {
    detector.detect(image, 100, per_class * odometry::kFeatureClasses, kept);
    int next = 0;
    for (int i = 0; i < all.size(); ++i) {
      const odometry::Feature& feature = all.features[i];
      int before = 0;  // in its cell and class
      for (int k = 0; k < all.size(); ++k) {
        const odometry::Feature& other = all.features[k];
        if (all.classes[k] != all.classes[i] || other.x / 64 != feature.x / 64 || other.y / 64 != feature.y / 64)
          continue;
        if (other.strength > feature.strength || (other.strength == feature.strength && k < i)) ++before;
      }
      if (before >= per_class) continue;
      ASSERT_LT(next, kept.size()) << "no feature at " << feature.x << ", " << feature.y;
      EXPECT_EQ(kept.features[next].x, feature.x) << "feature " << next << " of " << per_class;
      EXPECT_EQ(kept.features[next].y, feature.y) << "feature " << next << " of " << per_class;
      EXPECT_EQ(kept.descriptors[next], all.descriptors[i]) << "feature " << next << " of " << per_class;
      ++next;
    }
    EXPECT_EQ(next, kept.size());
  }
}

TEST(OdometryFeatures, DescriptorsDoNotDependOnBrightnessAndContrast) {
  std::mt19937 generator(12);
  odometry::GreyImage image = random_image(generator, 60, 60), dimmed = image;
  for (auto& pixel : dimmed.pixels) pixel = static_cast<std::uint8_t>(20 + pixel * 6 / 10);
  odometry::FeatureDetector detector;
  odometry::FeatureSet bright, dark;
  detector.detect(image, 600, 1 << 20, bright);
  detector.detect(dimmed, 200, 1 << 20, dark);
  int common = 0;
  for (int i = 0; i < bright.size(); ++i) {
    for (int j = 0; j < dark.size(); ++j) {
      if (bright.features[i].x != dark.features[j].x || bright.features[i].y != dark.features[j].y) continue;
      ++common;
      EXPECT_LT(odometry::descriptor_distance(bright.descriptors[i], dark.descriptors[j]),
                4 * odometry::kDescriptorSize);
    }
  }
  EXPECT_GT(common, 20);
}

// A sum of waves, smooth and without period in the patch.
double texture(double x, double y) {
  return 128 + 40 * std::sin(0.7 * x + 0.2 * y) + 35 * std::sin(0.55 * y - 0.3 * x + 1) +
         20 * std::sin(0.9 * x + 0.8 * y);
}

TEST(OdometrySubpixel, FindsShiftUnderExposureChange) {
  odometry::GreyImage first, second;
  for (auto* image : {&first, &second}) {
    image->width = image->height = 64;
    image->pixels.resize(64 * 64);
  }
  const double shift_x = 1.37, shift_y = -0.61;
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      first.row(y)[x] = static_cast<std::uint8_t>(std::lround(texture(x, y)));
      second.row(y)[x] = static_cast<std::uint8_t>(std::lround(30 + 0.6 * texture(x - shift_x, y - shift_y)));
    }
  }
  for (const auto& [first_x, first_y] : {std::pair{30.0f, 31.0f}, {30.25f, 31.2f}}) {
    odometry::Patch patch;
    ASSERT_TRUE(odometry::make_patch(first, first_x, first_y, 1.0f, patch));
    float x = first_x, y = first_y;
    ASSERT_TRUE(odometry::align_patch(patch, second, 0.9f, x, y));
    EXPECT_NEAR(x, first_x + shift_x, 0.02);
    EXPECT_NEAR(y, first_y + shift_y, 0.02);
  }
}

TEST(OdometrySubpixel, RefusesFlatPatchAndFarMove) {
  odometry::GreyImage flat;
  flat.width = flat.height = 40;
  flat.pixels.assign(1600, 90);
  odometry::Patch patch;
  EXPECT_FALSE(odometry::make_patch(flat, 20, 20, 1.0f, patch));
  odometry::GreyImage edge = flat;  // a straight edge fixes no position along itself
  for (int y = 0; y < 40; ++y) std::fill(edge.row(y) + 20, edge.row(y) + 40, std::uint8_t{200});
  EXPECT_FALSE(odometry::make_patch(edge, 20, 20, 1.0f, patch));
}

// One image's features, all of class 0, in the order of their rows.
odometry::FeatureSet feature_set(const std::vector<odometry::Feature>& features,
                                 const std::vector<odometry::Descriptor>& descriptors, int height) {
  odometry::FeatureSet set;
  set.height = height;
  set.features = features;
  set.descriptors = descriptors;
  set.classes.assign(features.size(), 0);
  set.row_begin.assign(odometry::kFeatureClasses * (height + 1), static_cast<int>(features.size()));
  for (int y = 0; y <= height; ++y) {
    set.row_begin[y] = static_cast<int>(
        std::count_if(features.begin(), features.end(), [y](const odometry::Feature& f) { return f.y < y; }));
  }
  return set;
}

// The last leg leads to another feature of the previous right image when that one looks more alike.
TEST(OdometryMatching, KeepsClosedCirclesOnly) {
  odometry::Descriptor grey, brighter;
  grey.fill(100);
  brighter.fill(108);
  for (const bool closes : {true, false}) {
    odometry::TrackedFrame previous, current;
    for (auto* frame : {&previous, &current}) {
      for (auto* image : {&frame->left, &frame->right}) {
        image->width = 200;
        image->height = 60;
      }
    }
    previous.left_features = feature_set({{100, 30, 50}}, {grey}, 60);
    previous.right_features = feature_set({{90, 30, 50}, {93, 33, 50}}, {grey, closes ? grey : brighter}, 60);
    current.left_features = feature_set({{104, 31, 50}}, {grey}, 60);
    current.right_features = feature_set({{94, 31, 50}}, {brighter}, 60);
    previous.reset_matches();
    current.reset_matches();
    const auto matches = odometry::match_circle(kitti_calibration(), previous, current, {0}, nullptr, {20, 10}, 60);
    ASSERT_EQ(matches.size(), closes ? 1u : 0u);
    if (closes) {
      EXPECT_EQ(matches[0].previous_right, 0);
    }
  }
}

}  // namespace
}  // namespace egosgm
