// SPDX-License-Identifier: Apache-2.0
#include "vision/synthetic_texture.h"

#include <algorithm>
#include <cmath>

namespace egosgm::vision::synthetic {
namespace {

float lattice(int32_t x, int32_t y, uint32_t seed) {
  uint32_t h = static_cast<uint32_t>(x) * 0x9e3779b1u ^ static_cast<uint32_t>(y) * 0x85ebca77u ^ seed;
  h ^= h >> 15;
  h *= 0x2c1b3c6du;
  h ^= h >> 12;
  h *= 0x297a2d39u;
  return static_cast<float>(h >> 8) * (2.0f / 16777216.0f) - 1.0f;
}

double power_of_two(int exponent) {
  return exponent >= 0 ? static_cast<double>(1 << exponent) : 1.0 / static_cast<double>(1 << -exponent);
}

float value_noise(double x, double y, uint32_t seed) {
  const double fx = std::floor(x), fy = std::floor(y);
  const auto ix = static_cast<int32_t>(fx), iy = static_cast<int32_t>(fy);
  auto a = static_cast<float>(x - fx), b = static_cast<float>(y - fy);
  a = a * a * (3 - 2 * a), b = b * b * (3 - 2 * b);
  const float top = lattice(ix, iy, seed) * (1 - a) + lattice(ix + 1, iy, seed) * a;
  const float bottom = lattice(ix, iy + 1, seed) * (1 - a) + lattice(ix + 1, iy + 1, seed) * a;
  return top * (1 - b) + bottom * b;
}

double uniform_in(uint32_t h, double low, double high) { return low + (high - low) * unit(h); }

/// Share of a pixel of extent `width` at distance `x` from the middle of a stripe of half width `half`.
double stripe(double x, double half, double width) {
  width = std::max(width, 1e-3);
  const double left = std::max(x - width / 2, -half), right = std::min(x + width / 2, half);
  return std::max(0.0, right - left) / width;
}
/// Distance from the middle of the cell of a periodic pattern.
double in_cell(double x, double period) { return x - period * (std::floor(x / period) + 0.5); }

double blend(double a, double b, double part) { return a + (b - a) * part; }

double disc(double u, double v, double radius, double width) {
  return std::clamp((radius - std::hypot(u, v)) / std::max(width, 1e-3) + 0.5, 0.0, 1.0);
}

double facade(const Solid& solid, const SurfacePoint& at) {
  constexpr double kStorey_m = 2.9;
  const uint32_t h = solid.seed;
  const double wall = uniform_in(mix(h, 1), 0.34, 0.85), height = 2 * solid.half.y();
  double tone = wall * (1 + 0.36 * fractal_noise(at, 1.3, mix(h, 2)));
  tone *= 1 - 0.35 * stripe(at.v, 0.7, at.dv);  // plinth
  tone =
      blend(tone, 0.85 * wall + 0.12, 0.8 * stripe(in_cell(at.v + 0.5 * kStorey_m, kStorey_m), 0.09, at.dv));  // ledges
  tone = blend(tone, 0.22, stripe(at.v - height, 0.3, at.dv));                                                 // eaves

  const double pitch = uniform_in(mix(h, 3), 2.1, 3.2), half_width = uniform_in(mix(h, 4), 0.42, 0.62);
  const double u = in_cell(at.u, pitch), v = in_cell(at.v, kStorey_m);
  const auto column = static_cast<int>(std::floor(at.u / pitch)),
             storey = static_cast<int>(std::floor(at.v / kStorey_m));
  if ((storey + 1) * kStorey_m > height) return tone;
  const uint32_t w = mix(mix(h, 5 + static_cast<uint32_t>(column)), static_cast<uint32_t>(storey));
  const bool door = storey == 0 && unit(mix(w, 1)) < 0.3;
  const double half_height = door ? 1.1 : 0.72, centre = door ? -0.3 : 0.12;
  const double frame = stripe(u, half_width + 0.09, at.du) * stripe(v - centre, half_height + 0.09, at.dv);
  if (frame <= 0) return tone;
  const double glass = stripe(u, half_width, at.du) * stripe(v - centre, half_height, at.dv);
  const double bars = std::max(stripe(u, 0.03, at.du), door ? 0.0 : stripe(v - centre - 0.25, 0.03, at.dv));
  const double pane =
      uniform_in(mix(w, 2), 0.06, unit(mix(w, 3)) < 0.25 ? 0.65 : 0.3) * (1 + 0.4 * fractal_noise(at, 0.5, mix(w, 4))) +
      0.05 * fractal_noise(at, 0.5, mix(w, 5));
  const double border = std::min(0.95, wall + (wall > 0.6 ? -0.25 : 0.25));
  return blend(tone, blend(border, pane, glass * (1 - 0.8 * bars)), frame);
}

double car_body(const Solid& solid, int face, const SurfacePoint& at) {
  const uint32_t h = solid.seed;
  const double paint = uniform_in(mix(h, 1), 0.08, 0.9), height = 2 * solid.half.y();
  double tone = paint * (1 + 0.25 * fractal_noise(at, 0.4, mix(h, 2))) + 0.05 * (at.v / height - 0.5);
  tone = blend(tone, 0.04, stripe(at.v, 0.22, at.dv));  // the gap above the ground
  if (face == 0) {
    const double length = solid.half.z(),
                 wheel = std::min(std::abs(at.u - 0.62 * length), std::abs(at.u + 0.62 * length));
    tone =
        blend(tone, 0.5 * tone, std::max(stripe(at.u - 0.05, 0.015, at.du), stripe(at.v - 0.6 * height, 0.012, at.dv)));
    tone = blend(tone, 0.05, disc(wheel, at.v - 0.31, 0.34, at.dv));
    tone = blend(tone, 0.55, disc(wheel, at.v - 0.31, 0.19, at.dv));
  } else if (face == 2) {
    const double lamp = std::abs(std::abs(at.u) - 0.78 * solid.half.x());
    tone = blend(tone, 0.95, stripe(lamp, 0.16, at.du) * stripe(at.v - 0.72 * height, 0.08, at.dv));
    tone = blend(tone, 0.9, stripe(at.u, 0.26, at.du) * stripe(at.v - 0.42 * height, 0.07, at.dv));
  }
  return tone;
}

double car_cabin(const Solid& solid, int face, const SurfacePoint& at) {
  const double paint = uniform_in(mix(solid.seed, 1), 0.08, 0.9), height = 2 * solid.half.y();
  const double half = face == 0 ? solid.half.z() : solid.half.x();
  const double body = paint * (1 + 0.15 * fractal_noise(at, 0.4, mix(solid.seed, 5)));
  const double glass = 0.13 * (1 + 0.7 * fractal_noise(at, 0.6, mix(solid.seed, 6))) + 0.12 * at.v / height;
  double pane = stripe(at.u, half - 0.09, at.du) * stripe(at.v - 0.48 * height, 0.38 * height, at.dv);
  if (face == 0) pane *= 1 - stripe(at.u, 0.05, at.du);
  return face == 1 ? body : blend(body, glass, pane);
}

double van(const Solid& solid, int face, const SurfacePoint& at) {
  const double height = 2 * solid.half.y(), half = face == 0 ? solid.half.z() : solid.half.x();
  double tone = 0.72 * (1 + 0.22 * fractal_noise(at, 0.7, mix(solid.seed, 1)));
  tone = blend(tone, 0.04, stripe(at.v, 0.16 * height, at.dv));
  tone = blend(tone, 0.25, stripe(at.v - 0.45 * height, 0.05 * height, at.dv));
  if (face != 2) return tone;
  const double glass = 0.12 * (1 + 0.6 * fractal_noise(at, 0.5, mix(solid.seed, 2)));
  tone = blend(
      tone, glass,
      stripe(std::abs(at.u) - 0.44 * half, 0.38 * half, at.du) * stripe(at.v - 0.72 * height, 0.15 * height, at.dv));
  tone = blend(
      tone, 0.95,
      stripe(std::abs(at.u) - 0.9 * half, 0.06 * half, at.du) * stripe(at.v - 0.3 * height, 0.08 * height, at.dv));
  return blend(tone, 0.9, stripe(at.u, 0.27, at.du) * stripe(at.v - 0.25 * height, 0.07, at.dv));
}

double sign(const Solid& solid, const SurfacePoint& at) {
  const double v = at.v - solid.half.y(), width = std::max(at.du, at.dv);
  const double rim = 1 - disc(at.u, v, 0.26, width), bar = stripe(at.u, 0.18, at.du) * stripe(v, 0.06, at.dv);
  return blend(blend(0.3, 0.95, rim), 0.95, bar) * (1 + 0.1 * fractal_noise(at, 0.2, solid.seed));
}

/// Plain but for a door in the middle of the long side.
double wall(const Solid& solid, int face, const SurfacePoint& at) {
  const double tone = uniform_in(mix(solid.seed, 1), 0.35, 0.85);
  if (face != 0) return tone;
  const double door = 0.3 * (1 + 0.6 * fractal_noise(at, 0.4, mix(solid.seed, 2)));
  return blend(tone, door, stripe(at.u, 0.5, at.du) * stripe(at.v - 1, 1, at.dv));
}

}  // namespace

double fractal_noise(const SurfacePoint& at, double cell_m, uint32_t seed) {
  constexpr double kGain = 0.86;
  constexpr int kCoarsest = -6, kFinest = 12;
  // Finest octave with cells of two pixels, along each axis, and along the coarser of the two.
  const float fine_u = std::log2(static_cast<float>(cell_m / (2 * at.du)));
  const float fine_v = std::log2(static_cast<float>(cell_m / (2 * at.dv)));
  const bool v_coarser = fine_v < fine_u;
  const float finest = std::min(std::max(fine_u, fine_v), static_cast<float>(kFinest));
  const float limit = std::clamp(std::min(fine_u, fine_v), static_cast<float>(kCoarsest), static_cast<float>(kFinest));
  const int below = static_cast<int>(std::floor(limit));
  const double part = limit - below, u = at.u / cell_m, v = at.v / cell_m;
  const auto octave_noise = [&](int level_u, int level_v) {
    return value_noise(u * power_of_two(level_u), v * power_of_two(level_v),
                       mix(seed + static_cast<uint32_t>(64 * level_u + level_v)));
  };

  double sum = 0, amplitude = 0.55;
  for (int octave = 0; octave < finest + 1; ++octave, amplitude *= kGain) {
    const double fade = std::min(1.0, finest + 1.0 - octave);
    double noise;
    if (octave <= limit) {
      noise = octave_noise(octave, octave);
    } else {  // anisotropic: the coarser axis between two levels, its variance restored
      const int above = std::min(below + 1, octave);
      const double a = v_coarser ? octave_noise(octave, below) : octave_noise(below, octave);
      const double b = above == below ? a : v_coarser ? octave_noise(octave, above) : octave_noise(above, octave);
      noise = blend(a, b, part) / std::sqrt(part * part + (1 - part) * (1 - part));
    }
    sum += fade * amplitude * noise;
  }
  return sum;
}

double road_reflectance(const SurfacePoint& at, uint32_t seed) {
  const double lateral = std::abs(at.u), kerb = 6.05;
  const double grain = fractal_noise(at, 1.6, mix(seed, 51));
  double asphalt = 0.32 * (1 + 0.5 * grain);
  const double dash = stripe(in_cell(at.v, 6.0), 1.5, at.dv);
  asphalt = blend(asphalt, 0.85 + 0.1 * grain, 0.9 * stripe(at.u, 0.07, at.du) * dash);
  asphalt = blend(asphalt, 0.75 + 0.1 * grain, 0.8 * stripe(lateral - 3.6, 0.05, at.du));
  if (lateral + at.du < kerb) return asphalt;
  const double joints = std::max(stripe(in_cell(at.u, 0.6), 0.02, at.du), stripe(in_cell(at.v, 0.6), 0.02, at.dv));
  double pavement = 0.55 * (1 + 0.38 * grain) * (1 - 0.4 * joints);
  pavement = blend(pavement, 0.8 + 0.08 * grain, stripe(lateral - kerb - 0.08, 0.08, at.du));
  const double grass = 0.36 * (1 + 0.5 * grain);
  return blend(blend(pavement, grass, std::clamp((lateral - 8.0) / 0.4, 0.0, 1.0)), asphalt,
               std::clamp((kerb - lateral) / std::max(at.du, 1e-3) + 0.5, 0.0, 1.0));
}

double sky_brightness(const SurfacePoint& at, uint32_t seed) {
  SurfacePoint cloud = at;
  cloud.v *= 2.2, cloud.dv *= 2.2;
  return 0.80 + 0.16 * fractal_noise(cloud, 160, mix(seed, 61)) - 0.06 * std::min(1.0, at.v / 300);
}

double solid_reflectance(const Solid& solid, int face, const SurfacePoint& at) {
  const uint32_t h = solid.seed;
  switch (solid.material) {
    case Material::kFacade:
      return facade(solid, at);
    case Material::kBlock:
      return uniform_in(mix(h, 1), 0.3, 0.6) * (1 + 0.5 * fractal_noise(at, 4.0, mix(h, 2)));
    case Material::kBody:
      return car_body(solid, face, at);
    case Material::kCabin:
      return car_cabin(solid, face, at);
    case Material::kVan:
      return van(solid, face, at);
    case Material::kSign:
      return sign(solid, at);
    case Material::kPole:
      return (unit(mix(h, 1)) < 0.5 ? 0.12 : 0.92) * (1 + 0.25 * fractal_noise(at, 0.6, mix(h, 2)));
    case Material::kTrunk:
      return 0.25 * (1 + 0.5 * fractal_noise({at.u * 3, at.v, at.du * 3, at.dv}, 0.5, mix(h, 2)));
    case Material::kWall:
      return wall(solid, face, at);
    case Material::kCloth:
      return uniform_in(mix(h, 1), 0.12, 0.6) * (1 + 0.6 * fractal_noise(at, 0.4, mix(h, 2)));
    case Material::kCrown:
      return 0.34 * (1 + 0.75 * fractal_noise(at, 0.8, mix(h, 2)));
  }
  return 0;
}

}  // namespace egosgm::vision::synthetic
