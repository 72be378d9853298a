// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/synthetic.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "egosgm/error.h"
#include "egosgm/image.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/poses_io.h"
#include "vision/file_io.h"
#include "vision/frame_names.h"
#include "vision/image_values.h"
#include "vision/object_table.h"
#include "vision/synthetic_render.h"
#include "vision/synthetic_scene.h"

namespace egosgm::vision {
namespace {

constexpr double kSmallestRadius_m = 15;  // a tighter bend would drive the houses' corners onto the road

template <typename... Parts>
std::string text(const Parts&... parts) {
  std::ostringstream out;
  out.precision(12);
  (out << ... << parts);
  return out.str();
}

void require_range(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;
  throw InvalidArgument(text("synthetic ", name, " = ", value, " is out of range: choose ", low, " to ", high));
}

Image only_noc(const Image& disparity, const Image& noc) {
  Image kept = disparity.clone();
  set_where(kept, kInvalidDisparity, noc, [](auto value) { return value == 0; });
  return kept;
}

std::string calibration_rows(const Calibration& c) {
  std::string rows;
  for (int camera = 0; camera < 4; ++camera) {
    const double shift = camera % 2 ? -c.fx * c.baseline_m : 0.0;
    rows += text("P", camera, ": ", c.fx, " 0 ", c.cx, " ", shift, " 0 ", c.fy, " ", c.cy, " 0 0 0 1 0\n");
  }
  return rows;
}

void write_frame(const SyntheticFrame& frame, const std::string& name, bool with_moving,
                 const std::filesystem::path& folder) {
  write_png(folder / "image_0" / name, frame.left);
  write_png(folder / "image_1" / name, frame.right);
  const std::filesystem::path truth = folder / "truth";
  write_disparity_png(truth / "left_disp_occ" / name, frame.left_disparity);
  write_disparity_png(truth / "left_disp_noc" / name, only_noc(frame.left_disparity, frame.left_noc));
  write_disparity_png(truth / "right_disp_occ" / name, frame.right_disparity);
  write_disparity_png(truth / "right_disp_noc" / name, only_noc(frame.right_disparity, frame.right_noc));
  if (!with_moving) return;
  write_png(truth / "left_moving" / name, frame.left_moving);
  write_png(truth / "right_moving" / name, frame.right_moving);
}

}  // namespace

void SyntheticOptions::validate() const {
  require_range("frames", frames, 1, 10000);
  require_range("width", width, 1, 8192);
  require_range("height", height, 1, 8192);
  require_range("moving_object_scale", moving_object_scale, 0.5, 8);
  require_range("speed_m", speed_m, 0, 3);
  require_range("turn_deg", turn_deg, -4, 4);
  require_range("wobble", wobble, 0, 3);
  require_range("noise_grey", noise_grey, 0, 20);
  require_range("exposure", exposure, 0.01, 4);
  require_range("pole_width_px", pole_width_px, 1, 20);
  require_range("pole_spacing_m", pole_spacing_m, 1, 1000);
  require_range("supersampling", supersampling, 1, 8);
  if (traffic && (!moving_object || plain)) {
    throw InvalidArgument("synthetic traffic: joins moving_object in a street that is not plain: choose that too");
  }
  if (speed_m > 0 && speed_m < kSmallestRadius_m * std::abs(turn_deg) * synthetic::kDegrees) {
    throw InvalidArgument(text("synthetic turn_deg = ", turn_deg, " at speed_m = ", speed_m, " turns on less than ",
                               kSmallestRadius_m, " m: choose a turn of at most ",
                               speed_m / kSmallestRadius_m / synthetic::kDegrees));
  }
}

struct SyntheticSequence::Scene {
  explicit Scene(const SyntheticOptions& options) : street(options) {}
  synthetic::Street street;
};

SyntheticSequence::SyntheticSequence(const SyntheticOptions& options) {
  options.validate();
  scene_ = std::make_unique<const Scene>(options);
}
SyntheticSequence::~SyntheticSequence() = default;
SyntheticSequence::SyntheticSequence(SyntheticSequence&&) noexcept = default;
SyntheticSequence& SyntheticSequence::operator=(SyntheticSequence&&) noexcept = default;

const SyntheticOptions& SyntheticSequence::options() const { return scene_->street.options; }

Calibration SyntheticSequence::calibration() const {
  const synthetic::Camera camera = synthetic::left_camera(scene_->street, 0);
  return {camera.focal_px, camera.focal_px, camera.cx, camera.cy, synthetic::kBaseline_m, 0};
}

Isometry SyntheticSequence::world_from_camera(int frame) const {
  if (frame < 0 || frame >= frames()) {
    throw InvalidArgument(text("synthetic frame ", frame, " does not exist: choose 0 to ", frames() - 1));
  }
  if (frame == 0) return Isometry::Identity();
  return scene_->street.camera_pose(0).inverse() * scene_->street.camera_pose(frame);
}

Motion SyntheticSequence::motion(int frame) const {
  Motion motion;
  const Eigen::Isometry3d world_from_current = world_from_camera(frame);
  if (frame > 0) motion.current_from_previous = world_from_current.inverse() * world_from_camera(frame - 1);
  return motion;
}

SyntheticFrame SyntheticSequence::render(int frame) const {
  SyntheticFrame out;
  out.world_from_camera = world_from_camera(frame);
  synthetic::render_pair(scene_->street, frame, out);
  return out;
}

SyntheticSceneFlow SyntheticSequence::scene_flow(int frame) const {
  world_from_camera(frame);  // refuses frames that do not exist
  SyntheticSceneFlow out;
  synthetic::find_scene_flow(scene_->street, frame, out);
  return out;
}

void write_sequence(const SyntheticOptions& options, const std::filesystem::path& folder,
                    const std::function<void(int done, int frames)>& progress) {
  const SyntheticSequence sequence(options);
  for (const char* images : {"image_0", "image_1"}) make_folder(folder / images);
  for (const std::string view : {"truth/left_", "truth/right_"}) {
    for (const char* map : {"disp_occ", "disp_noc"}) make_folder(folder / (view + map));
    if (options.moving_object) make_folder(folder / (view + "moving"));
  }
  const std::filesystem::path truth = folder / "truth";
  for (const char* map : {"flow", "disp_1", "seen_next", "objects"}) {
    if (options.moving_object) make_folder(truth / map);
  }

  std::vector<Isometry> poses;
  std::string times, objects = std::string(kObjectColumns) + "\n";
  const auto write_rows = [&] {
    write_file(folder / "times.txt", times);
    write_poses(folder / "poses.txt", poses);
    if (options.moving_object) write_file(truth / "objects.csv", objects);
  };
  write_file(folder / "calib.txt", calibration_rows(sequence.calibration()));
  for (int k = 0; k < options.frames; ++k) {
    poses.push_back(sequence.world_from_camera(k));
    times += text(0.1 * k, "\n");
    const std::string name = padded(std::to_string(k), 6) + ".png";
    write_frame(sequence.render(k), name, options.moving_object, folder);
    if (options.moving_object) {
      const SyntheticSceneFlow next = sequence.scene_flow(k);
      write_png(truth / "objects" / name, next.objects);
      if (k + 1 < options.frames) {
        write_flow_png(truth / "flow" / name, next.flow);
        write_disparity_png(truth / "disp_1" / name, next.next_disparity);
        write_png(truth / "seen_next" / name, next.seen_next);
        for (const SyntheticObject& object : next.moving) {
          objects += object_row(std::to_string(k), object, object.next_from_current) + "\n";
        }
      }
    }
    try {
      if (progress) progress(k + 1, options.frames);
    } catch (...) {  // whoever stops it has a shorter sequence
      write_rows();
      throw;
    }
  }
  write_rows();
}

}  // namespace egosgm::vision
