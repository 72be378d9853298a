// SPDX-License-Identifier: Apache-2.0
// A scene for each reason: of the pixels that have it most are wrong or missing, of the others few.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <ostream>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "egosgm/pipeline.h"
#include "tests/support/frame_memory.h"

namespace egosgm::testing {
namespace {

constexpr shared::ImageSize kImage{192, 108};
constexpr double kFocal_px = 100, kBaseline_m = 0.2;  // disparity = 20 / depth
constexpr int kDisparities = 32;
const Calibration kCamera{.fx = kFocal_px, .fy = kFocal_px, .cx = 96, .cy = 54, .baseline_m = kBaseline_m};

/// What a surface shows: values between corners of a lattice, in units of some pixels at depth 1 m.
struct Texture {
  enum class Kind { kNoise, kRepeats, kConstant } kind = Kind::kNoise;
  double cell_m = 0.05;
  int period = 0;  // of kRepeats: cells
  int grey = 0;    // of kConstant
};

/// A board that faces the camera, in metres; the nearest come first in a scene.
struct Board {
  double depth_m;
  double left_m = -1e5, right_m = 1e5, top_m = -1e5, bottom_m = 1e5;
  Texture texture = {};
  double right_a_frame_m = 0, away_a_frame_m = 0;  // how it moves by itself
  int reflects_from = std::numeric_limits<int>::max();
  double reflected_depth_m = 0;  // from that frame on it shows what seems to lie there
};

struct Rectangle {
  int left, top, right, bottom;
};

struct Scenery {
  std::vector<Board> boards;
  int frames = 4;
  double camera_right_a_frame_m = 0, camera_forward_a_frame_m = 0;
  std::optional<Rectangle> blind = std::nullopt;  // of both images in the last frame
};

double corner(int column, int row) {
  std::uint32_t mixed = static_cast<std::uint32_t>(column) * 73856093u ^ static_cast<std::uint32_t>(row) * 19349663u;
  mixed = (mixed ^ mixed >> 16) * 0x85ebca6bu;
  mixed = (mixed ^ mixed >> 13) * 0xc2b2ae35u;
  return 40 + static_cast<double>((mixed ^ mixed >> 16) % 176);
}

double grey_of(const Texture& texture, double x_m, double y_m) {
  if (texture.kind == Texture::Kind::kConstant) return texture.grey;
  const double u = x_m / texture.cell_m, v = y_m / texture.cell_m;
  const int column = static_cast<int>(std::floor(u)), row = static_cast<int>(std::floor(v));
  const auto at = [&](int dx, int dy) {
    const int period = texture.kind == Texture::Kind::kRepeats ? texture.period : 1 << 20;
    return corner(((column + dx) % period + period) % period, row + dy);
  };
  const double a = u - column, b = v - row;
  return (1 - b) * ((1 - a) * at(0, 0) + a * at(1, 0)) + b * ((1 - a) * at(0, 1) + a * at(1, 1));
}

struct Point {
  double grey, disparity;
};

Point look(const Scenery& scene, int frame, int view, int x, int y) {
  for (const Board& board : scene.boards) {
    const double depth_m = board.depth_m + frame * (board.away_a_frame_m - scene.camera_forward_a_frame_m);
    if (depth_m <= 0) continue;
    const double camera_m = frame * scene.camera_right_a_frame_m + view * kBaseline_m;
    const auto across_m = [&](double z_m) { return (x - kCamera.cx) * z_m / kFocal_px + camera_m; };
    const double x_m = across_m(depth_m) - frame * board.right_a_frame_m, y_m = (y - kCamera.cy) * depth_m / kFocal_px;
    if (x_m < board.left_m || x_m >= board.right_m || y_m < board.top_m || y_m >= board.bottom_m) continue;
    const bool reflects = frame >= board.reflects_from;
    const double shown_m = reflects ? board.reflected_depth_m : depth_m;
    const double grey = reflects
                            ? grey_of(board.texture, across_m(shown_m) + 50, (y - kCamera.cy) * shown_m / kFocal_px)
                            : grey_of(board.texture, x_m, y_m);
    return {grey, kFocal_px * kBaseline_m / depth_m};
  }
  return {0, 0};
}

/// Both views, with noise of `sigma_grey`, as 16 bits; and the left view's disparities.
struct Pictures {
  std::vector<int> greys;
  std::vector<double> truth;
};

Pictures render(const Scenery& scene, int frame, double sigma_grey) {
  Pictures pictures;
  std::mt19937 random(static_cast<unsigned>(frame) + 1);
  std::normal_distribution<double> noise;
  for (const int view : {EGOSGM_LEFT, EGOSGM_RIGHT}) {
    for (int y = 0; y < kImage.height; ++y) {
      for (int x = 0; x < kImage.width; ++x) {
        const Point point = look(scene, frame, view, x, y);
        if (view == EGOSGM_LEFT) pictures.truth.push_back(point.disparity);
        double grey = point.grey + sigma_grey * noise(random);
        const auto& blind = scene.blind;
        const bool is_blind = frame == scene.frames - 1 && blind && x >= blind->left && x < blind->right &&
                              y >= blind->top && y < blind->bottom;
        if (is_blind) grey = 40 + static_cast<double>(random() % 176);
        pictures.greys.push_back(static_cast<int>(std::lround(std::clamp(grey, 0.0, 255.0))) << 8);
      }
    }
  }
  return pictures;
}

/// How many pixels have a reason, or none of it, and how many of them are wrong by more than 3 px, or missing.
struct Share {
  int pixels = 0, bad = 0;
  double part() const { return pixels == 0 ? 0 : static_cast<double>(bad) / pixels; }
};
struct Shares {
  Share with, without;
  std::string counts;  // of every reason
};

Shares shares(const Scenery& scene, const PipelineOptions& options, Reason reason, double sigma_grey) {
  Pipeline pipeline(kCamera, kImage.width, kImage.height, options);
  OutputMemory outputs(kImage);
  Pictures pictures;
  Motion motion;
  motion.current_from_previous.translation() =
      -Eigen::Vector3d(scene.camera_right_a_frame_m, 0, scene.camera_forward_a_frame_m);
  for (int frame = 0; frame < scene.frames; ++frame) {
    pictures = render(scene, frame, sigma_grey);
    const ImageMemory left(kImage, pictures.greys, EGOSGM_LEFT, PixelType::kU8),
        right(kImage, pictures.greys, EGOSGM_RIGHT, PixelType::kU8);
    pipeline.process(left.view(), right.view(), frame > 0 ? std::optional(motion) : std::nullopt, outputs.views());
  }
  const std::vector<float> disparity = outputs.disparity.values();
  const std::vector<std::uint8_t> reasons = outputs.reason.values();
  Shares found;
  for (int each = 0; each < kReasonCount; ++each) {
    found.counts += std::string(" ") + to_string(static_cast<Reason>(each)) + " " +
                    std::to_string(std::count(reasons.begin(), reasons.end(), each));
  }
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    Share& share = reasons[i] == static_cast<std::uint8_t>(reason) ? found.with : found.without;
    ++share.pixels;
    share.bad += disparity[i] == kInvalidDisparity || std::abs(disparity[i] - pictures.truth[i]) > 3;
  }
  return found;
}

struct Case {
  std::string name;
  Reason reason;
  int least_pixels;  // that have the reason
  Scenery scene;
  std::function<void(PipelineOptions&)> change = [](PipelineOptions&) {};
  double least_part = 0.6;  // of the reason's pixels: wrong or missing
  double most_of_others = 0.2;
  friend void PrintTo(const Case& one, std::ostream* to) { *to << one.name; }
};

const Board kWall{.depth_m = 5, .texture = {.cell_m = 0.12}};  // 4 px
Texture texture_at(double depth_m) { return {.cell_m = 0.025 * depth_m}; }
Board board(double depth_m, double left_m, double right_m, double top_m, double bottom_m) {
  return {depth_m, left_m, right_m, top_m, bottom_m, texture_at(depth_m)};
}
Board sky(int grey) { return {.depth_m = 1000, .texture = {.kind = Texture::Kind::kConstant, .grey = grey}}; }

std::vector<Case> cases() {
  std::vector<Case> all;
  // The strip to the left of a board that only the left camera sees.
  all.push_back({"unconfirmed", Reason::kUnconfirmed, 300, {{board(1, -0.3, 0.5, -0.4, 0.4), kWall}, 1}});
  // To the left of a board that moves right in the image as the camera moves left.
  // Much of what one camera alone sees is right, more so with both views tracked: hardly more than half of it is wrong.
  const auto track_left = [](PipelineOptions& options) { options.track_right = false; };
  const Scenery uncovered{{board(2, -0.6, 1, -0.8, 0.8), kWall}, 4, -0.08};
  all.push_back({"uncovered", Reason::kUncovered, 100, uncovered, [](PipelineOptions&) {}, 0.5});
  all.push_back({"uncovered_left_tracked", Reason::kUncovered, 100, uncovered, track_left, 0.55});
  // A pane begins to show what seems to lie behind it.
  Board pane = board(1.25, -0.5, 0.5, -0.4, 0.4);
  pane.reflects_from = 3, pane.reflected_depth_m = 4;
  all.push_back({"contradicted", Reason::kContradicted, 1000, {{pane, kWall}}});
  all.push_back({"nearer", Reason::kNearer, 1000, {{board(0.8, -0.15, 0.15, -0.15, 0.15), kWall}, 3, 0, 0.1}});
  // Its period is 12 px: disparities of 20 and 8 px fit alike.
  Board fence{.depth_m = 1, .bottom_m = 0.1};
  fence.texture = {.kind = Texture::Kind::kRepeats, .cell_m = 0.03, .period = 4};
  all.push_back({"ambiguous", Reason::kAmbiguous, 1000, {{fence, kWall}}});
  // Sky above what has texture.
  const Board ground{.depth_m = 2, .top_m = -0.4, .texture = texture_at(2)};
  all.push_back({"flat", Reason::kFlat, 1000, {{ground, sky(180)}}});
  all.push_back({"saturated", Reason::kSaturated, 1000, {{ground, sky(400)}}});
  all.push_back({"speckle",
                 Reason::kSpeckle,
                 300,
                 {{board(1, -0.15, 0.15, -0.15, 0.15), kWall}, 1},
                 [](PipelineOptions& options) { options.max_speckle_px = 4000; }});
  // A board goes away while the cameras are blind.
  Board leaving = board(0.8, -0.5, 0.5, -0.4, 0.4);
  leaving.away_a_frame_m = 0.4;
  const Scenery blind{{leaving, kWall}, 3, 0, 0, Rectangle{50, 22, 135, 88}};
  // What the board uncovered while the cameras were blind is missing: nothing is published there without evidence.
  all.push_back({"predicted", Reason::kPredicted, 400, blind, [](PipelineOptions&) {}, 0.6, 0.21});
  all.push_back({"predicted_left_tracked", Reason::kPredicted, 500, blind, track_left, 0.6, 0.21});
  return all;
}

struct Noise {
  int sigma_grey;
  double slack;  // of the bounds, which are those of little noise
};
constexpr Noise kNoise[] = {{0, 0.001}, {1, 0}, {2, 0.001}, {4, 0.065}};

class ReasonScenes : public ::testing::TestWithParam<std::tuple<Case, Noise>> {};

TEST_P(ReasonScenes, OfAReasonsPixelsMostAreWrongOrMissingOfTheOthersFew) {
  const auto& [one, noise] = GetParam();
  PipelineOptions options;
  options.disparities = kDisparities;
  one.change(options);
  const Shares found = shares(one.scene, options, one.reason, noise.sigma_grey);
  SCOPED_TRACE(found.counts);
  EXPECT_GE(found.with.pixels, one.least_pixels);
  EXPECT_GT(found.with.part(), one.least_part - noise.slack) << found.with.pixels << " pixels";
  EXPECT_LT(found.without.part(), one.most_of_others + noise.slack) << found.without.pixels << " pixels";
}

INSTANTIATE_TEST_SUITE_P(Scenes, ReasonScenes,
                         ::testing::Combine(::testing::ValuesIn(cases()), ::testing::ValuesIn(kNoise)),
                         [](const auto& info) {
                           return std::get<0>(info.param).name + "_noise_" +
                                  std::to_string(std::get<1>(info.param).sigma_grey);
                         });

}  // namespace
}  // namespace egosgm::testing
