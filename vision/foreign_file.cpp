// SPDX-License-Identifier: Apache-2.0
#include "vision/foreign_file.h"

#include <algorithm>
#include <initializer_list>
#include <set>
#include <string_view>
#include <system_error>

#include "egosgm/error.h"
#include "vision/file_io.h"
#include "vision/file_kinds.h"
#include "vision/frame_names.h"

namespace egosgm::vision {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRectify = ", which `egosgm rectify` reads, with the cameras' calibration";
constexpr const char* kVideo =
    "it is a video, which `egosgm run`, `doctor` and `rectify` read, with the cameras' calibration";
constexpr const char* kNoVideo =
    "it is named as a video, and does not begin like one: is it damaged, or another file under this name?";
constexpr const char* kLive = "it names a live camera, which `egosgm live` reads; in Python, egosgm.live.LivePairs";

constexpr const char* kWeb =
    "it is an address of the network, which nothing here uses: download what it holds; of a live camera, egosgm.run "
    "in Python takes a generator of pairs";

std::string archive(const char* kind) {
  return std::string("it is ") + kind + ": unpack it, and give the folder or the pictures that it holds";
}

bool is_named_as_video(const fs::path& file) {
  static const std::set<std::string> kExtensions{".mp4", ".m4v",  ".mov", ".avi", ".mkv", ".webm",
                                                 ".wmv", ".mpeg", ".mpg", ".flv", ".3gp"};
  return kExtensions.contains(lower(file.extension().string()));
}

bool names_a_camera(const fs::path& path) {
  const std::string text = path.string();
  return text.starts_with("/dev/video") || text.starts_with("/dev/v4l") || is_digits(text);
}

}  // namespace

std::string foreign_kind(std::string_view start, const fs::path& file) {
  using std::string_view_literals::operator""sv;
  struct Kind {
    std::size_t at;
    std::string_view bytes;
    std::string meaning;
  };
  const std::string rosbag =
      is_bag(file) ? kRecording : "it is a recording of ROS under another name: name it .mcap, .bag or .db3";
  const std::string photo = "it is a HEIC or AVIF, as phones write: convert it to PNG or JPEG";
  const std::string misnamed =
      is_image_name(file) ? "" : "it is a PNG or JPEG under another name: name it .png, .jpg or .jpeg";
  const std::string extension = lower(file.extension().string());
  const auto rectified = [&](const char* kind, std::initializer_list<std::string_view> extensions) {
    const bool is_named_so = std::find(extensions.begin(), extensions.end(), extension) != extensions.end();
    const std::string name(*extensions.begin());
    return std::string("it is a ") + kind + (is_named_so ? kRectify : " under another name: name it " + name);
  };
  const std::string raw = "; a camera's raw picture, as DNG, NEF and CR2 are, has to be developed to PNG";
  const std::string tiff = rectified("TIFF", {".tif", ".tiff"});
  const std::string any_tiff = tiff.ends_with(kRectify) ? tiff : tiff + raw;
  const Kind kinds[] = {
      {0, "version https://git-lfs", "it is a pointer of Git LFS, in place of which `git lfs pull` puts the file"},
      {4, "ftyphei", photo},
      {4, "ftypmif1", photo},
      {4, "ftypavif", photo},
      {4, "ftyp", kVideo},
      {0, "GIF8", "it is a GIF: write its pictures as PNG"},
      {0, "\xff\xd8\xff", misnamed},
      {0, "\x89PNG", misnamed},
      {4, "jP  ", "it is JPEG 2000: convert it to PNG"},
      {0, "\x93NUMPY", "it is an array of NumPy: in Python, egosgm.run takes pairs of images; or write them as PNG"},
      {8, "AVI ", kVideo},
      {0, "\x30\x26\xb2\x75", kVideo},  // Windows Media
      {0, "FLV\x01", kVideo},
      {0, "\0\0\1\xba"sv, kVideo},  // MPEG
      {0, "\x1a\x45\xdf\xa3", kVideo},
      {0, "II*\0"sv, any_tiff},
      {0, "MM\0*"sv, any_tiff},
      {8, "WEBP", rectified("WebP", {".webp"})},
      {0, "P5", rectified("PGM", {".pgm"})},
      {0, "P6", rectified("PPM", {".ppm"})},
      {0, "BM", rectified("BMP", {".bmp"})},
      {0, "PK\x03\x04", archive("a zip archive")},
      {0, "7z\xbc\xaf", archive("a 7z archive")},
      {0, "Rar!", archive("a RAR archive")},
      {257, "ustar", archive("a tar archive")},
      {0, "\x1f\x8b", archive("packed by gzip")},
      {0, "BZh", archive("packed by bzip2")},
      {0, "\xfd\x37zXZ", archive("packed by xz")},
      {0, "\x28\xb5\x2f\xfd", archive("packed by zstd")},
      {0, "\x89MCAP", rosbag},
      {0, "#ROSBAG", rosbag},
      {0, "SQLite format 3", rosbag},
      {0, "rosbag2_bagfile_information", "it is the description of a recording of ROS: give the folder that it is in"},
      {0, "Pf\n", "it is a map of floats (PFM): `run` makes such maps, of images"},
      {0, "\x76\x2f\x31\x01", "it is OpenEXR: write its images as PNG of 16 bits"},
      {0, "\x89HDF", "it is HDF5: write its images as PNG, a folder for each camera"},
      {0, "<", "it is a web page or XML: was its download refused?"},
  };
  for (const Kind& kind : kinds) {
    if (start.size() > kind.at && start.substr(kind.at).starts_with(kind.bytes)) return kind.meaning;
  }
  return is_named_as_video(file) ? kNoVideo : "";
}

bool is_video(const fs::path& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return false;
  try {
    return foreign_kind(read_file_start(file, kKindBytes), file) == kVideo;
  } catch (const Error&) {  // it cannot be read, as its reader will say
    return false;
  }
}

std::string foreign_input(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::is_regular_file(status)) {
    const std::string text = path.string();
    if (text.starts_with("file://")) return "it is an address: give the path alone, " + text.substr(7);
    if (text.find("://") != std::string::npos) return kWeb;
    if (text.starts_with('~')) return "a shell alone knows ~ as the home folder: write its path out";
    if (names_a_camera(path)) return kLive;
    const bool is_pattern = text.find('*') != std::string::npos || text.find("%0") != std::string::npos;
    return is_pattern ? "it is a pattern: give --left PATTERN --right PATTERN --calib FILE, patterns in quotes" : "";
  }
  if (is_own_calibration(path)) return "it is a calibration: give the folder of the sequence that it belongs to";
  const std::string extension = lower(path.extension().string());
  struct Kind {
    std::initializer_list<std::string_view> extensions;
    const char* meaning;
  };
  static const Kind kKinds[] = {
      {{".mpo"},
       "it holds both pictures of a 3D camera (MPO), which `egosgm rectify --side-by-side` reads, with the camera's "
       "calibration"},
      {{".jps", ".pns"},
       "it holds both views of a 3D picture side by side: named .jpg or .png, `egosgm rectify --side-by-side` reads "
       "it, "
       "with the camera's calibration"},
      {{".svo", ".svo2"},
       "it is a recording of a ZED: its SDK's ZED_SVO_Export makes a video of it, left and right, which `egosgm "
       "rectify --side-by-side` reads"},
      {{".npz"}, "it holds arrays of NumPy: in Python, egosgm.run takes pairs of images; or write them as PNG"},
      {{".h264", ".264", ".h265", ".265", ".hevc", ".mjpeg", ".mjpg", ".ts", ".mts", ".m2ts"},
       "it is a stream of a video: `ffmpeg -i FILE -c copy FILE.mkv` makes a video of it that `egosgm run` reads"},
      {{".csv", ".txt"},
       "it is text: where its rows name pairs of images, `egosgm rectify --list` reads it, with the cameras' "
       "calibration"},
  };
  for (const Kind& kind : kKinds) {
    if (std::find(kind.extensions.begin(), kind.extensions.end(), extension) != kind.extensions.end()) {
      return kind.meaning;
    }
  }
  try {
    return foreign_kind(read_file_start(path, kKindBytes), path);
  } catch (const Error&) {  // it cannot be read, and is no folder anyway
    return {};
  }
}

}  // namespace egosgm::vision
