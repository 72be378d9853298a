// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "vision/synthetic_scene.h"

namespace egosgm::vision::synthetic {

/// A point on a surface: its coordinates [m] and the extent of a pixel along them [m], by which detail is faded.
struct SurfacePoint {
  double u, v;
  double du, dv;
};

/// Value noise summed over octaves of cell size `cell_m`, `cell_m`/2, ...; mean 0, standard deviation about 0.5.
/// An octave fades out while its cells shrink from two pixels to one, separately along u and v, so that a surface seen
/// at a grazing angle keeps its detail across the line of sight.
double fractal_noise(const SurfacePoint& at, double cell_m, uint32_t seed);

// Reflectances, 0..1.
double road_reflectance(const SurfacePoint& at, uint32_t seed);  // u: lateral, v: along the road
double sky_brightness(const SurfacePoint& at, uint32_t seed);    // u: around, v: up

/// `face`: 0 a side along the heading, 1 top or bottom, 2 front or back. `u` runs horizontally from the face's middle,
/// `v` up from the solid's bottom.
double solid_reflectance(const Solid& solid, int face, const SurfacePoint& at);

}  // namespace egosgm::vision::synthetic
