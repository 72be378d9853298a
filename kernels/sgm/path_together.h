// SPDX-License-Identifier: Apache-2.0
// LANES work-items that follow a path (banded_sgm_paths.cl). They deal out the vectors of each pixel's band, of which
// one that is wider than LANES vectors takes rounds. A pixel's costs lie in local memory for the next one, whose lanes
// read theirs and the two beside. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_PATH_TOGETHER_H
#define EGOSGM_KERNELS_MATCH_PATH_TOGETHER_H

#include "path.h"
#include "path_sums.h"

// Up to this many lanes each read the minima of all, after one barrier; with more, a few lanes read eight each before
// it.
#define AT_ONCE 16
#define MINIMA (LANES <= AT_ONCE ? LANES : 2 * LANES)

// The code of a pixel, and those of a vector that it may match (with COST_SAD the costs themselves).
typedef struct {
  Code own;
  Codes others;
} Matches;

// Costs of the pixel before: its vectors [first, end), and their least cost.
typedef struct {
  local const Totals* costs;
  int first, end;
  int least;
} Before;

// The vectors of a pixel are [first_vector_of, end_vector_of).
static inline int first_vector_of(const Pixel pixel) { return pixel.first / VECTOR; }
static inline int end_vector_of(const Pixel pixel) { return (pixel.end + VECTOR - 1) / VECTOR; }

static inline bool has(const Pixel pixel, const int vector) { return VECTOR * vector < pixel.end; }

static inline Matches fetch(const SgmParameters q, const Path path, const int i, const Pixel pixel, const int vector,
                            const Pixels memory) {
  Matches matches = {0, 0};
  if (has(pixel, vector)) {
    global const Code* own = memory.codes + (path.own + i * path.own_step);
    global const Code* other = memory.codes + (path.other + i * path.other_step + VECTOR * vector);
    matches.own = own[0];
    matches.others = fetch_vector(q, own, other, path.y + i * path.y_step);
  }
  return matches;
}

// The path costs that a vector of cells holds already.
static inline Bytes fetch_earlier(const Pixel pixel, const int vector, const Sums sums) {
  return sums.joins && has(pixel, vector) ? load(sums.of_cells + pixel.cells + VECTOR * vector) : (Bytes)(0);
}

static inline bool holds(const Before before, const int vector) {
  return vector >= before.first && vector < before.end;
}

// The costs of a vector, with its pixel's least not taken off.
static inline Costs costs_of_vector(const SgmParameters q, const Pixel pixel, const int vector, const Matches matches,
                                    const Before before) {
  local const ushort* kept = (local const ushort*)(before.costs + vector);
  Costs same = ABSENT;
  int below = ABSENT, above = ABSENT;
  if (holds(before, vector)) same = COSTS_OF(before.costs[vector]);
  if (holds(before, vector - 1)) below = kept[-1];
  if (holds(before, vector + 1)) above = kept[VECTOR];
  return path_costs(pixel, VECTOR * vector, cost_of(matches.own, matches.others), same, BEHIND(below, same),
                    AHEAD(same, above), before.least);
}

// The least value of a line's lanes, by one barrier or more for all work-items of the group. `minima`: MINIMA values,
// others than the call before was given.
static inline uint minimum_of_line(local uint* minima, const int lane, const uint value) {
  minima[lane] = value;
  int count = LANES;
  for (; count > AT_ONCE; count /= 8) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane < count / 8) {
      uint least = minima[8 * lane];
      for (int i = 1; i < 8; ++i) least = min(least, minima[8 * lane + i]);
      minima[count + lane] = least;
    }
    minima += count;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  uint least = minima[0];
  for (int i = 1; i < count; ++i) least = min(least, minima[i]);
  return least;
}

// A pixel of the path with what is loaded ahead for the lane: its first vector, and what lies there.
typedef struct {
  Pixel pixel;
  int vector;
  Matches matches;
  Bytes earlier;
} Inputs;

static inline Inputs inputs_of(const SgmParameters q, const Path path, const int i, const Stored stored, const int lane,
                               const Pixels memory, const Sums sums) {
  Inputs inputs;
  inputs.pixel = pixel_of(q, path, i, stored);
  inputs.vector = first_vector_of(inputs.pixel) + lane;
  inputs.matches = fetch(q, path, i, inputs.pixel, inputs.vector, memory);
  inputs.earlier = fetch_earlier(inputs.pixel, inputs.vector, sums);
  return inputs;
}

// Keeps the costs of pixel `i` in `after`, and gives them for the next one.
static inline Before follow_pixel(const SgmParameters q, const Path path, const int i, const Inputs inputs,
                                  const Before before, const int lane, const Pixels memory, const Sums sums,
                                  local Totals* after, local uint* minima) {
  const Pixel pixel = inputs.pixel;
  const int vector = inputs.vector;
  const Costs costs = costs_of_vector(q, pixel, vector, inputs.matches, before);
  Costs lowest = costs;
  if (has(pixel, vector)) after[vector] = TOTALS_OF(costs);
  _Pragma("unroll 1") for (int v = vector + LANES; has(pixel, v); v += LANES) {
    const Costs further = costs_of_vector(q, pixel, v, fetch(q, path, i, pixel, v, memory), before);
    after[v] = TOTALS_OF(further);
    lowest = min(lowest, further);
  }
  const int least = minimum_of_line(minima, lane, least_cost(lowest));
  if (has(pixel, vector)) add_path(sums, inputs.earlier, costs - (Costs)(least), pixel.cells + VECTOR * vector);
  _Pragma("unroll 1") for (int v = vector + LANES; has(pixel, v); v += LANES) {
    add_path(sums, fetch_earlier(pixel, v, sums), COSTS_OF(after[v]) - (Costs)(least), pixel.cells + VECTOR * v);
  }
  const Before done = {after, first_vector_of(pixel), end_vector_of(pixel), least};
  return done;
}

// `kept`, `minima`: those of pixels of even numbers; LINES lines on lie those of odd ones.
static inline void follow_together(const SgmParameters q, const Path path, const int longest, const int lane,
                                   const Pixels memory, const Sums sums, local Totals* kept, local uint* minima) {
  // A pixel's inputs are loaded while the one before is under way, its band one pixel earlier still, and nobody waits
  // for it before then.
  Inputs even = inputs_of(q, path, 0, stored_at(path, 0, memory), lane, memory, sums);
  Stored stored = stored_at(path, 1, memory);
  Before before = {kept, 0, 0, 0};
  for (int i = 0; i < longest; i += 2) {
    const Inputs odd = inputs_of(q, path, i + 1, stored, lane, memory, sums);
    stored = stored_at(path, i + 2, memory);
    before = follow_pixel(q, path, i, even, before, lane, memory, sums, kept, minima);
    even = inputs_of(q, path, i + 2, stored, lane, memory, sums);
    stored = stored_at(path, i + 3, memory);
    before =
        follow_pixel(q, path, i + 1, odd, before, lane, memory, sums, kept + LINES * VECTORS, minima + LINES * MINIMA);
  }
}

#endif
