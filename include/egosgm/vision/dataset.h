// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/export.h"
#include "egosgm/motion.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// One stereo pair on disk, and its true disparity where the data set has one (else the paths are empty).
struct StereoFrame {
  int number = 0;    // the frame's own number: 10 for 000151_10.png
  std::string name;  // outputs are named NAME.png: the number with six digits, or a time of more digits than fit there
  std::filesystem::path left, right;           // PNG or JPEG
  std::filesystem::path truth_noc, truth_occ;  // left disparity: non-occluded pixels, all pixels
};

/// Frames of one rectified camera pair, one after the other. `frames` is not empty and ascends in `number`; numbers may
/// have gaps, of which `note` tells.
struct StereoSequence {
  std::string title;  // "KITTI 2012 scene 000151"
  std::vector<StereoFrame> frames;
  std::vector<int> numbers;     // of all frames that are there, chosen or not, ascending
  std::string note;             // what is unusual about the frames, for the user; empty where nothing is
  bool has_calibration = true;  // else `calibration` stands in for one: there is no depth, and no odometry
  Calibration calibration;
  int calibrated_width = 0, calibrated_height = 0;  // of the images that the calibration is of, where its file says it
  std::filesystem::path calibration_file;
  std::filesystem::path poses_file;  // the true poses, empty where there are none
  std::filesystem::path times_file;  // when the frames were taken, empty where no file says so
};

/// The rule that pairs left and right images: equal texts in their names, or their order.
enum class PairBy { kName, kOrder };

/// Frame numbers first..last, both included. An open end takes what there is.
struct FrameRange {
  std::optional<int> first, last;
};

/// "7:10", "7:", ":10" or "7". Throws InvalidArgument.
EGOSGM_EXPORT FrameRange parse_frame_range(const std::string& text);

// The openers look at names and read the calibration; images are read one by one later. They throw InvalidArgument,
// naming the file or folder and the remedy: a folder or calibration missing, no such scene (the nearest ones are
// listed), an end of the range beyond the frames, a left image without its right one, two files for one image, a folder
// of another level or layout (with what was found there). Thread-safe.

/// KITTI 2012 (image_0, image_1, calib) or 2015 (image_2, image_3, calib_cam_to_cam) multi-view: `folder` is
/// `training`, `testing` or their parent; `scene` is "000151" or "151".
EGOSGM_EXPORT StereoSequence open_kitti_multiview(const std::filesystem::path& folder, const std::string& scene,
                                                  FrameRange range = {});

/// KITTI odometry: image_0 and image_1 (else image_2 and image_3), calib.txt, poses.txt if there (also
/// ../../poses/NAME.txt). Truth is taken from truth/left_disp_noc and truth/left_disp_occ (as write_sequence makes
/// them) where the folder has them.
EGOSGM_EXPORT StereoSequence open_kitti_odometry(const std::filesystem::path& folder, FrameRange range = {});

/// KITTI raw, synchronised and rectified drive: image_00/data and image_01/data (else 02 and 03), calib_cam_to_cam.txt
/// in the folder or its parent.
EGOSGM_EXPORT StereoSequence open_kitti_raw(const std::filesystem::path& folder, FrameRange range = {});

/// Middlebury 2014 scene: im0.png, im1.png, calib.txt, disp0GT.pfm if there. One frame, number 0.
EGOSGM_EXPORT StereoSequence open_middlebury(const std::filesystem::path& folder, FrameRange range = {});

/// Any pair of images or patterns. A pattern's file name holds one `%d`, `%06d`, ... (the frame's number) or one `*`,
/// which may stand in a folder's name instead (`*/left.png`);
/// without an extension it means PNG and JPEG. Left and right files with equal text there, or one number, belong
/// together, or, with PairBy::kOrder, the first ones, the second ones, and so on. The (left) text is the frame's number
/// if all of them are numbers, else frames are counted from 0 in the order of names, numbers in them by their value.
/// Without `%d` or `*`, or where it is there, it names one pair, number 0. A left folder called image_2 or image_02
/// takes the colour cameras of KITTI's calibration, and so do images in colour; any other the grey ones. An empty
/// `calibration_file` is none.
EGOSGM_EXPORT StereoSequence open_patterns(const std::string& left, const std::string& right,
                                           const std::filesystem::path& calibration_file, FrameRange range = {},
                                           PairBy pair_by = PairBy::kName);

/// Opens `folder` as whichever of KITTI odometry, KITTI raw or Middlebury it is, or as two folders of images, left and
/// right (cam0 and cam1, image_left and image_right), or as a folder for each pair with left.png and right.png, or as
/// one folder with left_1.png, right_1.png and so on; with their calibration, calib.txt or calibration.txt, and
/// poses.txt if there. A calibration of another name is refused.
EGOSGM_EXPORT StereoSequence open_folder(const std::filesystem::path& folder, FrameRange range = {});

struct StereoImages {
  Image left, right;  // both kU8 or both kU16, of one size
};

/// Reads both images as grey. Throws InvalidArgument, naming both files, where their sizes or depths differ.
/// Thread-safe.
EGOSGM_EXPORT StereoImages read_images(const StereoFrame& frame);

/// Reads only the headers: throws InvalidArgument at the first image whose size is not that of the first, and where the
/// calibration is of images of another size. Thread-safe.
EGOSGM_EXPORT Size check_image_sizes(const StereoSequence& sequence);

/// Which of a file's `rows` belongs to each frame. A file has a row for each number from 0 to the sequence's last one
/// (as KITTI's have), or for each frame of the sequence, or for each chosen frame; where `numbers` is empty (unknown),
/// for each frame, or for each number up to the last one at least. Throws InvalidArgument, naming the file and `what`
/// its rows are, where none fits, and where a frame is none of `numbers`. Thread-safe.
EGOSGM_EXPORT std::vector<std::size_t> rows_of_frames(const StereoSequence& sequence, std::size_t rows,
                                                      const std::filesystem::path& file, const std::string& what);

/// The pose of each frame, by rows_of_frames. Throws as it and read_poses do.
EGOSGM_EXPORT std::vector<Isometry> poses_of_frames(const StereoSequence& sequence,
                                                    const std::filesystem::path& poses_file);

}  // namespace egosgm::vision
