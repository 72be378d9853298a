// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "egosgm/calibration.h"
#include "egosgm/error.h"
#include "egosgm/export.h"

namespace egosgm::vision {

/// Which of KITTI's two stereo pairs: cameras 0 and 1 are grey, 2 and 3 are colour.
enum class KittiCameras { kAny, kGrey, kColor };

/// The right camera stands left of the left one.
class EGOSGM_EXPORT NegativeBaseline : public InvalidArgument {
 public:
  using InvalidArgument::InvalidArgument;
};

/// Reads a rectified pair's calibration. The file's keys tell which of the formats it is:
///  - KITTI odometry, KITTI 2012:      `P0: <12 numbers>`, `P1: ...` (and P2, P3), 3x4 projection matrices, row-major;
///  - KITTI raw, 2015 calib_cam_to_cam: `P_rect_00: <12 numbers>`, ..., and DrivingStereo's `P_rect_101`, `P_rect_103`;
///    the baseline is compared with T_00, ... where they are there; other rows are ignored;
///  - Middlebury 2014 calib.txt:       `cam0=[f 0 cx; 0 f cy; 0 0 1]`, `cam1=...`, `doffs=` [px], `baseline=` [mm];
///  - EgoSGM's own, flat TOML or YAML: `fx = 721.5` or `fx: 721.5`, a row each for fx, fy, cx, cy, baseline_m and, if
///  not
///    zero, doffs_px; `#` starts a comment; any other key is refused.
/// With P matrices, baseline_m = (P_left[0][3] - P_right[0][3]) / f and doffs_px = cx_right - cx_left. `cameras`
/// matters only for KITTI's; kAny takes the grey pair where the file has it, else the colour pair. Throws
/// InvalidArgument with file, row and remedy: too few numbers, not a number, NaN, zero focal length, zero or negative
/// baseline (NegativeBaseline), a transposed matrix, no such cameras, unknown key, a format that is known and not read
/// here. Thread-safe.
EGOSGM_EXPORT Calibration read_calibration(const std::filesystem::path& file,
                                           KittiCameras cameras = KittiCameras::kAny);

/// A calibration, and the size of the images that it is of, where the file says it (KITTI's S_rect, Middlebury's width
/// and height), else 0.
struct SizedCalibration {
  Calibration calibration;
  int width = 0, height = 0;
};

/// As read_calibration.
EGOSGM_EXPORT SizedCalibration read_sized_calibration(const std::filesystem::path& file,
                                                      KittiCameras cameras = KittiCameras::kAny);

/// Writes EgoSGM's own format (TOML). Throws IoError, and as Calibration::validate. Thread-safe for different files.
EGOSGM_EXPORT void write_calibration(const std::filesystem::path& file, const Calibration& calibration);

}  // namespace egosgm::vision
