// SPDX-License-Identifier: Apache-2.0
// LANES work-items that follow a path (banded_sgm_paths.cl). Disparities are dealt out in vectors: vector k of the
// range belongs to lane k % LANES, whatever the band, which may begin and end within one. So a lane keeps the costs of
// its vectors in registers from pixel to pixel, gives its neighbours only the first and the last of each, and asks the
// others for nothing but the minimum. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_PATH_TOGETHER_H
#define EGOSGM_KERNELS_MATCH_PATH_TOGETHER_H

#include "path.h"
#include "path_sums.h"

#define SLOT (VECTORS_A_LANE * LANES + 2)

#if VECTORS_A_LANE <= 8
#define UNROLLED _Pragma("unroll")
#else
#define UNROLLED
#endif

// Up to this many lanes each read the minima of all, after one barrier; with more, a few lanes read eight each before
// it.
#define AT_ONCE 16
#define MINIMA (LANES <= AT_ONCE ? LANES : 2 * LANES)

// Inputs of a pixel: its code, those of what it may match (with COST_SAD the costs themselves), and what lies in its
// cells.
typedef struct {
  Code own;
  Codes others[VECTORS_A_LANE];
  Earlier earlier[VECTORS_A_LANE];
} Matches;

static inline bool holds(const Pixel pixel, const int vector) {
  return VECTOR * vector + VECTOR > pixel.first && VECTOR * vector < pixel.end;
}

static inline Matches fetch(const SgmParameters q, const Path path, const int i, const Pixel pixel, const int lane,
                            const Pixels memory, const Sums sums) {
  Matches matches;
  global const Code* own = memory.codes + (path.own + i * path.own_step);
  matches.own = pixel.end > 0 ? own[0] : 0;
  UNROLLED for (int v = 0; v < VECTORS_A_LANE; ++v) {
    const int vector = lane + v * LANES;
    matches.others[v] = 0;
    if (holds(pixel, vector)) {
      global const Code* other = memory.codes + (path.other + i * path.other_step + VECTOR * vector);
      matches.others[v] = fetch_vector(q, own, other, path.y + i * path.y_step);
      matches.earlier[v] = earlier_at(sums, pixel.cells + VECTOR * vector);
    }
  }
  return matches;
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

// `edges`, `minima`: those of the first of two pixels; LINES lines on lie those of the second.
static inline void follow_together(const SgmParameters q, const Path path, const int longest, const int lane,
                                   const Pixels memory, const Sums sums, local uint* edges, local uint* minima) {
  Costs costs[VECTORS_A_LANE];
  UNROLLED for (int v = 0; v < VECTORS_A_LANE; ++v) costs[v] = ABSENT;
  // A pixel's inputs are loaded while the one before is under way, its band one pixel earlier still, and nobody waits
  // for it before then.
  Pixel pixel = pixel_of(q, path, 0, stored_at(path, 0, memory));
  Stored stored = stored_at(path, 1, memory);
  Matches matches = fetch(q, path, 0, pixel, lane, memory, sums);
  int least = 0;
  for (int i = 0; i < longest; ++i) {
    local const uint* before = edges + (i + 1) % 2 * (LINES * SLOT);
    local uint* after = edges + i % 2 * (LINES * SLOT);
    Costs lowest = ABSENT;
    UNROLLED for (int v = 0; v < VECTORS_A_LANE; ++v) {
      const int vector = lane + v * LANES;
      if (holds(pixel, vector)) {
        const Costs behind = BEHIND((int)(before[vector] >> 16) - least, costs[v]),
                    ahead = AHEAD(costs[v], (int)(before[vector + 2] & 0xffff) - least);
        costs[v] =
            path_costs(q, pixel, VECTOR * vector, cost_of(matches.own, matches.others[v]), costs[v], behind, ahead);
      } else {
        costs[v] = ABSENT;
      }
      after[vector + 1] = (uint)LAST(costs[v]) << 16 | (uint)costs[v].s0;
      lowest = v == 0 ? costs[v] : min(lowest, costs[v]);
    }
    const Pixel next = pixel_of(q, path, i + 1, stored);
    const Matches of_next = fetch(q, path, i + 1, next, lane, memory, sums);
    stored = stored_at(path, i + 2, memory);
    least = minimum_of_line(minima + i % 2 * (LINES * MINIMA), lane, least_cost(lowest));
    UNROLLED for (int v = 0; v < VECTORS_A_LANE; ++v) {
      const int vector = lane + v * LANES;
      costs[v] -= (Costs)(least);
      if (holds(pixel, vector)) add_path(sums, matches.earlier[v], costs[v], pixel.cells + VECTOR * vector);
    }
    matches = of_next;
    pixel = next;
  }
}

#endif
