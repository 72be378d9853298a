// SPDX-License-Identifier: Apache-2.0
// A work-item that follows a path by itself (banded_sgm_paths.cl): the costs of a pixel lie in a row of the range's
// disparities, of which only its band is touched. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_PATH_ALONE_H
#define EGOSGM_KERNELS_MATCH_PATH_ALONE_H

#include "path.h"
#include "path_sums.h"

// A vector may begin with any lane of the range, and is read with a neighbour on each side.
#define ROW_COSTS (MAX_CHUNKS * EGOSGM_LANES + VECTOR + 2)
#define MINIMA 1

static inline uint minimum_of_line(local uint* minima, const int lane, const uint value) { return value; }

typedef struct __attribute__((packed, aligned(sizeof(Cost)))) {
  Costs costs;
} PackedCosts;
static inline Costs costs_at(const Cost* from) { return ((const PackedCosts*)from)->costs; }
static inline void leave_costs(const Costs costs, Cost* to) { ((PackedCosts*)to)->costs = costs; }

static inline void follow_alone(const SgmParameters q, const Path path, const Pixels memory, const Sums sums) {
  Cost rows[2][ROW_COSTS];
  for (int i = 0; i < ROW_COSTS; ++i) rows[0][i] = rows[1][i] = ABSENT;
  Pixel pixels[2] = {{0, 0, 0, 0}, {0, 0, 0, 0}};  // whose costs the rows hold
  int least = 0;
  for (int i = 0; i < path.length; ++i) {
    const Cost* before = rows[(i + 1) % 2] + 1;
    Cost* own = rows[i % 2] + 1;
    const Pixel pixel = pixel_of(q, path, i, stored_at(path, i, memory)), wiped = pixels[i % 2];
    pixels[i % 2] = pixel;
    if (wiped.first != pixel.first || wiped.end != pixel.end) {
      for (int at = wiped.first; at < wiped.end; at += VECTOR) leave_costs((Costs)(ABSENT), own + at);
    }
    global const Code* code = memory.codes + (path.own + i * path.own_step);
    global const Code* codes = memory.codes + (path.other + i * path.other_step);
    Costs lowest = ABSENT;
    for (int at = pixel.first; at < pixel.end; at += VECTOR) {
      const Costs matching = cost_of(code[0], fetch_vector(q, code, codes + at, path.y + i * path.y_step));
      const Costs same = costs_at(before + at), behind = costs_at(before + at - 1), ahead = costs_at(before + at + 1);
      const Costs costs =
          path_costs(q, pixel, at, matching, same - (Costs)(least), behind - (Costs)(least), ahead - (Costs)(least));
      leave_costs(costs, own + at);
      lowest = min(lowest, costs);
    }
    least = least_cost(lowest);
    for (int at = pixel.first; at < pixel.end; at += VECTOR) {
      const long cell = pixel.cells + at;
      add_path(sums, earlier_at(sums, cell), costs_at(own + at) - (Costs)(least), cell);
    }
  }
}

#endif
