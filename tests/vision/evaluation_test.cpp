// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/evaluation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "egosgm/vision/disparity_io.h"
#include "tests/support/expect_refused.h"
#include "tests/support/files.h"
#include "tests/vision/data_folder.h"
#include "tests/vision/images.h"
#include "vision/file_io.h"
#include "vision/pair_with_truth.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

constexpr float kNo = kInvalidDisparity;

/// All but the sky's.
std::vector<std::int64_t> numbers(const DisparityCounts& c) {
  return {c.truth, c.valid, c.bad, c.d1, c.bad_interpolated, c.d1_interpolated, c.bad_1px};
}

TEST(Evaluation, CountsByTheRules) {
  // Errors: 3 (good), 3.5 of 100 (bad, not D1), 6 of 100 (bad and D1), missing (filled with 106: 6, bad), no truth.
  const Image truth = map_from(1, {100, 100, 100, 112, kNo});
  const Image estimate = map_from(1, {97, 103.5f, 106, kNo, 200});
  const DisparityCounts counts = compare_disparity(estimate, truth);
  EXPECT_EQ(numbers(counts), (std::vector<std::int64_t>{4, 3, 2, 1, 3, 2, 3}));
  EXPECT_DOUBLE_EQ(counts.absolute_error_px, 12.5);
  EXPECT_DOUBLE_EQ(counts.signed_error_px, 6.5);
  const DisparityMetrics metrics = metrics_of(counts);
  const std::tuple<const char*, double, double> expected[] = {
      {"bad or missing", metrics.bad_or_missing, 75},
      {"bad of valid", metrics.bad_of_valid, 200.0 / 3},
      {"density", metrics.density, 75},
      {"interpolated", metrics.interpolated, 75},
      {"D1", metrics.d1, 50},
      {"D1 interpolated", metrics.d1_interpolated, 50},
      {"MAE", metrics.mae_px, 12.5 / 3},
      {"mean error", metrics.mean_error_px, 6.5 / 3},
      {"bad at 1 px", metrics.bad_1px, 100}};  // three of four, and a hole
  for (const auto& [name, value, known] : expected) EXPECT_DOUBLE_EQ(value, known) << name;
}

TEST(Evaluation, AHoleInTheSkyIsRightAndASurfaceThereIsWrong) {
  // A surface and a hole in one; then sky: right at 3 px, wrong at 3.5 px, a hole that would be filled with 3.5 px.
  const Image truth = map_from(1, {10, 10, 0, 0, 1.0f / 256});
  const Image estimate = map_from(1, {10, kNo, 3, 3.5f, kNo});
  const DisparityCounts counts = compare_disparity(estimate, truth);
  EXPECT_EQ(counts.sky, 3);
  EXPECT_EQ(counts.sky_valid, 2);
  EXPECT_EQ(counts.bad, 1);
  EXPECT_EQ(counts.bad_interpolated, 2) << "the hole in the surface, and the wrong surface";
  EXPECT_EQ(counts.d1_interpolated, 2);
  const DisparityMetrics metrics = metrics_of(counts);
  EXPECT_DOUBLE_EQ(metrics.density, 50) << "of the two pixels with a surface";
  EXPECT_DOUBLE_EQ(metrics.filled, 60);
  EXPECT_DOUBLE_EQ(metrics.wrong_of_all, 20);
  EXPECT_DOUBLE_EQ(metrics.bad_of_valid, 100.0 / 3);
  EXPECT_DOUBLE_EQ(metrics.bad_or_missing, 40);
  EXPECT_DOUBLE_EQ(metrics.d1, 40);
  EXPECT_DOUBLE_EQ(mean_of({metrics}).filled, 60);
  EXPECT_DOUBLE_EQ(mean_of({metrics}).wrong_of_all, 20);
  DisparityCounts twice = counts;
  twice += counts;
  EXPECT_DOUBLE_EQ(metrics_of(twice).density, 50);
}

TEST(Evaluation, OneStepOfKittisPngIsSkyAndTwoAreNot) {
  for (const float sky : {0.0f, 1.0f / 256}) EXPECT_TRUE(is_sky(sky)) << sky;
  for (const float no_sky : {2.0f / 256, 1.0f, -0.1f, kNo, std::nanf("")}) EXPECT_FALSE(is_sky(no_sky)) << no_sky;
  const TemporaryFolder folder;
  write_disparity_png(folder / "truth.png", Image(1, 1, kF32, 0));
  EXPECT_TRUE(is_sky(read_disparity(folder / "truth.png").at<float>(0, 0)));
}

TEST(Evaluation, PoolingDiffersFromAveraging) {
  const DisparityCounts a{.truth = 10, .valid = 10, .bad = 1}, b{.truth = 90, .valid = 45, .bad = 45};
  DisparityCounts pooled = a;
  pooled += b;
  EXPECT_DOUBLE_EQ(metrics_of(pooled).bad_or_missing, 91);
  const DisparityMetrics mean = mean_of({metrics_of(a), metrics_of(b), metrics_of({})});
  EXPECT_DOUBLE_EQ(mean.bad_or_missing, 55);
  EXPECT_DOUBLE_EQ(mean.density, 75);
}

TEST(Evaluation, NothingToDivideByIsNan) {
  const Image none(3, 4, kF32, kNo), some(3, 4, kF32, 5);
  EXPECT_TRUE(std::isnan(metrics_of(compare_disparity(some, none)).density));
  const DisparityMetrics empty = metrics_of(compare_disparity(none, some));
  EXPECT_EQ(empty.density, 0);
  EXPECT_EQ(empty.bad_or_missing, 100);
  EXPECT_EQ(empty.interpolated, 100);
  EXPECT_EQ(empty.d1_interpolated, 100);
  EXPECT_TRUE(std::isnan(empty.bad_of_valid));
  EXPECT_TRUE(std::isnan(empty.mae_px));
  EXPECT_TRUE(std::isnan(mean_of({}).density));
}

TEST(Evaluation, SizesAndTypesMustFit) {
  const Image a(3, 4, kF32, 1), b(4, 3, kF32, 1), c(3, 4, kU16, 1);
  expect_refused([&] { compare_disparity(a, b); }, {"4x3", "3x4"});
  expect_refused([&] { compare_disparity(c, a); }, {"estimate", "float32"});
  expect_refused([&] { compare_disparity(a, Image()); }, {"truth", "float32"});
}

TEST(Evaluation, HolesAreFilledFromTheBackground) {
  const Image map = map_from(4, {kNo, kNo, kNo, kNo, kNo, kNo,  //
                                 kNo, 5,   kNo, kNo, 3,   kNo,  //
                                 2,   kNo, 7,   kNo, kNo, kNo,  //
                                 kNo, kNo, kNo, kNo, kNo, kNo});
  const Image expected = map_from(4, {5, 5, 3, 3, 3, 3,  //
                                      5, 5, 3, 3, 3, 3,  //
                                      2, 2, 7, 7, 7, 7,  //
                                      2, 2, 7, 7, 7, 7});
  EXPECT_EQ(largest_difference(interpolate_background(map), expected), 0);
  const Image none(3, 4, kF32, kNo);
  EXPECT_EQ(largest_difference(interpolate_background(none), none), 0);
  const Image one(1, 1, kF32, 4);
  EXPECT_EQ(interpolate_background(one).at<float>(0, 0), 4);
}

TEST(Evaluation, DropsWhatIsUncertain) {
  const Image disparity = map_from(1, {5, 6, kNo, 8});
  const Image variance = map_from(1, {6, 6.25f, 0, 0.1f});
  const Image certain = map_from(1, {5, kNo, kNo, 8});
  EXPECT_EQ(largest_difference(drop_uncertain(disparity, variance), certain), 0);
  EXPECT_EQ(largest_difference(drop_uncertain(disparity, variance, 9), disparity), 0);
  EXPECT_EQ(disparity.at<float>(0, 1), 6) << "the caller's stays as it is";
  EXPECT_THROW(drop_uncertain(disparity, variance.part(0, 0, 3, 1)), InvalidArgument);
}

TEST(RealData, GoldenFiguresOfTheDevelopmentKit) {
  EGOSGM_REQUIRE_DATA(data);
  const DisparityMetrics metrics = metrics_of(compare_disparity(read_disparity(data / "devkit2012/disp_est.png"),
                                                                read_disparity(data / "devkit2012/disp_gt.png")));
  EXPECT_NEAR(metrics.density, 96.337, 5e-4);
  EXPECT_NEAR(metrics.interpolated, 5.186, 5e-4);
  EXPECT_NEAR(metrics.bad_of_valid, 4.393, 5e-4);
  EXPECT_NEAR(metrics.bad_or_missing, 7.894, 5e-4);
  EXPECT_NEAR(metrics.d1_interpolated, 5.185, 5e-4);
}

class PairWithTruth : public ::testing::Test {
 protected:
  void add(const std::string& name) {
    make_folder((folder_ / name).parent_path());
    write_file(folder_ / name, "x");
  }
  EvaluationPairs pair(const std::string& estimate, const std::string& truth) {
    return pair_with_truth(folder_ / estimate, folder_ / truth);
  }

  TemporaryFolder folder_;
};

TEST_F(PairWithTruth, FileAndFile) {
  add("a.png"), add("b.pfm");
  const EvaluationPairs result = pair("a.png", "b.pfm");
  ASSERT_EQ(result.pairs.size(), 1u);
  EXPECT_EQ(result.pairs[0].estimate, folder_ / "a.png");
  EXPECT_EQ(result.pairs[0].truth, folder_ / "b.pfm");
}

TEST_F(PairWithTruth, EqualNames) {
  add("e/000001.png"), add("e/000002.png"), add("e/notes.txt"), add("e/.egosgm-1-1.part");
  add("t/000002.pfm"), add("t/000003.png");
  const EvaluationPairs result = pair("e", "t");
  ASSERT_EQ(result.pairs.size(), 1u);
  EXPECT_EQ(result.pairs[0].truth, folder_ / "t/000002.pfm");
  EXPECT_TRUE(result.pairs[0].same_name);
  EXPECT_EQ(result.without_estimate, (std::vector<std::filesystem::path>{folder_ / "t/000003.png"}));
  EXPECT_EQ(pair("e/000002.png", "t").pairs.size(), 1u);
  EXPECT_TRUE(pair("e/000002.png", "t").without_estimate.empty());
}

TEST_F(PairWithTruth, FrameNumberWhereNoNamesAreEqual) {
  add("out/disparity/000009.png"), add("out/disparity/000010.png");
  add("t/000151_10.png");
  for (const char* truth : {"t", "t/000151_10.png"}) {
    const EvaluationPairs result = pair("out", truth);
    ASSERT_EQ(result.pairs.size(), 1u);
    EXPECT_EQ(result.pairs[0].estimate, folder_ / "out/disparity/000010.png");
    EXPECT_EQ(result.pairs[0].name, "000010");
    EXPECT_FALSE(result.pairs[0].same_name);
  }
  EXPECT_EQ(pair("out", "t").without_truth, (std::vector<std::filesystem::path>{folder_ / "out/disparity/000009.png"}));
  add("t/000138_10.png");
  expect_refused([&] { pair("out", "t"); }, {"000010.png", "000138_10.png", "000151_10.png", "one truth file"});
}

TEST_F(PairWithTruth, ImageNamesFindTheTruthOfTheirScene) {
  add("e/000010.png"), add("t/000138_10.png"), add("t/000151_10.png"), add("other/000151_10.png");
  PairingOptions options;
  options.image_names = {{"000010", "000138_10"}};
  const EvaluationPairs result = pair_with_truth(folder_ / "e", folder_ / "t", options);
  ASSERT_EQ(result.pairs.size(), 1u);
  EXPECT_EQ(result.pairs[0].truth, folder_ / "t/000138_10.png");
  EXPECT_TRUE(result.pairs[0].same_name);
  EXPECT_EQ(result.without_estimate, (std::vector<std::filesystem::path>{folder_ / "t/000151_10.png"}));
  for (const char* truth : {"other", "other/000151_10.png"}) {
    expect_refused([&] { pair_with_truth(folder_ / "e", folder_ / truth, options); },
                   {"nothing there belongs", "000010.png is of the image 000138_10"});
  }
  options.image_names = {{"000010", "left_10"}};
  EXPECT_FALSE(pair_with_truth(folder_ / "e", folder_ / "other", options).pairs[0].same_name);
}

TEST_F(PairWithTruth, ADataSetsFolderStandsForItsTruth) {
  add("e/000000.png"), add("e/000001.png"), add("e/000010.png");
  add("street/image_0/000001.png"), add("street/truth/left_disp_noc/000001.png"),
      add("street/truth/left_disp_occ/000001.png");
  add("kitti/training/disp_occ_0/000002_10.png"), add("scene/im0.png"), add("scene/disp0GT.pfm");
  for (const char* place : {"street", "street/truth/left_disp_noc"}) {
    EXPECT_EQ(pair("e", place).pairs.at(0).truth, folder_ / "street/truth/left_disp_noc/000001.png");
  }
  for (const char* place : {"kitti", "kitti/training"}) {
    EXPECT_EQ(pair("e", place).pairs.at(0).truth, folder_ / "kitti/training/disp_occ_0/000002_10.png");
  }
  EXPECT_EQ(pair("e", "scene").pairs.at(0).truth, folder_ / "scene/disp0GT.pfm");
  expect_refused([&] { pair("e", "street/truth"); }, {"holds no .png", "left_disp_noc, left_disp_occ"});
}

TEST_F(PairWithTruth, OnlyChosenFrames) {
  for (const char* name : {"e/000008.png", "e/000009.png", "e/000010.png", "e/mean.png"}) add(name);
  for (const char* name : {"t/000008.png", "t/000010.png", "t/000011.png"}) add(name);
  PairingOptions options;
  options.frames = parse_frame_range("9:10");
  const EvaluationPairs result = pair_with_truth(folder_ / "e", folder_ / "t", options);
  ASSERT_EQ(result.pairs.size(), 1u);
  EXPECT_EQ(result.pairs[0].name, "000010");
  EXPECT_TRUE(result.without_estimate.empty());
  EXPECT_EQ(result.without_truth, (std::vector<std::filesystem::path>{folder_ / "e/000009.png"}));
}

TEST_F(PairWithTruth, NothingThatFitsOrTwoOfOneName) {
  add("e/000001.png"), add("t/000002.png"), add("two/000002.png"), add("two/000002.pfm");
  make_folder(folder_ / "empty");
  expect_refused([&] { pair("e", "t"); }, {"nothing there belongs"});
  expect_refused([&] { pair("e", "empty"); }, {"empty", "holds no .png or .pfm"});
  expect_refused([&] { pair("none", "t"); }, {"none", "no such file"});
  expect_refused([&] { pair("two", "t"); }, {"two/000002.p", "has the name of"});
}

}  // namespace
}  // namespace egosgm::vision
