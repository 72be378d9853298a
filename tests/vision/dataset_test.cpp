// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/dataset.h"

#include <gtest/gtest.h>

#include <set>

#include "egosgm/vision/image_io.h"
#include "tests/support/expect_refused.h"
#include "tests/support/files.h"
#include "tests/vision/data_folder.h"
#include "tests/vision/images.h"
#include "vision/file_io.h"
#include "vision/image_pairs.h"

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
  void add_image(const std::string& name, int width = 8, int height = 4, ImageType type = kU8) {
    const auto file = folder_ / name;
    make_folder(file.parent_path());
    write_png(file, Image(height, width, type, 9));
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

  void add_images(std::initializer_list<std::string> names) {
    for (const std::string& name : names) add_image(name + ".png");
  }
  /// Images and the calibration of this project, in a folder.
  void add_sequence(const std::string& folder, std::initializer_list<std::string> names) {
    for (const std::string& name : names) add_image(folder + "/" + name + ".png");
    add_text(folder + "/calib.txt", kOwnCalibration);
  }
  void refuses(const std::string& folder, const std::vector<std::string>& parts) const {
    expect_refused([&] { open_folder(folder.empty() ? root_ : root_ / folder); }, parts);
  }
  std::string path(const std::string& name) const { return (root_ / name).string(); }
  /// By patterns below the root, with the calibration c.toml.
  StereoSequence open(const std::string& left, const std::string& right, FrameRange range = {},
                      PairBy pair_by = PairBy::kName) {
    add_text("c.toml", kOwnCalibration);
    return open_patterns(path(left), path(right), root_ / "c.toml", range, pair_by);
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
  EXPECT_EQ(check_image_sizes(sequence), (Size{8, 4}));
  EXPECT_EQ(numbers_of(open_kitti_odometry(root_, parse_frame_range("3:4"))), (std::vector<int>{3, 4}));
}

TEST_F(DatasetTest, FramesThatAreMissingAreNamed) {
  add_odometry(2, 6);
  expect_refused([&] { open_kitti_odometry(root_, parse_frame_range("0:4")); }, {"image_0/000000.png", "frames 2..6"});
  expect_refused([&] { open_kitti_odometry(root_, parse_frame_range("5:7")); }, {"image_0/000007.png", "missing"});
  expect_refused([&] { open_kitti_odometry(root_, parse_frame_range("9:")); }, {root_.string(), "no frame in 9:"});
  std::filesystem::remove(root_ / "image_1/000004.png");
  expect_refused([&] { open_kitti_odometry(root_, parse_frame_range("4")); }, {"image_0/000004.png", "no partner"});
  const StereoSequence others = open_kitti_odometry(root_);
  EXPECT_EQ(numbers_of(others), (std::vector<int>{2, 3, 5, 6}));
  EXPECT_NE(others.note.find("1 image without the other camera's left out, the first is"), std::string::npos);
  std::filesystem::remove(root_ / "image_0/000004.png");
  expect_refused([&] { open_kitti_odometry(root_, parse_frame_range("4")); },
                 {"image_0/000004.png", "frame 4 is missing"});
  EXPECT_EQ(numbers_of(open_kitti_odometry(root_)), (std::vector<int>{2, 3, 5, 6}));
  EXPECT_EQ(numbers_of(open_kitti_odometry(root_, parse_frame_range(":3"))), (std::vector<int>{2, 3}));
  std::filesystem::remove(root_ / "image_0/000002.png");
  EXPECT_EQ(numbers_of(open_kitti_odometry(root_, parse_frame_range(":3"))), (std::vector<int>{3}));
  std::filesystem::remove(root_ / "calib.txt");
  expect_refused([&] { open_kitti_odometry(root_); }, {"calib.txt", "no such calibration file"});
  for (const char* camera : {"image_0", "image_1"}) {
    std::filesystem::remove_all(root_ / camera);
    make_folder(root_ / camera);
  }
  expect_refused([&] { open_kitti_odometry(root_); }, {root_.string(), "holds no images"});
}

TEST_F(DatasetTest, RawDrive) {
  for (const std::string camera : {"drive/image_00/data/", "drive/image_01/data/"}) {
    add_images({camera + "0000000000", camera + "0000000001"});
  }
  refuses("drive", {"calib_cam_to_cam.txt"});
  add_text("calib_cam_to_cam.txt", raw_calibration());
  const StereoSequence sequence = open_folder(root_ / "drive");
  EXPECT_EQ(sequence.title, "KITTI raw drive");
  EXPECT_EQ(numbers_of(sequence), (std::vector<int>{0, 1}));
  EXPECT_EQ(sequence.frames[1].name, "000001");
  EXPECT_DOUBLE_EQ(sequence.calibration.baseline_m, 0.5);
}

TEST_F(DatasetTest, PrintfPatterns) {
  add_images({"l/left_7", "l/left_8", "r/right_0007", "r/right_0008", "r/right_9"});
  const StereoSequence sequence = open("l/left_%d.png", "r/right_%04d.png");
  EXPECT_EQ(numbers_of(sequence), (std::vector<int>{7, 8}));
  EXPECT_EQ(sequence.frames[1].left, root_ / "l/left_8.png");
  EXPECT_EQ(sequence.frames[1].right, root_ / "r/right_0008.png");
  for (const char* bad :
       {"l/%s.png", "l/%d_%d.png", "l/%", "l/%6d.png", "l/%0999d.png", "%d/a.png", "l/", "l/%n%d.png", "l/*%d.png"}) {
    expect_refused([&] { open(bad, "r/right_%04d.png"); }, {"pattern '", bad});
  }
  expect_refused([&] { open("l/left_%d.png", "r/right_0007.png"); }, {"both must hold"});
  EXPECT_EQ(open("l/left_%d.png", "r/right_0*.png").frames[1].right, root_ / "r/right_0008.png");
  expect_refused([&] { open("x/left_%d.png", "r/right_%04d.png"); }, {"/x", "cannot be listed"});
  expect_refused([&] { open_patterns(path("l/left_%d.png"), path("r/right_%04d.png"), root_ / "d.toml"); }, {"d.toml"});
}

TEST_F(DatasetTest, GlobPatterns) {
  add_images({"l/a_12", "l/a_13", "r/12_b", "r/13_b", "n/x", "n/y", "m/x", "m/y"});
  const StereoSequence numbered = open("l/a_*.png", "r/*_b.png");
  EXPECT_EQ(numbers_of(numbered), (std::vector<int>{12, 13}));
  EXPECT_EQ(numbered.frames[1].right, root_ / "r/13_b.png");
  const StereoSequence named = open("n/*.png", "m/*.png");
  EXPECT_EQ(numbers_of(named), (std::vector<int>{0, 1}));
  EXPECT_EQ(named.frames[1].left, root_ / "n/y.png");
  std::filesystem::remove(root_ / "m/y.png");
  EXPECT_EQ(numbers_of(open("n/*.png", "m/*.png")), (std::vector<int>{0}));
}

TEST_F(DatasetTest, StepsAndGapsAreFramesInOrderWithANote) {
  for (const std::string number : {"0", "10", "20", "30"}) add_images({"l/" + number, "r/" + number});
  for (const std::string wild : {"*", "%d", "*.png"}) {
    const StereoSequence steps = open("l/" + wild, "r/" + wild);
    EXPECT_EQ(numbers_of(steps), (std::vector<int>{0, 10, 20, 30})) << wild;
    EXPECT_EQ(steps.frames[1].name, "000010");
    EXPECT_EQ(steps.frames[1].right, root_ / "r/10.png");
    EXPECT_NE(steps.note.find("0..30 go in steps of 10"), std::string::npos) << steps.note;
  }
  const StereoSequence part = open("l/*", "r/*", parse_frame_range("5:20"));
  EXPECT_EQ(numbers_of(part), (std::vector<int>{10, 20}));
  EXPECT_EQ(part.numbers, (std::vector<int>{0, 10, 20, 30}));
  expect_refused([&] { open("l/*", "r/*", parse_frame_range("5:40")); }, {"l/40.png", "frame 40 is missing", "0..30"});
  expect_refused([&] { open("l/*", "r/*", parse_frame_range("11:19")); }, {"frame 11 is missing"});
  add_images({"l/31", "r/31"});
  EXPECT_NE(open("l/*", "r/*").note.find("3 gaps, the first after 0"), std::string::npos);
  add_odometry(2, 4);
  EXPECT_EQ(open_folder(root_).note, "");
}

TEST_F(DatasetTest, NamesThatDifferArePairedByOrderWhereTold) {
  add_images({"s/left_9", "s/left_10", "s/right_1", "s/right_2"});
  expect_refused([&] { open("s/l*", "s/r*"); },
                 {"no right image has the name of a left one", "s/left_", "s/right_", "--pair-by order"});
  const StereoSequence sequence = open("s/l*", "s/r*", {}, PairBy::kOrder);
  EXPECT_EQ(numbers_of(sequence), (std::vector<int>{0, 1}));
  EXPECT_EQ(sequence.frames[0].left, root_ / "s/left_9.png");
  EXPECT_EQ(sequence.frames[1].right, root_ / "s/right_2.png");
  const StereoSequence own = open("s/left_*", "s/right_*", {}, PairBy::kOrder);
  EXPECT_EQ(numbers_of(own), (std::vector<int>{9, 10})) << "the left ones' numbers";
  add_images({"s/right_3"});
  expect_refused([&] { open("s/l*", "s/r*", {}, PairBy::kOrder); }, {"2 left and 3 right images"});
}

TEST_F(DatasetTest, TimeStampsAreFramesInTheirOrder) {
  for (const std::string stamp : {"1403636579763555584", "1403636579813555456"})
    add_images({"n/" + stamp, "m/" + stamp});
  for (const std::string wild : {"*", "%d"}) {
    const StereoSequence nanoseconds = open("n/" + wild, "m/" + wild);
    EXPECT_EQ(numbers_of(nanoseconds), (std::vector<int>{0, 1}));
    EXPECT_EQ(nanoseconds.frames[1].left, root_ / "n/1403636579813555456.png");
  }
}

TEST_F(DatasetTest, NumbersInNamesCountByTheirValue) {
  add_images({"a/img_10_x", "a/img_9_x", "a/img_009_b", "a/img_9", "a/img_09", "b/9.5", "b/9.25", "b/10.125"});
  const auto names = [&](const std::string& pattern) {
    std::vector<std::string> stems;
    for (const auto& file : find_images(path(pattern))) stems.push_back(file.stem());
    return stems;
  };
  EXPECT_EQ(names("a/*"), (std::vector<std::string>{"img_9", "img_09", "img_009_b", "img_9_x", "img_10_x"}));
  EXPECT_EQ(names("b/*.png"), (std::vector<std::string>{"9.25", "9.5", "10.125"}));
}

TEST_F(DatasetTest, TwoFramesNeverShareAName) {
  add_images({"l/a1", "l/a01", "l/2", "r/a1", "r/a01", "r/2"});
  const StereoSequence sequence = open("l/*", "r/*");
  EXPECT_EQ(numbers_of(sequence), (std::vector<int>{0, 1, 2}));
  std::set<std::string> names;
  for (const StereoFrame& frame : sequence.frames) {
    EXPECT_EQ(frame.left.filename(), frame.right.filename());
    names.insert(frame.name);
  }
  EXPECT_EQ(names.size(), 3u);
  add_odometry(0, 1);
  add_image("image_0/1.png");
  refuses("", {"image_0/000001.png", "means the same frame as 1.png"});
  expect_refused([&] { open("l/*", "l/*"); }, {"is the left and the right"});
  add_image("l/02.png");
  expect_refused([&] { open("l/*", "r/*"); }, {"l/02.png", "means the same frame as 2.png"});
  add_images({"n/7", "m/007"});
  EXPECT_EQ(open("n/*", "m/*").frames[0].right, root_ / "m/007.png");
}

TEST_F(DatasetTest, APictureBesideOneCamerasFramesMovesNoNumber) {
  add_images({"l/10", "l/11", "l/mean", "r/10", "r/11", "r/9_mask"});
  const StereoSequence sequence = open_patterns(path("l/*"), path("r/*"), "");
  EXPECT_EQ(numbers_of(sequence), (std::vector<int>{10, 11}));
  EXPECT_EQ(sequence.numbers, (std::vector<int>{10, 11}));
  EXPECT_NE(sequence.note.find("2 images without the other camera's left out"), std::string::npos) << sequence.note;
  add_images({"r/mean"});  // a frame as others
  EXPECT_EQ(numbers_of(open_patterns(path("l/*"), path("r/*"), "")), (std::vector<int>{1, 2, 3}));
  add_images({"a/one", "b/two", "b/three"});
  std::filesystem::remove(root_ / "a/one.png");
  expect_refused([&] { open_patterns(path("a/*"), path("b/*"), ""); }, {"has no partner"});
}

TEST_F(DatasetTest, NamesThatAreThereAreNoPatterns) {
  for (const std::string folder : {"a%20b", "a*b", "100%"}) {
    add_text(folder + "/calib.txt", kOwnCalibration);
    for (const char* name : {"/left/0", "/right/0", "/l%20c", "/r%20c"}) add_images({folder + name});
    EXPECT_EQ(open_folder(root_ / folder).frames[0].left, root_ / folder / "left/0.png");
    const StereoSequence pair = open_patterns(path(folder + "/l%20c.png"), path(folder + "/r%20c.png"), "");
    EXPECT_EQ(pair.frames[0].right, root_ / folder / "r%20c.png");
    expect_refused([&] { open_patterns(path(folder + "/l%20d.png"), path(folder + "/r%20d.png"), ""); }, {"l%20d.png"});
  }
  expect_refused([&] { open_patterns(path("b*/*.png"), path("b*/*.png"), ""); }, {"b*/*.png", "or its folder one *"});
}

TEST_F(DatasetTest, JpegIsAnImageLikeAnother) {
  add_text("calib.txt", kProjections);
  for (const char* name : {"image_0/000000.jpg", "image_1/000000.JPEG", "image_0/000001.png", "image_1/000001.Jpg",
                           "image_0/notes.txt", "m/im0.jpg", "m/im1.JPG"}) {
    add_text(name, "x");
  }
  add_text("m/calib.txt", kOwnCalibration);
  const StereoSequence sequence = open_folder(root_);
  EXPECT_EQ(numbers_of(sequence), (std::vector<int>{0, 1}));
  EXPECT_EQ(sequence.frames[0].right, root_ / "image_1/000000.JPEG");
  EXPECT_EQ(open_folder(root_ / "m").frames[0].right, root_ / "m/im1.JPG");
  for (const char* right : {"image_1/*", "image_1/%06d"}) {
    EXPECT_EQ(open("image_0/%06d", right).frames.size(), 2u);
  }
  EXPECT_EQ(open("image_0/*.JPG", "image_1/*.jpeg").frames.size(), 1u);
  add_text("multi/calib/000003.txt", kProjections);
  add_text("multi/image_0/000003_10.jpg", "x"), add_text("multi/image_1/000003_10.jpg", "x");
  EXPECT_EQ(numbers_of(open_kitti_multiview(root_ / "multi", "3")), (std::vector<int>{10}));
  add_text("image_0/000000.png", "x");
  refuses("", {"means the same frame"});
}

TEST_F(DatasetTest, AFolderOfAnotherLevelIsNamedWithWhatItHolds) {
  for (const std::string camera : {"kitti/training/image_0/", "kitti/training/image_1/"}) {
    add_images({camera + "000003_10", camera + "000007_10"});
  }
  for (const char* folder : {"kitti", "kitti/training"}) {
    refuses(folder, {"000003..000007", "--kitti", "kitti/training' --scene 000003"});
  }
  expect_refused([&] { open_kitti_odometry(root_ / "kitti/training"); }, {"holds no images", "--kitti"});
  add_images({"odo/sequences/00/image_0/000000", "odo/sequences/00/image_1/000000"});
  refuses("odo", {"odo: is no stereo sequence", "it holds sequences/00: give"});
  expect_refused([&] { open_kitti_odometry(root_ / "odo"); }, {"it holds sequences/00: give"});
  refuses("odo/sequences", {"it holds 00: give", "odo/sequences/00"});
  refuses("odo/sequences/00/image_1", {"belongs to the sequence", "sequences/00"});
  add_images({"own/left/1", "own/right/1"}), add_text("rec/mav0/cam0/data.csv", "x"), add_text("out/report.json", "{}");
  refuses("own/left", {"it belongs to the sequence", "/own: give that one"});
  add_text("own/scans/left/0.jfif", "\xff\xd8\xff"), add_text("own/scans/right/0.jfif", "\xff\xd8\xff");
  refuses("own/scans", {"left/0.jfif: it is a PNG or JPEG under another name"});
  add_images({"alone/0/1"});
  refuses("alone/0", {"images of its own"});
  refuses("rec", {"egosgm rectify --euroc '"});
  refuses("out", {"egosgm run"});
  refuses("own/left/1.png", {"is no folder", "LEFT RIGHT", "--left PATTERN", "quotes"});
  expect_refused([&] { open_kitti_multiview(root_ / "odo", "7"); }, {"it holds sequences/00"});
}

TEST_F(DatasetTest, TwoFoldersOfImagesAndTheirCalibrationAreASequence) {
  add_sequence("a", {"left/10", "left/9", "right/10", "right/9"});
  add_text("a/times.txt", "0\n1\n"), add_text("a/poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  const StereoSequence sequence = open_folder(root_ / "a");
  EXPECT_EQ(numbers_of(sequence), (std::vector<int>{9, 10}));
  EXPECT_EQ(sequence.frames[0].right, root_ / "a/right/9.png");
  EXPECT_DOUBLE_EQ(sequence.calibration.baseline_m, 0.5);
  EXPECT_EQ(sequence.title, "a");
  EXPECT_EQ(sequence.poses_file, root_ / "a/poses.txt");
  EXPECT_TRUE(std::filesystem::equivalent(sequence.times_file, root_ / "a/times.txt"));
  EXPECT_EQ(numbers_of(open_folder(root_ / "a", {10, 10})), (std::vector<int>{10}));
  refuses("", {"it holds a: give"});
  add_text("videos/left.mp4", "x"), add_text("videos/right.mp4", "x");
  refuses("videos", {"it holds two videos: give '", "left.mp4' '", "right.mp4' --calib FILE"});
  add_text("video/one.avi", "RIFF....AVI LIST"), add_text("video/notes.md", "x");
  refuses("video", {"it holds a video: give '", "video/one.avi'"});

  const std::tuple<std::string, std::string, std::string> names[] = {
      {"b", "image_left/000001_left", "image_right/000001_right"},
      {"g", "cam_Left/1", "cam_Right/1"},
      {"l", "infra1/1", "infra2/1"},
      {"m", "image_lcam_front/1", "image_rcam_front/1"},
      {"n", "cam_L/1", "cam_R/1"}};
  for (const auto& [folder, left, right] : names) {
    add_sequence(folder, {left, right});
    EXPECT_EQ(open_folder(root_ / folder).frames[0].right, root_ / folder / (right + ".png"));
  }
  add_sequence("c", {"left/left_7", "right/right_7"});
  EXPECT_EQ(numbers_of(open_folder(root_ / "c")), (std::vector<int>{7}));
  add_sequence("d", {"left/1", "right/2"});
  refuses("d", {"no right image has the name of a left one"});
  add_images({"e/cam0/1", "e/cam1/1"});
  EXPECT_FALSE(open_folder(root_ / "e").has_calibration);
  add_text("e/rig.json", "{}");
  refuses("e", {"no calib.txt: put their calibration there", "/e' --calib '" + path("e/rig.json") + "'"});
  std::filesystem::remove(root_ / "e/rig.json");
  add_text("e/left.yaml", "a: 1"), add_text("e/right.yaml", "a: 1");
  refuses("e", {"/e' --calib '" + path("e/left.yaml") + "'"});
  add_text("e/others.json", "{}");
  EXPECT_FALSE(open_folder(root_ / "e").has_calibration);
  add_sequence("h", {"L/1", "R/1"});
  add_text("h/L/.1.png", "what a file manager left behind"), add_text("h/R/.1.png", "likewise");
  EXPECT_EQ(numbers_of(open_folder(root_ / "h")), (std::vector<int>{1}));
  add_text("f/left/1.pgm", "x"), add_text("f/right/1.pgm", "x"), add_text("f/calib.txt", kOwnCalibration);
  refuses("f", {"its folders left and right hold no images that are PNG or JPEG, but left/1.pgm", "egosgm rectify"});
  add_text("i/left/1.npy", "\x93NUMPY"), add_text("i/right/1.npy", "\x93NUMPY");
  refuses("i", {"left and right hold no images", "left/1.npy: it is an array"});
  for (const char* empty : {"j/left", "j/right", "k"}) std::filesystem::create_directories(root_ / empty);
  refuses("j", {"left and right hold no images", "left is empty"});
  refuses("k", {"k: is no stereo sequence; it is empty"});
  add_text("e/calib.txt", "nothing\n");
  refuses("e", {"e/calib.txt"});
}

TEST_F(DatasetTest, PairsMayHaveAFolderEach) {
  add_images({"a/000007/left", "a/000007/right", "a/000010/left", "a/000010/right", "a/000011/left"});
  const StereoSequence sequence = open_folder(root_ / "a");
  EXPECT_EQ(numbers_of(sequence), (std::vector<int>{7, 10}));
  EXPECT_EQ(sequence.frames[1].right, root_ / "a/000010/right.png");
  EXPECT_FALSE(sequence.has_calibration);
  EXPECT_NE(sequence.note.find("1 image without the other camera's left out"), std::string::npos);
  add_text("a/calib.txt", kOwnCalibration), add_text("a/times.txt", "0\n1\n");
  EXPECT_DOUBLE_EQ(open_folder(root_ / "a").calibration.baseline_m, 0.5);
  EXPECT_TRUE(std::filesystem::equivalent(open_folder(root_ / "a").times_file, root_ / "a/times.txt"));
  EXPECT_EQ(open("a/*/left.png", "a/*/right.png").frames[0].left, root_ / "a/000007/left.png");
  EXPECT_EQ(numbers_of(open("a/0000*/left.png", "a/0000*/right.png")), (std::vector<int>{7, 10}));
  EXPECT_EQ(numbers_of(open_folder(root_ / "a/000010")), (std::vector<int>{0})) << "a pair by itself";
  expect_refused([&] { open("a/0*/left.png", "a/0*/none.png"); }, {"has no partner"});
  for (const char* bad : {"a/*/*.png", "a/%d/left.png", "a/*/", "*/*/left.png"}) {
    expect_refused([&] { open(bad, "a/*/right.png"); }, {"pattern '", bad, "or its folder one *"});
  }
  add_images({"b/x/im_Left_view", "b/x/im_Right_view", "b/y/im_Left_view", "b/y/im_Right_view"});
  EXPECT_EQ(open_folder(root_ / "b").frames[1].right, root_ / "b/y/im_Right_view.png");
  add_images({"c/x/left", "c/x/right", "c/x/left_mask", "c/x/right_mask"});
  refuses("c", {"no stereo sequence"});
}

TEST_F(DatasetTest, ImagesOfBothCamerasAreReadOrNamedWhereverTheyAre) {
  add_images({"a/left00", "a/left01", "a/right00", "a/right01", "b/000_L", "b/000_R", "b/001_L", "b/001_R"});
  EXPECT_EQ(open_folder(root_ / "a").frames[1].right, root_ / "a/right01.png");
  EXPECT_EQ(numbers_of(open_folder(root_ / "b")), (std::vector<int>{0, 1}));
  add_text("b/Calib.TXT", kOwnCalibration), add_images({"a/left_mask00", "a/right_mask00"});
  EXPECT_DOUBLE_EQ(open_folder(root_ / "b").calibration.baseline_m, 0.5);
  refuses("a", {"holds images of both cameras", "a/left*.png' --right", "a/right*.png'"});
  add_images({"c/camera_0/1", "c/camera_1/1", "d/0/data/1", "d/1/data/1", "d/2/data/1"});
  refuses("c", {"its folders camera_0 and camera_1 hold images", "c/camera_0/*' --right"});
  refuses("d", {"its folders 0/data and 1/data and 1 more hold images"});
  add_images({"e/both"});
  refuses("e", {"LEFT_*'", "rectify --side-by-side"});
}

TEST_F(DatasetTest, WhatARunWroteIsNoInput) {
  add_images({"out/left/0", "out/right/0"}), add_text("out/report.json", "{}"),
      add_text("out/calibration.txt", kOwnCalibration);
  refuses("out", {"it is what `egosgm run` wrote"});
}

TEST_F(DatasetTest, WhatIsGivenInPlaceOfAFolderIsNamed) {
  const std::pair<std::string, std::string> kinds[] = {
      {"PK\x03\x04rest", "a zip archive: unpack it"},
      {"\x1f\x8b\x08rest", "packed by gzip: unpack it, and give the folder or the pictures"},
      {std::string(257, 'x') + "ustar", "a tar archive: unpack it"},
      {std::string("\0\0\0\x18", 4) + "ftypmp42", "is a video"},
      {std::string("\0\0\0\x18", 4) + "ftypheic", "a HEIC"},
      {"GIF89a", "a GIF"},
      {"\xff\xd8\xff", "under another name: name it"},
      {std::string("\0\0\0\x0cjP  ", 8), "JPEG 2000"},
      {"\x93NUMPY", "an array of NumPy"},
      {kOwnCalibration, "is a calibration: give the folder"},
      {"\x89MCAP0", "name it .mcap"},
      {"#ROSBAG V2.0", ".bag or .db3"},
      {"FLV\x01rest", "is a video"},
      {"\x30\x26\xb2\x75rest", "is a video"},
      {"Pf\n2 2\n-1\n", "a map of floats"},
      {"rosbag2_bagfile_information:", "give the folder"}};
  for (const auto& [content, named] : kinds) {
    add_text("drive.dat", content);
    refuses("drive.dat", {"drive.dat: is no folder; it is", named});
  }
  add_text("drive.mcap", "\x89MCAP0"), add_text("drive.bag", "#ROSBAG V2.0");
  add_text("bag/metadata.yaml", "rosbag2_bagfile_information:"), add_text("bag/drive.db3", "SQLite format 3");
  for (const char* bag : {"drive.mcap", "drive.bag", "bag", "bag/drive.db3"}) {
    refuses(bag, {bag, "it is a recording of ROS, which `egosgm run` and `doctor` read"});
  }
  add_text("DSCF0001.MPO", "\xff\xd8\xff");
  refuses("DSCF0001.MPO", {"both pictures of a 3D camera", "--side-by-side"});
  for (const auto& [name, named] : {std::pair{"pair.npz", "arrays of NumPy"},
                                    {"left.h264", "-c copy FILE.mkv"},
                                    {"3d.jps", "named .jpg or .png"},
                                    {"pairs.csv", "rectify --list"}}) {
    add_text(name, "PK\x03\x04");
    expect_refused([&, file = root_ / name] { open_folder(file); }, {name, named});
  }
  for (const char* name : {"drive.mp4", "DRIVE.MOV"}) {
    add_text(name, "no video");
    refuses(name, {name, "it is named as a video, and does not begin like one"});
    expect_refused([&] { open_patterns(path(name), path("DSCF0001.MPO"), ""); },
                   {name, "is no PNG or JPEG; it is named as"});
  }
  add_text("drive.zip", std::string("PK\x03\x04\0", 5) + kOwnCalibration);
  refuses("drive.zip", {"a zip archive: unpack it"});
  std::filesystem::create_symlink("gone", root_ / "link");
  refuses("link", {"link: is a link to what is not there"});
  add_text("HD720.svo2", "x");
  refuses("HD720.svo2", {"recording of a ZED", "ZED_SVO_Export"});
  for (const char* camera : {"0", "/dev/video77"}) {
    expect_refused([&] { open_folder(camera); }, {camera, "it names a live camera, which `egosgm live` reads"});
  }
  expect_refused([&] { open_folder("file:///a/drive"); }, {"it is an address: give the path alone, /a/drive"});
  expect_refused([&] { open_folder("~/drive"); }, {"write its path out"});
  for (const char* address : {"https://x.org/drive.zip", "rtsp://camera/left"}) {
    expect_refused([&] { open_folder(address); }, {address, "an address of the network", "takes a generator"});
  }
  add_images({"single"});
  refuses("single.png", {"give both pictures of a pair"});
  refuses("left/*.png", {"it is a pattern: give --left PATTERN"});
}

TEST_F(DatasetTest, SizesThatACalibrationSaysAreThoseOfTheImages) {
  const std::string k = "cam0=[700 0 4; 0 700 2; 0 0 1]\ncam1=[700 0 4; 0 700 2; 0 0 1]\nbaseline=100\n";
  add_images({"im0", "im1"});
  add_text("calib.txt", k + "width=8\nheight=4\n");
  EXPECT_EQ(check_image_sizes(open_folder(root_)).width, 8);
  add_text("calib.txt", k + "width=16\nheight=8\n");
  expect_refused([&] { check_image_sizes(open_folder(root_)); },
                 {"calib.txt: is of images of 16x8, and these have 8x4: give the calibration of this size"});
}

TEST_F(DatasetTest, ImagesInColourAreOfKittisColourCameras) {
  for (const char* side : {"left", "right"}) {
    add_image(std::string("grey/") + side + "/1.png"), add_image(std::string("colour/") + side + "/1.png", 8, 4, kBgr8);
  }
  add_text("both.txt", kProjections), add_text("grey.txt", kProjections.substr(0, kProjections.find("P2")));
  add_text("own.txt", kOwnCalibration);
  const auto baseline_m = [&](const std::string& folder, const char* calibration) {
    return open_patterns(path(folder + "/left/*"), path(folder + "/right/*"), root_ / calibration)
        .calibration.baseline_m;
  };
  EXPECT_DOUBLE_EQ(baseline_m("colour", "both.txt"), 0.4);
  EXPECT_DOUBLE_EQ(baseline_m("grey", "both.txt"), 0.5);
  EXPECT_DOUBLE_EQ(baseline_m("colour", "grey.txt"), 0.5);
  EXPECT_DOUBLE_EQ(baseline_m("colour", "own.txt"), 0.5);
  add_text("colour/left/0.png", "x"), add_image("colour/right/0.png", 8, 4, kBgr8);
  EXPECT_DOUBLE_EQ(baseline_m("colour", "both.txt"), 0.4) << "the first image cannot be read";
  EXPECT_DOUBLE_EQ(open_patterns(path("colour/left/*.png"), path("colour/right/*.png"), "").calibration.fx, 8);
}

TEST_F(DatasetTest, TimesAreThoseOfTheSequencesFolder) {
  add_odometry(0, 1), add_text("c.toml", kOwnCalibration);
  const auto times = [&](const std::string& folder) {
    return open_patterns(path("a/b/image_0/*"), path("a/b/image_1/*"), root_ / folder / "c.toml").times_file;
  };
  add_images({"a/b/image_0/000000", "a/b/image_1/000000"});
  add_text("a/b/calib.txt", kProjections), add_text("a/times.txt", "0\n"), add_text("a/c.toml", kOwnCalibration);
  EXPECT_EQ(open_folder(root_ / "a/b").times_file, "") << "another sequence's, maybe";
  EXPECT_EQ(times("a"), "");
  add_text("a/b/times.txt", "0\n"), add_text("a/b/c.toml", kOwnCalibration);
  EXPECT_EQ(open_folder(root_ / "a/b").times_file, root_ / "a/b/times.txt");
  EXPECT_EQ(times("a"), "");
  EXPECT_TRUE(std::filesystem::equivalent(times("a/b"), root_ / "a/b/times.txt"));
  add_text("a/b/image_0/timestamps.txt", "0\n");
  EXPECT_EQ(times("a"), root_ / "a/b/image_0/timestamps.txt");
}

TEST_F(DatasetTest, FilesWithoutAPartnerAreTold) {
  add_images({"l/0", "l/2", "r/0", "r/1", "r/2"});
  const ImagePairs pairs = find_pairs(path("l/*.png"), path("r/%d.png"));
  ASSERT_EQ(pairs.pairs.size(), 2u);
  EXPECT_EQ(pairs.pairs[1].first, root_ / "l/2.png");
  EXPECT_EQ(pairs.pairs[1].second, root_ / "r/2.png");
  EXPECT_EQ(pairs.alone, (std::vector<std::filesystem::path>{root_ / "r/1.png"}));
}

TEST_F(DatasetTest, OnePairAndMiddlebury) {
  add_images({"im0", "im1"});
  add_text("calib.txt",
           "cam0=[700 0 600; 0 700 180; 0 0 1]\ncam1=[700 0 605; 0 700 180; 0 0 1]\ndoffs=5\nbaseline=100\n");
  const StereoSequence sequence = open_folder(root_);
  EXPECT_EQ(numbers_of(sequence), (std::vector<int>{0}));
  EXPECT_DOUBLE_EQ(sequence.calibration.doffs_px, 5);
  EXPECT_EQ(sequence.frames[0].truth_occ, "");
  std::filesystem::remove(root_ / "im1.png");
  refuses("", {"im1.png", "no such image"});
  expect_refused([&] { open_folder("/"); }, {"no stereo sequence"});
  refuses("none", {"none", "no such folder"});
}

TEST_F(DatasetTest, SizesAndDepthsMustAgree) {
  add_odometry(0, 2);
  add_image("image_1/000001.png", 9, 4);
  const StereoSequence sequence = open_kitti_odometry(root_);
  EXPECT_EQ(read_images(sequence.frames[0]).right.size(), (Size{8, 4}));
  expect_refused([&] { read_images(sequence.frames[1]); }, {"image_1/000001.png", "9x4", "image_0/000001.png", "8x4"});
  expect_refused([&] { check_image_sizes(sequence); }, {"image_1/000001.png", "9x4", "its left image has 8x4"});
  add_image("image_1/000001.png", 8, 4, kU16);
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
  const auto first = [&](const StereoSequence& chosen, int count) {
    add_text("poses.txt", rows(count));
    return poses_of_frames(chosen, root_ / "poses.txt").at(0).translation().z();
  };
  EXPECT_EQ(first(sequence, 5), 2) << "a row for each number";
  EXPECT_EQ(first(sequence, 3), 0) << "a row for each frame";
  for (const int neither : {1, 2, 4, 6}) {
    expect_refused([&] { first(sequence, neither); }, {"poses.txt", "holds " + std::to_string(neither) + " poses",
                                                       "5 (each number", "3 (each frame of 2..4"});
  }
  add_odometry(2, 9);
  const StereoSequence part = open_kitti_odometry(root_, parse_frame_range("4:6"));
  EXPECT_EQ(first(part, 10), 4);
  EXPECT_EQ(first(part, 8), 2) << "rows of 2..9, though there is a row of each number up to 6";
  EXPECT_EQ(first(part, 3), 0) << "rows of 4..6";
  expect_refused([&] { first(part, 7); }, {"holds 7 poses", "10 (each", "8 (each", "3 (each chosen frame, 4..6"});
  StereoSequence unknown = part;
  unknown.numbers.clear();
  EXPECT_EQ(first(unknown, 10), 4);
  EXPECT_EQ(first(unknown, 3), 0);
  expect_refused([&] { first(unknown, 6); }, {"holds 6 poses"});
  EXPECT_EQ(rows_of_frames(part, 8, "times.txt", "times"), (std::vector<std::size_t>{2, 3, 4}));
}

// Of another numbering, or of a report that somebody edited: never a row of another frame, nor one that is not there.
TEST_F(DatasetTest, NoRowBelongsToAFrameThatIsNotThere) {
  const auto sequence = [](std::vector<int> frames, std::vector<int> numbers) {
    StereoSequence of;
    for (const int number : frames) of.frames.emplace_back().number = number;
    of.numbers = std::move(numbers);
    return of;
  };
  const auto refused = [&](const StereoSequence& of, std::size_t rows, const std::string& frame) {
    expect_refused([&] { rows_of_frames(of, rows, "poses.txt", "poses"); }, {"poses.txt", "frame " + frame});
  };
  refused(sequence({100, 101, 102}, {0, 1, 2}), 3, "100");
  refused(sequence({0, 1, 2}, {2, 3, 4}), 3, "0");
  refused(sequence({2, 9}, {2, 3, 4}), 5, "9");
  refused(sequence({0, 900000000, 2}, {}), 3, "900000000");
  refused(sequence({-1, 2}, {}), 3, "-1");
  refused(sequence({2147483647, 2}, {}), 3, "2147483647");
  EXPECT_TRUE(rows_of_frames({}, 3, "poses.txt", "poses").empty());
}

}  // namespace
}  // namespace egosgm::vision
