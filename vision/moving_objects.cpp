// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/moving_objects.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "egosgm/error.h"
#include "host/odometry/geometry.h"
#include "host/quantile.h"
#include "vision/no_value.h"
#include "vision/pixel_group.h"
#include "vision/pixel_motion.h"
#include "vision/rigid_alignment.h"
#include "vision/window_sums.h"

namespace egosgm::vision {
namespace {

constexpr std::size_t kMaxObjects = 15;
constexpr int kMinPixels = 80;                    // of an object
constexpr std::size_t kMaxPoints = 600;           // of a fit
constexpr std::size_t kMaxAsked = 200;            // pixels of a group that are asked for a median
constexpr int kBlock_px = 4;                      // new groups are found among blocks of this side
constexpr int kNewPad_px = 14, kKnownPad_px = 8;  // around a group, where its label may reach
constexpr int kMergePad_px = 7;

// What makes a candidate an object.
constexpr double kMinFlow_px = 1;                        // that its motion makes beside the camera's
constexpr double kMinContradiction = 14;                 // of the camera's motion: squared, in standard deviations
constexpr double kMinShare = 0.4;                        // of its points that agree with its motion
constexpr double kMinKnownGain = 0.67, kMinNewGain = 1;  // in the mean of its label
constexpr double kMaxNewCost = 2.1;                      // of its own motion, in that mean
constexpr double kMaxCostOfGain = 0.8;                   // if it costs more: what comes from behind something does
constexpr double kMaxVelocity_m = 3.5;
constexpr double kSteadyShare = 0.5, kSteady_m = 0.02;  // by which its velocity may differ from that before
constexpr double kSameFlow_px = 1.5;                    // two that differ by less are one object
constexpr double kSharedErrors = 16;                    // points whose disparities have an error in common count as one

// What a motion costs at a pixel, in units of noise.
constexpr float kMaxGreyCost = 10, kMaxDisparityCost = 3, kUnknownCost = 1, kHiddenCost = 1.3f;
constexpr float kMinGain = 0.33f;  // of a labelled pixel and those around, against the camera's motion

bool has_equal_pixels(const Image& a, const Image& b) {
  for (int y = 0; y < a.rows; ++y) {
    if (!std::equal(a.row<float>(y), a.row<float>(y) + a.cols, b.row<float>(y))) return false;
  }
  return true;
}

// A median over a few of a group's pixels: `value` gives none where a pixel says nothing.
template <typename Value>
double median_over(const Group& group, const Value& value) {
  std::vector<double> values;
  const std::size_t step = std::max<std::size_t>(1, group.pixels.size() / kMaxAsked);
  for (std::size_t i = 0; i < group.pixels.size(); i += step) {
    if (const std::optional<double> each = value(group.pixels[i])) values.push_back(*each);
  }
  return values.empty() ? 0 : median(std::move(values));
}

/// The share of a few of a group's pixels for which `holds` does.
template <typename Holds>
double share_of(const Group& group, const Holds& holds) {
  const std::size_t step = std::max<std::size_t>(1, group.pixels.size() / kMaxAsked);
  int asked = 0, held = 0;
  for (std::size_t i = 0; i < group.pixels.size(); i += step, ++asked) held += holds(group.pixels[i]);
  return asked ? static_cast<double>(held) / asked : 0;
}

/// What is known of an object between frames.
struct Track {
  int id = 0, age = 0;
  Eigen::Vector3d velocity_m{0, 0, 0};
  Eigen::Isometry3d own =
      Eigen::Isometry3d::Identity();  // its motion without the camera's, in the newest camera's frame
  Box box{};                          // of its label
};

/// A group on its way to an object.
struct Candidate {
  Track track;  // id 0: a new one
  Group group;
  Eigen::Isometry3d back;  // its motion from the newest frame to the last one
  RigidFit fit{};
  Box box{};          // where its label may reach
  BoxValues gains{};  // 0: not its label's
  Group label{};
  double cost = 0;  // of its motion, in the mean of its label

  bool is_new() const { return track.id == 0; }
};

}  // namespace

struct ObjectTracker::State {
  explicit State(const Calibration& of_images) : calibration(of_images) {}

  void take(AlignedView view, const std::optional<Motion>& given, const Image& dynamic);
  LabelledObjects newest() const { return {moving, moving.empty() ? Image(size, kU8, 0) : labels.clone()}; }
  SceneFlow scene_flow() const;

  const Calibration calibration;
  Size size{};
  std::optional<Motion> motion{};  // of the camera, between the two views
  std::vector<MovingObject> moving{};

 private:
  bool is_inside(int x, int y) const { return x >= 0 && y >= 0 && x < size.width && y < size.height; }
  bool is_measured(int x, int y) const { return now.disparity.at<float>(y, x) > kInvalidDisparity; }
  double disparity(const Pixel& p) const { return now.filled.at<float>(p.y, p.x); }
  std::optional<Eigen::Vector3d> moved(const PixelMotion& motion, const Pixel& p) const {
    return motion(p.x, p.y, disparity(p));
  }
  PixelMotion in_pixels(const Eigen::Isometry3d& motion) const { return {calibration, motion}; }
  Eigen::Vector3d point(const Pixel& p, double d) const { return odometry::triangulate(calibration, p.x, p.y, d); }

  void find_objects(const Image& dynamic);
  void describe(MovingObject& object, const Group& group, const Image& disparities) const;
  bool has_label(int id, const Pixel& before, const Eigen::Vector3d& seen) const;
  double grey_noise(const Image& dynamic) const;
  Group moved_on(const Track& track) const;
  std::vector<Group> new_groups(const Image& dynamic, const std::vector<Candidate>& known) const;
  std::vector<SurfacePoint> points_of(const Group& group) const;
  float cost_of(const Pixel& p, float u_seen, float v_seen, float d_seen) const;
  BoxValues costs(const Box& box, const BoxValues& disparities, const PixelMotion& back) const;
  bool label(Candidate& candidate) const;
  double flow_apart(const Group& group, const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) const;
  double contradiction(const Group& group, const Eigen::Isometry3d& back) const;
  bool moves(const Candidate& candidate) const;
  bool find(Candidate& candidate) const;
  bool absorb(const Group& group, std::vector<Candidate>& found) const;
  void merge(std::vector<Candidate>& found) const;
  void write_labels(const std::vector<Candidate>& found);
  int take_id(const std::vector<Candidate>& found);

  AlignedView last{}, now{};
  bool has_view = false;
  Eigen::Isometry3d since_repeated = Eigen::Isometry3d::Identity();  // the motions that came with the last view again
  Image last_labels{}, labels{};
  std::vector<Track> tracks{};
  Eigen::Isometry3d camera_back = Eigen::Isometry3d::Identity();
  AlignmentNoise noise{};
  int next_id = 1;
};

/// The deviation between grey values of what stands, as a robust standard deviation.
double ObjectTracker::State::grey_noise(const Image& dynamic) const {
  constexpr int kStep_px = 8;
  const PixelMotion by_camera = in_pixels(camera_back);
  Group still;
  for (int y = kStep_px / 2; y < size.height; y += kStep_px) {
    for (int x = kStep_px / 2; x < size.width; x += kStep_px) {
      if (is_measured(x, y) && !dynamic.at<std::uint8_t>(y, x)) still.add(x, y);
    }
  }
  const double median = median_over(still, [&](const Pixel& p) -> std::optional<double> {
    const auto seen = moved(by_camera, p);
    if (!seen) return std::nullopt;
    const int u = static_cast<int>(std::lround(seen->x())), v = static_cast<int>(std::lround(seen->y()));
    if (!is_inside(u, v)) return std::nullopt;
    return std::abs(last.greys[0].at<float>(v, u) - now.greys[0].at<float>(p.y, p.x));
  });
  return std::max(AlignmentNoise().grey, 1.48 * median);
}

/// The pixels of a track's label, where its own motion puts them in the newest frame.
Group ObjectTracker::State::moved_on(const Track& track) const {
  const PixelMotion ahead = in_pixels(motion->current_from_previous * track.own);
  Image there(size, kU8, 0);
  Group seen_at;
  for (int y = track.box.top; y < track.box.bottom; ++y) {
    for (int x = track.box.left; x < track.box.right; ++x) {
      if (last_labels.at<std::uint8_t>(y, x) != track.id) continue;
      const auto seen = ahead(x, y, last.filled.at<float>(y, x));
      if (!seen) continue;
      const int u = static_cast<int>(std::floor(seen->x())), v = static_cast<int>(std::floor(seen->y()));
      for (const Pixel& p : {Pixel{u, v}, {u + 1, v}, {u, v + 1}, {u + 1, v + 1}}) {
        if (!is_inside(p.x, p.y) || std::abs(disparity(p) - seen->z()) >= 2 * alike_px(seen->z())) continue;
        there.at<std::uint8_t>(p.y, p.x) = 1;
        seen_at.add(p.x, p.y);
      }
    }
  }
  Group group;
  for (int y = seen_at.box.top; y < seen_at.box.bottom; ++y) {
    for (int x = seen_at.box.left; x < seen_at.box.right; ++x) {
      if (there.at<std::uint8_t>(y, x)) group.add(x, y);
    }
  }
  return group;
}

/// The groups of what `dynamic` marks, beside the known ones. Pixels that the right camera does not see have no
/// measured disparity and do not count.
std::vector<Group> ObjectTracker::State::new_groups(const Image& dynamic, const std::vector<Candidate>& known) const {
  const Box blocks{0, 0, size.width / kBlock_px, size.height / kBlock_px};
  std::vector<char> is_known(blocks.area(), 0);
  for (const Candidate& candidate : known) {
    for (const Pixel& p : candidate.group.pixels) {
      for (int y = p.y / kBlock_px - 1; y <= p.y / kBlock_px + 1; ++y) {
        for (int x = p.x / kBlock_px - 1; x <= p.x / kBlock_px + 1; ++x) {
          if (blocks.contains(x, y)) is_known[blocks.index(x, y)] = 1;
        }
      }
    }
  }
  const auto is_marked = [&](int x, int y) {
    return dynamic.at<std::uint8_t>(y, x) && x >= now.disparity.at<float>(y, x);
  };
  const auto visit_block = [](const Pixel& block, const auto& visit) {
    for (int y = kBlock_px * block.y; y < kBlock_px * (block.y + 1); ++y) {
      for (int x = kBlock_px * block.x; x < kBlock_px * (block.x + 1); ++x) visit(x, y);
    }
  };
  std::vector<float> nearest(blocks.area(), kInvalidDisparity);
  for (int y = 0; y < blocks.bottom; ++y) {
    for (int x = 0; x < blocks.right; ++x) {
      int marked = 0;
      float most = kInvalidDisparity;
      visit_block({x, y}, [&](int u, int v) {
        if (!is_marked(u, v)) return;
        ++marked;
        most = std::max(most, now.disparity.at<float>(v, u));
      });
      if (2 * marked >= kBlock_px * kBlock_px && !is_known[blocks.index(x, y)]) nearest[blocks.index(x, y)] = most;
    }
  }
  const auto disparity_of = [&](int x, int y) { return nearest[blocks.index(x, y)]; };
  const auto of_blocks = connected_groups(
      blocks, [&](int x, int y) { return disparity_of(x, y) > kInvalidDisparity; }, disparity_of);
  std::vector<Group> groups;
  for (const Group& each : of_blocks) {
    Group group;
    for (const Pixel& block : each.pixels) {
      visit_block(block, [&](int x, int y) {
        if (is_marked(x, y)) group.add(x, y);
      });
    }
    if (group.size() >= kMinPixels) groups.push_back(std::move(group));
    if (groups.size() == kMaxObjects) break;
  }
  return groups;
}

std::vector<SurfacePoint> ObjectTracker::State::points_of(const Group& group) const {
  std::vector<SurfacePoint> points;
  const std::size_t step = std::max<std::size_t>(1, group.pixels.size() / kMaxPoints);
  for (std::size_t i = 0; i < group.pixels.size(); i += step) {
    const Pixel p = group.pixels[i];
    if (!is_measured(p.x, p.y)) continue;
    points.push_back({static_cast<double>(p.x), static_cast<double>(p.y), point(p, disparity(p))});
  }
  return points;
}

/// By how much the last frame contradicts that the surface at a pixel came from `seen`. kNoValue: it says nothing.
float ObjectTracker::State::cost_of(const Pixel& p, float u_seen, float v_seen, float d_seen) const {
  const float u0 = std::floor(u_seen), v0 = std::floor(v_seen);
  if (!(u0 >= 0 && v0 >= 0 && u0 + 1 < static_cast<float>(size.width) && v0 + 1 < static_cast<float>(size.height))) {
    return kNoValue;
  }
  const int u = static_cast<int>(u0), v = static_cast<int>(v0);
  const float s = u_seen - u0, t = v_seen - v0;
  const float d = last.disparity.at<float>(v + (t >= 0.5f), u + (s >= 0.5f));
  if (d > d_seen + 0.5f + static_cast<float>(alike_px(d_seen))) return kHiddenCost;  // by something nearer
  const float *upper = last.greys[0].row<float>(v) + u, *lower = last.greys[0].row<float>(v + 1) + u;
  const float grey = (1 - t) * ((1 - s) * upper[0] + s * upper[1]) + t * ((1 - s) * lower[0] + s * lower[1]);
  const float of_grey = std::abs(grey - now.greys[0].at<float>(p.y, p.x)) / static_cast<float>(noise.grey);
  const bool is_known = d > kInvalidDisparity;
  return std::min(of_grey, kMaxGreyCost) +
         (is_known ? std::min(std::abs(d - d_seen), kMaxDisparityCost) : kUnknownCost);
}

/// That of the pixels of a box that have a disparity, if they came from where `back` leads.
BoxValues ObjectTracker::State::costs(const Box& box, const BoxValues& disparities, const PixelMotion& back) const {
  BoxValues of_pixels(box.area(), kNoValue);
  MovedRow seen;
  for (int y = box.top; y < box.bottom; ++y) {
    back.of_row(box.left, y, &disparities[box.index(box.left, y)], box.width(), seen);
    for (int x = box.left; x < box.right; ++x) {
      const auto i = static_cast<std::size_t>(x - box.left);
      of_pixels[box.index(x, y)] = cost_of({x, y}, seen.u[i], seen.v[i], seen.d[i]);
    }
  }
  return of_pixels;
}

/// Decides by the images which pixels near a candidate move with it. False: too few do.
bool ObjectTracker::State::label(Candidate& candidate) const {
  std::vector<double> disparities;
  for (const Pixel& p : candidate.group.pixels) disparities.push_back(disparity(p));
  const auto last = static_cast<double>(disparities.size() - 1);
  const double low = nth_value(disparities, static_cast<std::size_t>(0.06 * last));
  const double high = nth_value(std::move(disparities), static_cast<std::size_t>(0.94 * last));
  const double least = low - 0.5 * alike_px(low), most = high + 0.5 * alike_px(high);
  const Box box = candidate.group.box.padded(candidate.is_new() ? kNewPad_px : kKnownPad_px, size);
  BoxValues near(box.area(), kNoValue);  // disparities as those of the group
  for (int y = box.top; y < box.bottom; ++y) {
    for (int x = box.left; x < box.right; ++x) {
      const double d = disparity({x, y});
      if (d > least && d < most) near[box.index(x, y)] = static_cast<float>(d);
    }
  }

  BoxValues gains = costs(box, near, in_pixels(camera_back));
  const BoxValues by_own = costs(box, near, in_pixels(candidate.back));
  for (std::size_t i = 0; i < gains.size(); ++i) gains[i] -= by_own[i];
  candidate.box = box;
  candidate.gains = means_of_alike(box, near, gains);
  for (float& gain : candidate.gains) gain = gain > kMinGain ? gain : 0;

  std::vector<char> is_in_group(box.area(), 0);
  for (const Pixel& p : candidate.group.pixels) is_in_group[box.index(p.x, p.y)] = 1;
  candidate.label = {};
  const auto parts = connected_groups(
      box, [&](int x, int y) { return candidate.gains[box.index(x, y)] > 0; },
      [&](int x, int y) {
        return disparity({x, y});
      });
  for (const Group& part : parts) {
    int common = 0;
    for (const Pixel& p : part.pixels) common += is_in_group[box.index(p.x, p.y)];
    const bool stays = 10 * common > std::min(part.size(), candidate.group.size());
    for (const Pixel& p : part.pixels) {
      if (stays) {
        candidate.label.add(p.x, p.y);
      } else {
        candidate.gains[box.index(p.x, p.y)] = 0;
      }
    }
  }
  double cost = 0;
  int asked = 0;
  for (const Pixel& p : candidate.label.pixels) {
    const float each = by_own[box.index(p.x, p.y)];
    if (!has_value(each)) continue;
    cost += each;
    ++asked;
  }
  candidate.cost = cost / std::max(asked, 1);
  return candidate.label.size() >= kMinPixels;
}

/// The median distance in (u, v, d) between what two motions do with a group [px].
double ObjectTracker::State::flow_apart(const Group& group, const Eigen::Isometry3d& a,
                                        const Eigen::Isometry3d& b) const {
  const PixelMotion by_a = in_pixels(a), by_b = in_pixels(b);
  return median_over(group, [&](const Pixel& p) -> std::optional<double> {
    const auto one = moved(by_a, p), other = moved(by_b, p);
    if (!one || !other) return std::nullopt;
    return (*one - *other).norm();
  });
}

/// The median, over a group, of how much the camera's motion contradicts what was seen: squared, in standard deviations
/// of flow and disparities. A wrong disparity moves a static point along a line, and that is no contradiction.
double ObjectTracker::State::contradiction(const Group& group, const Eigen::Isometry3d& back) const {
  constexpr double kFlow2 = 0.25, kDisparity2 = 0.25, kLastDisparity2 = 0.5, kStep_px = 0.5;
  const Eigen::Array3d information(1 / kFlow2, 1 / kFlow2, 1 / kLastDisparity2);
  const PixelMotion by_own = in_pixels(back), by_camera = in_pixels(camera_back);
  return median_over(group, [&](const Pixel& p) -> std::optional<double> {
    const auto seen = moved(by_own, p), there = moved(by_camera, p),
               nearer = by_camera(p.x, p.y, disparity(p) + kStep_px);
    if (!seen || !there || !nearer) return std::nullopt;
    const Eigen::Array3d apart = *seen - *there, by_disparity = (*nearer - *there) / kStep_px;
    const double along = (by_disparity * information * apart).sum();
    return (apart * information * apart).sum() -
           along * along / (1 / kDisparity2 + (by_disparity * information * by_disparity).sum());
  });
}

/// Whether a candidate's motion is more than noise, by the images and by geometry.
bool ObjectTracker::State::moves(const Candidate& candidate) const {
  double gain = 0;
  for (const float each : candidate.gains) gain += each / static_cast<float>(candidate.label.size());
  return gain >= (candidate.is_new() ? kMinNewGain : kMinKnownGain) &&
         !(candidate.is_new() && candidate.cost > std::max(kMaxNewCost, kMaxCostOfGain * gain)) &&
         candidate.fit.share >= kMinShare && flow_apart(candidate.label, candidate.back, camera_back) >= kMinFlow_px &&
         contradiction(candidate.label, candidate.back) >= kMinContradiction;
}

/// Whether a candidate is an object, with its motion and its label.
bool ObjectTracker::State::find(Candidate& candidate) const {
  for (const bool is_first : {true, false}) {
    const std::vector<SurfacePoint> points = points_of(candidate.group);
    const Eigen::Isometry3d start = is_first && candidate.is_new()
                                        ? best_shift(calibration, now, last, points, camera_back, noise)
                                        : candidate.back;
    const std::optional<RigidFit> fit = align_rigidly(calibration, now, last, points, start, noise);
    if (!fit) return false;
    candidate.fit = *fit;
    candidate.back = fit->motion;
    if (!label(candidate) || !moves(candidate)) return false;
    candidate.group = candidate.label;
  }
  const Eigen::Isometry3d& camera = motion->current_from_previous;
  const Eigen::Vector3d velocity = candidate.back.inverse() * candidate.fit.centre_m - camera * candidate.fit.centre_m;
  if (velocity.norm() > kMaxVelocity_m) return false;
  const Eigen::Vector3d before = camera.linear() * candidate.track.velocity_m;
  return candidate.is_new() ||
         (velocity - before).norm() <= kSteadyShare * std::max(velocity.norm(), before.norm()) + kSteady_m;
}

/// Whether the last frame cannot show a new group. Then it belongs to the object beside it that came from behind
/// something, or it is ground that an object uncovered.
bool ObjectTracker::State::absorb(const Group& group, std::vector<Candidate>& found) const {
  for (Candidate& object : found) {
    if (!group.box.padded(kBlock_px, size).touches(object.label.box)) continue;
    const PixelMotion by_object = in_pixels(object.back);
    const double hidden = share_of(group, [&](const Pixel& p) {
      const auto seen = moved(by_object, p);
      const float there =
          seen ? cost_of(p, static_cast<float>(seen->x()), static_cast<float>(seen->y()), static_cast<float>(seen->z()))
               : kNoValue;
      return !has_value(there) || there == kHiddenCost;
    });
    if (hidden < 0.5) continue;
    for (const Pixel& p : group.pixels) object.label.add(p.x, p.y);
    return true;
  }
  const PixelMotion by_camera = in_pixels(camera_back);
  return share_of(group, [&](const Pixel& p) {
           const auto seen = moved(by_camera, p);
           if (!seen) return false;
           const int u = static_cast<int>(std::lround(seen->x())), v = static_cast<int>(std::lround(seen->y()));
           return is_inside(u, v) && last_labels.at<std::uint8_t>(v, u) != 0;
         }) > 0.5;
}

/// Two parts side by side that move alike are one object: the first one takes the other's pixels.
void ObjectTracker::State::merge(std::vector<Candidate>& found) const {
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (std::size_t j = found.size(); j-- > i + 1;) {
      if (!found[i].label.box.padded(kMergePad_px, size).touches(found[j].label.box)) continue;
      if (flow_apart(found[j].label, found[i].back, found[j].back) > kSameFlow_px) continue;
      for (const Pixel& p : found[j].label.pixels) found[i].label.add(p.x, p.y);
      found.erase(found.begin() + static_cast<std::ptrdiff_t>(j));
    }
  }
}

/// An id that no object of this frame has, and none before it for as long as may be.
int ObjectTracker::State::take_id(const std::vector<Candidate>& found) {
  const auto is_taken = [&] {
    return std::any_of(found.begin(), found.end(), [&](const Candidate& each) { return each.track.id == next_id; });
  };
  while (is_taken()) next_id = next_id % 255 + 1;
  return std::exchange(next_id, next_id % 255 + 1);
}

/// Labels each pixel with the object that gains most there.
void ObjectTracker::State::write_labels(const std::vector<Candidate>& found) {
  Image best(size, kF32, -1);
  for (const Candidate& each : found) {
    for (const Pixel& p : each.label.pixels) {
      const float gain = each.box.contains(p.x, p.y) ? each.gains[each.box.index(p.x, p.y)] : 0;
      if (gain <= best.at<float>(p.y, p.x)) continue;
      best.at<float>(p.y, p.x) = gain;
      labels.at<std::uint8_t>(p.y, p.x) = static_cast<std::uint8_t>(each.track.id);
    }
  }
}

void ObjectTracker::State::find_objects(const Image& dynamic) {
  camera_back = motion->current_from_previous.inverse();
  noise.grey = grey_noise(dynamic);
  std::vector<Candidate> candidates;
  for (const Track& track : tracks) {
    Candidate candidate{track, moved_on(track), (motion->current_from_previous * track.own).inverse()};
    if (candidate.group.size() >= kMinPixels) candidates.push_back(std::move(candidate));
  }
  for (Group& group : new_groups(dynamic, candidates)) candidates.push_back({{}, std::move(group), camera_back});

  std::vector<Candidate> found;
  for (Candidate& candidate : candidates) {
    if (found.size() == kMaxObjects || (candidate.is_new() && absorb(candidate.group, found))) continue;
    if (find(candidate)) found.push_back(std::move(candidate));
  }
  merge(found);
  for (Candidate& each : found) {
    if (each.is_new()) each.track.id = take_id(found);
  }
  write_labels(found);

  std::array<Group, 256> labelled;  // a pixel once, though two candidates may share it
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (const std::uint8_t id = labels.at<std::uint8_t>(y, x)) labelled[id].add(x, y);
    }
  }
  tracks.clear();
  for (const Candidate& each : found) {
    MovingObject object;
    object.id = each.track.id;
    object.age = each.track.age + 1;
    object.current_from_previous = each.back.inverse();
    const Group& group = labelled[static_cast<std::size_t>(object.id)];
    if (group.pixels.empty()) continue;
    describe(object, group, now.filled);
    object.velocity_m = object.centre_m - motion->current_from_previous * (each.back * object.centre_m);
    object.velocity_covariance_m2 = kSharedErrors * each.fit.covariance.topLeftCorner<3, 3>();
    tracks.push_back({object.id, object.age, object.velocity_m, object.current_from_previous * camera_back, group.box});
    moving.push_back(std::move(object));
  }
}

/// Pixels, box and centre of an object.
void ObjectTracker::State::describe(MovingObject& object, const Group& group, const Image& disparities) const {
  object.pixels = group.size();
  object.left = group.box.left;
  object.top = group.box.top;
  object.right = group.box.right - 1;
  object.bottom = group.box.bottom - 1;
  object.centre_m.setZero();
  for (const Pixel& p : group.pixels) object.centre_m += point(p, disparities.at<float>(p.y, p.x)) / group.size();
}

void ObjectTracker::State::take(AlignedView view, const std::optional<Motion>& given, const Image& dynamic) {
  size = view.disparity.size();
  const bool repeats = given && has_view && has_equal_pixels(view.greys[0], now.greys[0]);
  last = std::exchange(now, std::move(view));
  motion = std::exchange(has_view, true) ? given : std::nullopt;
  moving.clear();
  if (repeats) {  // the same moment: all stands, and objects go on with the next view
    since_repeated = given->current_from_previous * since_repeated;
    motion = Motion();
    last_labels = labels;
    return;
  }
  last_labels = std::exchange(labels, Image(size, kU8, 0));
  if (motion) motion->current_from_previous = motion->current_from_previous * since_repeated;
  since_repeated.setIdentity();
  if (motion) {
    find_objects(dynamic);
  } else {
    tracks.clear();
  }
}

SceneFlow ObjectTracker::State::scene_flow() const {
  constexpr int kPad_px = 16;  // around the pixels of a label in the newest frame, moved back
  SceneFlow result{last.filled.clone(), Image(size, kF32), Image(size, kFlow), Image(size, kU8, 0), {}, *motion};
  struct Mover {
    const MovingObject* object;
    PixelMotion ahead;
    Box box;
    Group label;
  };
  std::vector<Mover> movers;
  for (const MovingObject& object : moving) {
    const PixelMotion back = in_pixels(object.current_from_previous.inverse());
    Group before;
    for (int y = object.top; y <= object.bottom; ++y) {
      for (int x = object.left; x <= object.right; ++x) {
        if (labels.at<std::uint8_t>(y, x) != object.id) continue;
        if (const auto seen = moved(back, {x, y})) {
          before.add(static_cast<int>(std::lround(std::clamp(seen->x(), 0.0, size.width - 1.0))),
                     static_cast<int>(std::lround(std::clamp(seen->y(), 0.0, size.height - 1.0))));
        }
      }
    }
    movers.push_back({&object, in_pixels(object.current_from_previous), before.box.padded(kPad_px, size), {}});
  }
  const PixelMotion by_camera = in_pixels(motion->current_from_previous);
  const auto write = [&](int x, int y, float u, float v, float d) {
    float* flow = result.flow.row<float>(y) + 2 * x;
    flow[0] = u - static_cast<float>(x);
    flow[1] = v - static_cast<float>(y);
    result.next_disparity.at<float>(y, x) = has_value(d) ? d : kInvalidDisparity;
  };
  MovedRow there;
  for (int y = 0; y < size.height; ++y) {
    by_camera.of_row(0, y, last.filled.row<float>(y), size.width, there);
    for (int x = 0; x < size.width; ++x) {
      const auto i = static_cast<std::size_t>(x);
      write(x, y, there.u[i], there.v[i], there.d[i]);
    }
  }
  for (std::size_t i = movers.size(); i-- > 0;) {  // the first one has the last word
    Mover& each = movers[i];
    for (int y = each.box.top; y < each.box.bottom; ++y) {
      for (int x = each.box.left; x < each.box.right; ++x) {
        const auto seen = each.ahead(x, y, last.filled.at<float>(y, x));
        if (!seen || !has_label(each.object->id, {x, y}, *seen)) continue;
        result.labels.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(each.object->id);
        write(x, y, static_cast<float>(seen->x()), static_cast<float>(seen->y()), static_cast<float>(seen->z()));
      }
    }
  }
  for (Mover& each : movers) {
    for (int y = each.box.top; y < each.box.bottom; ++y) {
      for (int x = each.box.left; x < each.box.right; ++x) {
        if (result.labels.at<std::uint8_t>(y, x) == each.object->id) each.label.add(x, y);
      }
    }
  }
  const Eigen::Isometry3d camera = motion->current_from_previous;
  for (const Mover& each : movers) {
    if (each.label.pixels.empty()) continue;
    MovingObject object = *each.object;
    describe(object, each.label, last.filled);
    object.velocity_m = camera.inverse() * (object.current_from_previous * object.centre_m) - object.centre_m;
    const Eigen::Matrix3d turn = camera.linear().transpose();
    object.velocity_covariance_m2 = turn * object.velocity_covariance_m2 * turn.transpose();
    result.moving.push_back(std::move(object));
  }
  return result;
}

/// Whether a pixel of the earlier frame has a label, if its object takes it to `seen`. Where the newest frame shows it,
/// the label there decides; where not, the pixel's own before.
bool ObjectTracker::State::has_label(int id, const Pixel& before, const Eigen::Vector3d& seen) const {
  const int u = static_cast<int>(std::lround(seen.x())), v = static_cast<int>(std::lround(seen.y()));
  const double most = 0.5 + alike_px(seen.z());
  const double nearer = is_inside(u, v) ? disparity({u, v}) - seen.z() : INFINITY;
  if (nearer > most) return last_labels.at<std::uint8_t>(before.y, before.x) == id;
  return nearer >= -most && labels.at<std::uint8_t>(v, u) == id;
}

ObjectTracker::ObjectTracker(const Calibration& calibration) {
  calibration.validate();
  state_ = std::make_unique<State>(calibration);
}
ObjectTracker::~ObjectTracker() = default;
ObjectTracker::ObjectTracker(ObjectTracker&&) noexcept = default;
ObjectTracker& ObjectTracker::operator=(ObjectTracker&&) noexcept = default;

LabelledObjects ObjectTracker::process(const Image& left, const Image& disparity, const Image& dynamic,
                                       const std::optional<Motion>& motion) {
  const bool has_types = (left.type == kU8 || left.type == kU16) && disparity.type == kF32 && dynamic.type == kU8;
  if (!has_types || left.empty() || disparity.size() != left.size() || dynamic.size() != left.size()) {
    throw InvalidArgument(
        "ObjectTracker: the maps do not belong together: give a grey image, its disparity (kF32) and its `dynamic` "
        "(kU8), all of one size");
  }
  if (!state_->size.empty() && left.size() != state_->size) {
    throw InvalidArgument("ObjectTracker: the images changed their size: make a new tracker for them");
  }
  if (motion) motion->validate();
  state_->take(make_view(left, disparity), motion, dynamic);
  return state_->newest();
}

std::optional<SceneFlow> ObjectTracker::scene_flow() const {
  if (!state_->motion) return std::nullopt;
  return state_->scene_flow();
}

}  // namespace egosgm::vision
