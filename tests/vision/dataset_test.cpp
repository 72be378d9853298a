// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/dataset.h"

#include <gtest/gtest.h>

#include "egosgm/vision/file_io.h"
#include "egosgm/vision/image_io.h"
#include "tests/support/expect_refused.h"
#include "tests/vision/data_folder.h"
#include "tests/vision/temporary_folder.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

const std::string kProjections =
    "P0: 700 0 600 0 0 700 180 0 0 0 1 0\nP1: 700 0 600 -350 0 700 180 0 0 0 1 0\n"
    "P2: 700 0 600 70 0 700 180 0 0 0 1 0\nP3: 700 0 600 -210 0 700 180 0 0 0 1 0\n";
const std::string kOwnCalibration = "fx = 700\nfy = 700\ncx = 600\ncy = 180\nbaseline_m = 0.5\n";

std::string raw_calibration() {
  std::string text = kProjections;
  for (std::size_t at = text.find("P"); at != std::string::npos; at = text.find("P", at + 1))
    text.insert(at + 1, "_rect_0");
  return text;
}

/// A folder tree of tiny images.
class DatasetTest : public ::testing::Test {
 protected:
  void add_image(const std::string& name, int width = 8, int height = 4, int type = CV_8UC1) {
    const auto file = folder_ / name;
    make_folder(file.parent_path());
    write_png(file, cv::Mat(height, width, type, cv::Scalar(9)));
  }
  void add_text(const std::string& name, const std::string& text) {
    const auto file = folder_ / name;
    make_folder(file.parent_path());
    write_file(file, text);
  }
  void add_odometry(int first, int last) {
    for (int k = first; k <= last; ++k) {
      add_image("image_0/00000" + std::to_string(k) + ".png");
      add_image("image_1/00000" + std::to_string(k) + ".png");
    }
    add_text("calib.txt", kProjections);
  }

  TemporaryFolder folder_;
  const std::filesystem::path& root_ = folder_.path();
};

std::vector<int> numbers_of(const StereoSequence& sequence) {
  std::vector<int> numbers;
  for (const StereoFrame& frame : sequence.frames) numbers.push_back(frame.number);
  return numbers;
}

TEST(FrameRangeText, Parses) {
  EXPECT_EQ(parse_frame_range("7:10").first, 7);
  EXPECT_EQ(parse_frame_range("7:10").last, 10);
  EXPECT_EQ(parse_frame_range("7:").last, std::nullopt);
  EXPECT_EQ(parse_frame_range(":10").first, std::nullopt);
  EXPECT_EQ(parse_frame_range("7").first, 7);
  EXPECT_EQ(parse_frame_range("7").last, 7);
  for (const char* text : {"", ":", "a", "1:b", "-1:2", "10:7", "1:2:3", "1 2", "99999999999"}) {
    expect_refused([&] { parse_frame_range(text); }, {std::string("'") + text + "'", "FIRST:LAST"});
  }
}

TEST_F(DatasetTest, MultiviewScenesOf2012) {
  for (const char* scene : {"000003", "000007"}) {
    for (const char* frame : {"_09.png", "_10.png", "_11.png"}) {
      add_image("training/image_0/" + std::string(scene) + frame);
      add_image("training/image_1/" + std::string(scene) + frame);
    }
    add_text("training/calib/" + std::string(scene) + ".txt", kProjections);
  }
  add_image("training/disp_noc/000007_10.png");
  add_image("training/disp_occ/000007_10.png");
  for (const auto& root : {root_, root_ / "training"}) {
    const StereoSequence sequence = open_kitti_multiview(root, "7");
    EXPECT_EQ(sequence.title, "KITTI 2012 scene 000007");
    EXPECT_EQ(numbers_of(sequence), (std::vector<int>{9, 10, 11}));
    EXPECT_EQ(sequence.frames[1].name, "000010");
    EXPECT_EQ(sequence.frames[1].left, root_ / "training/image_0/000007_10.png");
    EXPECT_EQ(sequence.frames[1].right, root_ / "training/image_1/000007_10.png");
    EXPECT_EQ(sequence.frames[1].truth_noc, root_ / "training/disp_noc/000007_10.png");
    EXPECT_EQ(sequence.frames[1].truth_occ, root_ / "training/disp_occ/000007_10.png");
    EXPECT_EQ(sequence.frames[0].truth_noc, "");
    EXPECT_DOUBLE_EQ(sequence.calibration.baseline_m, 0.5);
  }
  EXPECT_EQ(numbers_of(open_kitti_multiview(root_, "000003", parse_frame_range("10:"))), (std::vector<int>{10, 11}));
  expect_refused([&] { open_kitti_multiview(root_, "000006"); },
                 {root_.string(), "'000006'", "nearest are 000007, 000003"});
  expect_refused([&] { open_kitti_multiview(root_, "../7"); }, {"'../7'"});
  expect_refused([&] { open_kitti_multiview(root_ / "none", "7"); }, {"none", "no such folder"});
  expect_refused([&] { open_kitti_multiview(root_ / "training/calib", "7"); }, {"no image_0"});
  std::filesystem::remove(root_ / "training/calib/000003.txt");
  expect_refused([&] { open_kitti_multiview(root_, "3"); }, {"calib/000003.txt", "calibration"});
}

TEST_F(DatasetTest, MultiviewScenesOf2015TakeTheColorCameras) {
  for (const char* camera : {"image_2", "image_3"}) add_image(std::string(camera) + "/000002_10.png");
  add_text("calib_cam_to_cam/000002.txt", raw_calibration());
  add_image("disp_noc_0/000002_10.png");
  const StereoSequence sequence = open_kitti_multiview(root_, "000002");
  EXPECT_EQ(sequence.title, "KITTI 2015 scene 000002");
  EXPECT_DOUBLE_EQ(sequence.calibration.baseline_m, 0.4);
  EXPECT_EQ(sequence.frames[0].truth_noc, root_ / "disp_noc_0/000002_10.png");
}

TEST_F(DatasetTest, OdometrySequence) {
  add_odometry(2, 6);
  add_text("poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  add_image("truth/left_disp_noc/000004.png");
  const StereoSequence sequence = open_folder(root_);
  EXPECT_EQ(numbers_of(sequence), (std::vector<int>{2, 3, 4, 5, 6}));
  EXPECT_EQ(sequence.poses_file, root_ / "poses.txt");
  EXPECT_EQ(sequence.frames[2].truth_noc, root_ / "truth/left_disp_noc/000004.png");
  EXPECT_EQ(sequence.frames[2].truth_occ, "");
  EXPECT_EQ(check_image_sizes(sequence), cv::Size(8, 4));
  EXPECT_EQ(numbers_of(open_kitti_odometry(root_, parse_frame_range("3:4"))), (std::vector<int>{3, 4}));
}

TEST_F(DatasetTest, FramesThatAreMissingAreNamed) {
  add_odometry(2, 6);
  expect_refused([&] { open_kitti_odometry(root_, parse_frame_range("0:4")); }, {"image_0/000000.png", "frames 2..6"});
  expect_refused([&] { open_kitti_odometry(root_, parse_frame_range("5:7")); }, {"image_0/000007.png", "missing"});
  expect_refused([&] { open_kitti_odometry(root_, parse_frame_range("9:")); }, {root_.string(), "no frame in 9:"});
  std::filesystem::remove(root_ / "image_1/000004.png");
  expect_refused([&] { open_kitti_odometry(root_); }, {"image_1/000004.png", "right image", "image_0/000004.png"});
  std::filesystem::remove(root_ / "image_0/000004.png");
  expect_refused([&] { open_kitti_odometry(root_); }, {"image_0/000004.png", "frame 4 is missing"});
  EXPECT_EQ(numbers_of(open_kitti_odometry(root_, parse_frame_range(":3"))), (std::vector<int>{2, 3}));
  std::filesystem::remove(root_ / "image_0/000002.png");
  expect_refused([&] { open_kitti_odometry(root_, parse_frame_range(":3")); }, {"image_0/000002.png", "left image"});
  for (const char* camera : {"image_0", "image_1"}) {
    std::filesystem::remove_all(root_ / camera);
    make_folder(root_ / camera);
  }
  expect_refused([&] { open_kitti_odometry(root_); }, {root_.string(), "holds no images"});
}

TEST_F(DatasetTest, MissingCalibrationIsNamed) {
  add_odometry(0, 1);
  std::filesystem::remove(root_ / "calib.txt");
  expect_refused([&] { open_kitti_odometry(root_); }, {"calib.txt", "no such calibration file"});
}

TEST_F(DatasetTest, RawDrive) {
  for (const char* name : {"image_00/data/0000000000.png", "image_01/data/0000000000.png",
                           "image_00/data/0000000001.png", "image_01/data/0000000001.png"}) {
    add_image("drive/" + std::string(name));
  }
  expect_refused([&] { open_folder(root_ / "drive"); }, {"calib_cam_to_cam.txt"});
  add_text("calib_cam_to_cam.txt", raw_calibration());
  const StereoSequence sequence = open_folder(root_ / "drive");
  EXPECT_EQ(sequence.title, "KITTI raw drive");
  EXPECT_EQ(numbers_of(sequence), (std::vector<int>{0, 1}));
  EXPECT_EQ(sequence.frames[1].name, "000001");
  EXPECT_DOUBLE_EQ(sequence.calibration.baseline_m, 0.5);
}

TEST_F(DatasetTest, PrintfPatterns) {
  for (const char* name : {"l/left_7.png", "l/left_8.png", "r/right_0007.png", "r/right_0008.png", "r/right_9.png"}) {
    add_image(name);
  }
  add_text("c.toml", kOwnCalibration);
  const auto path = [&](const char* name) { return (root_ / name).string(); };
  const StereoSequence sequence = open_patterns(path("l/left_%d.png"), path("r/right_%04d.png"), root_ / "c.toml");
  EXPECT_EQ(numbers_of(sequence), (std::vector<int>{7, 8}));
  EXPECT_EQ(sequence.frames[1].left, root_ / "l/left_8.png");
  EXPECT_EQ(sequence.frames[1].right, root_ / "r/right_0008.png");
  for (const char* bad :
       {"l/%s.png", "l/%d_%d.png", "l/%", "l/%6d.png", "l/%0999d.png", "%d/a.png", "l/", "l/%n%d.png", "l/*%d.png"}) {
    expect_refused([&] { open_patterns(path(bad), path("r/right_%04d.png"), root_ / "c.toml"); }, {"pattern '", bad});
  }
  expect_refused([&] { open_patterns(path("l/left_%d.png"), path("r/*.png"), root_ / "c.toml"); }, {"both must hold"});
  expect_refused([&] { open_patterns(path("x/left_%d.png"), path("r/right_%04d.png"), root_ / "c.toml"); },
                 {"/x", "cannot be listed"});
  expect_refused([&] { open_patterns(path("l/left_%d.png"), path("r/right_%04d.png"), root_ / "d.toml"); }, {"d.toml"});
}

TEST_F(DatasetTest, GlobPatterns) {
  for (const char* name :
       {"l/a_12.png", "l/a_13.png", "r/12_b.png", "r/13_b.png", "n/x.png", "n/y.png", "m/x.png", "m/y.png"}) {
    add_image(name);
  }
  add_text("c.toml", kOwnCalibration);
  const auto path = [&](const char* name) { return (root_ / name).string(); };
  const StereoSequence numbered = open_patterns(path("l/a_*.png"), path("r/*_b.png"), root_ / "c.toml");
  EXPECT_EQ(numbers_of(numbered), (std::vector<int>{12, 13}));
  EXPECT_EQ(numbered.frames[1].right, root_ / "r/13_b.png");
  const StereoSequence named = open_patterns(path("n/*.png"), path("m/*.png"), root_ / "c.toml");
  EXPECT_EQ(numbers_of(named), (std::vector<int>{0, 1}));
  EXPECT_EQ(named.frames[1].left, root_ / "n/y.png");
  std::filesystem::remove(root_ / "m/y.png");
  expect_refused([&] { open_patterns(path("n/*.png"), path("m/*.png"), root_ / "c.toml"); },
                 {"m/y.png", "right image"});
}

TEST_F(DatasetTest, OnePairAndMiddlebury) {
  for (const char* name : {"im0.png", "im1.png"}) add_image(name);
  add_text("calib.txt",
           "cam0=[700 0 600; 0 700 180; 0 0 1]\ncam1=[700 0 605; 0 700 180; 0 0 1]\ndoffs=5\nbaseline=100\n");
  const StereoSequence sequence = open_folder(root_);
  EXPECT_EQ(numbers_of(sequence), (std::vector<int>{0}));
  EXPECT_DOUBLE_EQ(sequence.calibration.doffs_px, 5);
  EXPECT_EQ(sequence.frames[0].truth_occ, "");
  std::filesystem::remove(root_ / "im1.png");
  expect_refused([&] { open_folder(root_); }, {"im1.png", "no such image"});
  expect_refused([&] { open_folder("/"); }, {"no stereo sequence"});
  expect_refused([&] { open_folder(root_ / "none"); }, {"none", "no such folder"});
}

TEST_F(DatasetTest, SizesAndDepthsMustAgree) {
  add_odometry(0, 2);
  add_image("image_1/000001.png", 9, 4);
  const StereoSequence sequence = open_kitti_odometry(root_);
  EXPECT_EQ(read_images(sequence.frames[0]).right.size(), cv::Size(8, 4));
  expect_refused([&] { read_images(sequence.frames[1]); }, {"image_1/000001.png", "9x4", "image_0/000001.png", "8x4"});
  expect_refused([&] { check_image_sizes(sequence); }, {"image_1/000001.png", "9x4", "8x4"});
  add_image("image_1/000001.png", 8, 4, CV_16UC1);
  expect_refused([&] { read_images(sequence.frames[1]); }, {"16 bit", "8 bit"});
  std::filesystem::remove(root_ / "image_0/000002.png");
  expect_refused([&] { read_images(sequence.frames[2]); }, {"image_0/000002.png", "No such file"});
}

TEST_F(DatasetTest, PosesBelongToFrameNumbersOrPositions) {
  add_odometry(2, 4);
  const StereoSequence sequence = open_kitti_odometry(root_);
  const auto rows = [](int count) {
    std::string text;
    for (int k = 0; k < count; ++k) text += "1 0 0 0 0 1 0 0 0 0 1 " + std::to_string(k) + "\n";
    return text;
  };
  add_text("poses.txt", rows(6));
  EXPECT_EQ(poses_of_frames(sequence, root_ / "poses.txt").at(0).translation().z(), 2);
  add_text("poses.txt", rows(3));
  EXPECT_EQ(poses_of_frames(sequence, root_ / "poses.txt").at(0).translation().z(), 0);
  add_text("poses.txt", rows(4));
  expect_refused([&] { poses_of_frames(sequence, root_ / "poses.txt"); }, {"poses.txt", "holds 4 poses", "2..4"});
}

TEST(DatasetData, RealSequencesOpen) {
  EGOSGM_REQUIRE_DATA(data);
  const StereoSequence scene = open_kitti_multiview(data / "kitti2012", "000151", parse_frame_range("7:10"));
  EXPECT_EQ(numbers_of(scene), (std::vector<int>{7, 8, 9, 10}));
  EXPECT_FALSE(scene.frames[3].truth_noc.empty());
  EXPECT_EQ(check_image_sizes(scene), cv::Size(1242, 375));
  EXPECT_EQ(read_images(scene.frames[0]).left.type(), CV_8UC1);
  const StereoSequence color = open_kitti_multiview(data / "kitti2015/training", "2");
  EXPECT_EQ(numbers_of(color), (std::vector<int>{10, 11}));
  EXPECT_EQ(read_images(color.frames[0]).left.type(), CV_8UC1);
  const StereoSequence odometry = open_folder(data / "odometry/sequences/A");
  EXPECT_EQ(odometry.frames.size(), 51u);
  EXPECT_EQ(poses_of_frames(odometry, odometry.poses_file).size(), 51u);
  EXPECT_FALSE(open_folder(data / "middlebury/Motorcycle").frames[0].truth_occ.empty());
}

}  // namespace
}  // namespace egosgm::vision
