// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/calibration_io.h"

#include <gtest/gtest.h>

#include <ctime>

#include "tests/support/expect_refused.h"
#include "tests/support/files.h"
#include "tests/vision/data_folder.h"
#include "vision/file_io.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

const std::string kP0 = "700 0 600 0 0 710 180 0 0 0 1 0";
const std::string kP1 = "700 0 600 -350 0 710 180 0 0 0 1 0";
const std::string kP2 = "700 0 610 70 0 710 190 0.2 0 0 1 0.003";
const std::string kP3 = "700 0 615 -210 0 710 190 2.1 0 0 1 0.003";
const std::string kOwn = "fx = 700\nfy = 710\ncx = 600\ncy = 180\nbaseline_m = 0.5\n";

void expect_calibration(const Calibration& c, double cx, double cy, double baseline_m, double doffs_px) {
  EXPECT_DOUBLE_EQ(c.fx, 700);
  EXPECT_DOUBLE_EQ(c.fy, 710);
  EXPECT_DOUBLE_EQ(c.cx, cx);
  EXPECT_DOUBLE_EQ(c.cy, cy);
  EXPECT_DOUBLE_EQ(c.baseline_m, baseline_m);
  EXPECT_DOUBLE_EQ(c.doffs_px, doffs_px);
}

class CalibrationIo : public ::testing::Test {
 protected:
  Calibration read(const std::string& text, KittiCameras cameras = KittiCameras::kAny) {
    write_file(file_, text);
    return read_calibration(file_, cameras);
  }
  void expect_text_refused(const std::string& text, std::initializer_list<std::string> parts) {
    expect_refused([&] { read(text); }, parts);
    expect_refused([&] { read(text); }, {file_.string()});
  }

  TemporaryFolder folder_;
  std::filesystem::path file_ = folder_ / "calib.txt";
};

TEST_F(CalibrationIo, OdometryRowsChooseTheCameras) {
  const std::string text = "P0: " + kP0 + "\r\nP1: " + kP1 + "\r\nP2: " + kP2 + "\nP3: " + kP3 + "\nTr: 1 2 3\n";
  expect_calibration(read(text), 600, 180, 0.5, 0);
  expect_calibration(read(text, KittiCameras::kGrey), 600, 180, 0.5, 0);
  expect_calibration(read(text, KittiCameras::kColor), 610, 190, 0.4, 5);
  expect_calibration(read("P2: " + kP2 + "\nP3: " + kP3), 610, 190, 0.4, 5);
}

TEST_F(CalibrationIo, RawRowsChooseTheCameras) {
  const std::string text = "calib_time: 09-Jan-2012 13:57:47\nP_rect_00: " + kP0 + "\nR_00: 1 2\nP_rect_01: " + kP1 +
                           "\nP_rect_02: " + kP2 + "\nP_rect_03: " + kP3 + "\n";
  expect_calibration(read(text), 600, 180, 0.5, 0);
  expect_calibration(read(text, KittiCameras::kColor), 610, 190, 0.4, 5);
}

TEST_F(CalibrationIo, MiddleburyIsInMillimetres) {
  const std::string text =
      "cam0=[700 0 600; 0 710 180; 0 0 1]\ncam1=[700 0 630.5; 0 710 180; 0 0 1]\ndoffs=30.5\nbaseline=500\nwidth=10\n";
  expect_calibration(read(text), 600, 180, 0.5, 30.5);
}

TEST_F(CalibrationIo, OwnFormatIsTomlOrYaml) {
  expect_calibration(read(kOwn), 600, 180, 0.5, 0);
  expect_calibration(
      read("%YAML:1.0\n---\n# made by hand\nfx: 700\nfy: 710.0\ncx: 6e2\ncy: +180\nbaseline_m: .5  # half\n"
           "doffs_px: -2\n"),
      600, 180, 0.5, -2);
}

TEST_F(CalibrationIo, WrittenCalibrationIsReadBackExactly) {
  const Calibration written{721.5377, 1.0 / 3, 609.5593, -172.854, 0.53715, 1e-7};
  write_calibration(file_, written);
  const Calibration read_back = read_calibration(file_);
  for (const auto value : {&Calibration::fx, &Calibration::fy, &Calibration::cx, &Calibration::cy,
                           &Calibration::baseline_m, &Calibration::doffs_px}) {
    EXPECT_EQ(read_back.*value, written.*value);
  }
  expect_refused([&] { write_calibration(file_, {}); }, {"calibration: fx"});
}

TEST_F(CalibrationIo, BrokenFilesAreNamedWithTheirRow) {
  expect_text_refused("P0: 1 2 3\nP1: " + kP1, {":1:", "P0 has 3 numbers instead of 12"});
  expect_text_refused("\nP0: " + kP0 + " 5\nP1: " + kP1, {":2:", "P0 has 13 numbers"});
  expect_text_refused("P0: " + kP0 + "\n", {"has no row P1"});
  expect_text_refused("P1: " + kP1 + "\n", {"has no row P0"});
  expect_text_refused("P0: " + kP0 + "\nP0: " + kP0, {":2:", "row 1 already"});
  expect_text_refused("P0: 0 0 600 0 0 710 180 0 0 0 1 0\nP1: " + kP1, {":1:", "focal length is 0.0"});
  expect_text_refused("P0: 700 0 600 0 0 -710 180 0 0 0 1 0\nP1: " + kP1, {":1:", "focal length is -710.0"});
  expect_text_refused("P0: nan 0 600 0 0 710 180 0 0 0 1 0\nP1: " + kP1, {":1:", "'nan' is not a finite number"});
  expect_text_refused("P0: 700 0 600 0 0 710 180 0 0 0 1 x\nP1: " + kP1, {":1:", "'x' is not a finite number"});
  expect_text_refused("P0: 700 0 600 0 0 710 180 0 0 0 1 1e999\nP1: " + kP1, {"'1e999'"});
  expect_text_refused("P0: " + kP0 + "\nP1: " + kP0, {":2:", "baseline is 0.0", "must be positive"});
  expect_text_refused("P0: " + kP1 + "\nP1: " + kP0, {":2:", "baseline is -0.5", "swapped"});
  expect_text_refused("P0: " + kP0 + "\nP1: 800 0 600 -350 0 710 180 0 0 0 1 0", {":2:", "differ", "rectified"});
  expect_text_refused("P0: " + kP0 + "\nP1: 700 0 600 -350 0 720 180 0 0 0 1 0",
                      {":2:", "710.0", "720.0", "rectified"});
  expect_text_refused("P0: " + kP0 + "\nP1: 700 0 600 -350 0 710 183 0 0 0 1 0", {":2:", "rows", "183.0", "rectified"});
  expect_text_refused("cam0=[700 0 600; 0 710 180; 0 0 1]\ncam1=[700 0 600; 0 710 177; 0 0 1]\nbaseline=1",
                      {":2:", "rows", "177.0"});
  expect_text_refused("cam0=[700 0 600; 0 710 180]\ncam1=[700 0 600; 0 710 180; 0 0 1]\nbaseline=1",
                      {":1:", "6 numbers"});
  expect_text_refused("cam0=[700 0 600; 0 710 180; 0 0 1]\ncam1=[700 0 600; 0 710 180; 0 0 1]\n", {"no row baseline"});
  expect_text_refused(kOwn + "fz = 3\n", {":6:", "unknown key 'fz'"});
  expect_text_refused("fx = 700\n", {"no row fy"});
  expect_text_refused("fx = seven\n" + kOwn.substr(9), {":1:", "'seven'"});
  expect_text_refused("fx = 0\n" + kOwn.substr(9), {":1:", "focal length is 0.0"});
  expect_text_refused("fx = 700\nfy = 710\ncx = 600\ncy = 180\nbaseline_m = -0.5\n", {":5:", "baseline is -0.5"});
  expect_text_refused("fx = inf\n" + kOwn.substr(9), {":1:", "finite"});
  expect_text_refused("", {"holds no calibration"});
  expect_text_refused("hello", {":1:", "'hello'"});
  expect_text_refused("a: b\n", {"holds no calibration"});
  expect_text_refused(std::string("\x01\x02\x00\xff", 4), {":1:", "is not `key: value`"});
}

TEST_F(CalibrationIo, SizesOfImagesAreRead) {
  const auto size = [&](const std::string& text, KittiCameras cameras = KittiCameras::kAny) {
    write_file(file_, text);
    const SizedCalibration found = read_sized_calibration(file_, cameras);
    return std::pair{found.width, found.height};
  };
  const std::string raw = "P_rect_00: " + kP0 + "\nP_rect_01: " + kP1 + "\nP_rect_02: " + kP2 + "\nP_rect_03: " + kP3;
  EXPECT_EQ(size(raw + "\nS_00: 1392 512\nS_rect_00: 1.242000e+03 3.750000e+02\nS_rect_02: 800 600\n"),
            std::pair(1242, 375));
  EXPECT_EQ(size(raw + "\nS_rect_00: 1242 375\nS_rect_02: 800 600\n", KittiCameras::kColor), std::pair(800, 600));
  const std::string middlebury = "cam0=[700 0 4; 0 700 2; 0 0 1]\ncam1=[700 0 4; 0 700 2; 0 0 1]\nbaseline=100\n";
  EXPECT_EQ(size(middlebury + "width=2964\nheight=2000\n"), std::pair(2964, 2000));
  for (const std::string& text :
       {raw, raw + "\nS_rect_00: 0 0\n", raw + "\nS_rect_00: 1e9 1\n", middlebury + "width=9\n", kOwn}) {
    EXPECT_EQ(size(text), std::pair(0, 0)) << text;
  }
  expect_text_refused(raw + "\nS_rect_00: wide 2\n", {"'wide' is not a finite number"});
}

TEST_F(CalibrationIo, OtherNamesOfTwoCameras) {
  const std::string cameras = "P_rect_101: " + kP0 + "\nP_rect_103: " + kP1 + "\nT_101: 0 0 0\nT_103: ";
  expect_calibration(read(cameras + "-0.5 0.001 0.002"), 600, 180, 0.5, 0);
  for (const std::string& text :
       {cameras + "-0.25 0 0", "P_rect_00: " + kP0 + "\nP_rect_01: " + kP1 + "\nT_00: 0 0 0\nT_01: -0.25 0 0\n"}) {
    expect_text_refused(
        text, {":2:", "gives a baseline of 0.500000 m, T_", "one of 0.250000 m", "DrivingStereo", "baseline_m"});
  }
  expect_text_refused("P_rect_101: " + kP0, {"has the camera P_rect_101 alone"});
}

TEST_F(CalibrationIo, TransposedMatricesAreNamed) {
  const std::string p = "700 0 0 0 710 0 600 180 1 -350 0 0";
  expect_text_refused("P0: " + p + "\nP1: " + p, {":1:", "P0 is transposed, as MATLAB writes it"});
  expect_text_refused("\x89PNG\r\n Q: 1", {"is a picture, not one of EgoSGM's formats"});
  expect_text_refused("cam0=[700 0 0; 0 710 0; 600 180 1]\ncam1=[700 0 600; 0 710 180; 0 0 1]\nbaseline=1",
                      {":1:", "cam0 is transposed"});
}

TEST_F(CalibrationIo, MissingCamerasAreNamed) {
  expect_refused([&] { read("P0: " + kP0 + "\nP1: " + kP1, KittiCameras::kColor); }, {"has no row P2"});
  expect_refused([&] { read_calibration(folder_ / "none.txt"); }, {"none.txt", "No such file"});
}

TEST_F(CalibrationIo, AsManyKeysAsFitTakeLittleTime) {
  std::string text;
  for (int i = 100000; text.size() + 200 < std::size_t{1} << 20; ++i) text += "k" + std::to_string(i) + ":\n";
  text += "P0: " + kP0 + "\nP1: " + kP1 + "\n";
  const std::clock_t start = std::clock();
  expect_calibration(read(text), 600, 180, 0.5, 0);
  EXPECT_LT(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC, 2.0);
  expect_text_refused(text + "k100000:\n", {"'k100000' was given in row 1 already"});
}

TEST(RealData, Calibrations) {
  EGOSGM_REQUIRE_DATA(data);
  const Calibration grey = read_calibration(data / "kitti2012/training/calib/000151.txt");
  EXPECT_NEAR(grey.fx, 721.5377, 1e-9);
  EXPECT_NEAR(grey.cx, 609.5593, 1e-9);
  EXPECT_NEAR(grey.baseline_m, 0.537, 5e-4);
  const auto both = data / "kitti2015/training/calib_cam_to_cam/000002.txt";
  EXPECT_NEAR(read_calibration(both, KittiCameras::kColor).baseline_m, 0.533, 5e-4);
  EXPECT_NEAR(read_calibration(both, KittiCameras::kGrey).baseline_m, 0.537, 5e-4);
  const Calibration middlebury = read_calibration(data / "middlebury/Motorcycle/calib.txt");
  EXPECT_NEAR(middlebury.baseline_m, 0.193001, 1e-12);
  EXPECT_NEAR(middlebury.doffs_px, 32.778, 1e-12);
}

}  // namespace
}  // namespace egosgm::vision
