// SPDX-License-Identifier: Apache-2.0
// The ways that paths take across the image, and what lies on them (banded_sgm_paths.cl). OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_PATH_H
#define EGOSGM_KERNELS_MATCH_PATH_H

#include "recurrence.h"
#include "sgm_cells.h"
#include "vector.h"

// A way across the rows that are matched: first pixel and number of pixels, seen in the direction of a forward sweep.
typedef struct {
  int x, y, length;
} Line;

// A path with its place in memory: first pixel (of both views), its column, its and its matches' codes, and what a
// step adds to each. Indices have 32 bits, as the cells of so many pixels would fit no device; a step may wrap them
// round.
typedef struct {
  int length;
  uint pixel, pixel_step;
  int x, x_step;
  int y, y_step;
  uint own, own_step;
  uint other, other_step;  // at the range's first disparity
  uint penalty_offset;     // from a pixel to that with P2 of the step to it: in a backward sweep the one it comes from
  int direction, p1;
} Path;

// The pixels' values in memory.
typedef struct {
  global const Code* codes;
  global const uchar* penalties;
  global const Band* bands;
  global const uint* offsets;
} Pixels;

// The stored values of a pixel on a path: P2 of the step to it, where its cells lie in their row, and its band, in one
// value (origin, chunks, first, last), as a struct in a struct goes through memory (PoCL 3.1).
typedef struct {
  int p2;
  uint offset;
  short4 band;
} Stored;

// A pixel on it: P1 and P2 of the step to it, which lanes of the range its band holds, [first, end), none (0, 0) beyond
// the end of the path, and where the cell of the range's first lane would be.
typedef struct {
  int p1, p2;
  int first, end;
  long cells;
} Pixel;

// Directions: 0 from the left, 1 from above, 2 from the upper left, 3 from the upper right.
static inline Line line_of(const int width, const int rows, const int direction, const int index) {
  const int lines = direction == 0 ? rows : direction == 1 ? width : width + rows - 1;
  const int diagonal = index - (rows - 1);
  Line line = {0, 0, 0};
  if (index < lines) {
    line.x = direction == 0 ? 0 : direction == 1 ? index : direction == 2 ? max(0, diagonal) : min(index, width - 1);
    line.y = direction == 0 ? index : direction == 1 ? 0 : direction == 2 ? max(0, -diagonal) : index - line.x;
    const int across = direction == 3 ? line.x + 1 : width - line.x, down = rows - line.y;
    line.length = direction == 0 ? across : direction == 1 ? down : min(across, down);
  }
  return line;
}

// Backward sweeps see the image turned by 180 degrees; codes of the right view lie mirrored.
static inline Path path_of(const SgmParameters q, const int direction, const bool backward, const int view,
                           const Line line) {
  const int sign = backward ? -1 : 1, view_sign = view == EGOSGM_LEFT ? 1 : -1;
  const int stride = q.width + 2 * q.padding;
  Path path;
  path.length = line.length;
  path.x = backward ? q.width - 1 - line.x : line.x;
  path.y = (backward ? rows_of(q) - 1 - line.y : line.y) * q.row_step;
  path.x_step = direction == 1 ? 0 : direction == 3 ? -sign : sign;
  path.y_step = direction == 0 ? 0 : sign * q.row_step;
  path.pixel = (uint)(view * q.height + path.y) * q.width + path.x;
  path.pixel_step = path.y_step * q.width + path.x_step;
  const int along = view == EGOSGM_LEFT ? path.x : q.width - 1 - path.x;
  path.own = (uint)(view * q.height + path.y) * stride + q.padding + along;
  path.other = (uint)((1 - view) * q.height + path.y) * stride + q.padding + (q.width - 1 - along) + q.min_disparity;
  path.own_step = path.y_step * stride + view_sign * path.x_step;
  path.other_step = path.y_step * stride - view_sign * path.x_step;
  path.penalty_offset = backward ? -path.pixel_step : 0;
  path.direction = direction;
  path.p1 = direction == 0 ? q.p1 : p1_across_rows(q.p1, q.row_step);
  return path;
}

// A pixel's vectors have so many cells more than its band, as it may begin and end within one.
#define SPARE_CELLS (VECTOR == 4 ? 4 : VECTOR + EGOSGM_LANES)

static inline size_t cells_of(const size_t row_start, const size_t pixel, const uint offset) {
  return (row_start * MAX_CHUNKS + offset) * EGOSGM_LANES + SPARE_CELLS * pixel;
}

// The lane of the range that a pixel's cells begin with, whose band begins with `first`: that of its vector.
static inline int first_cell_of(const int first) { return first & -VECTOR; }

static inline Stored stored_at(const Path path, const int i, const Pixels pixels) {
  Stored stored = {0, 0, 0};
  if (i < path.length) {
    const uint at = path.pixel + i * path.pixel_step;
    // At the beginning of a path, any P2 gives the same.
    stored.p2 = pixels.penalties[4 * (size_t)(i > 0 ? at + path.penalty_offset : at) + path.direction];
    stored.band = ((global const short4*)pixels.bands)[at];
    stored.offset = pixels.offsets[at];
  }
  return stored;
}

static inline Pixel pixel_of(const SgmParameters q, const Path path, const int i, const Stored stored) {
  const uint at = path.pixel + i * path.pixel_step;
  const uint row_start = at - (path.x + i * path.x_step);
  const int first = i < path.length ? stored.band.x - q.min_disparity : 0;
  const Pixel pixel = {path.p1, stored.p2, first, min(first + (ushort)stored.band.y * EGOSGM_LANES, q.disparities),
                       (long)cells_of(row_start, at, stored.offset) - first_cell_of(first)};
  return pixel;
}

#define PLAIN_SUM(a, b) ((a) + (b))

// The costs of VECTOR disparities from `at` on: the matching costs and the least way from those of the pixel before
// (`same`, `behind` by one disparity, `ahead`), from all of which `least`, their least, is still to be taken off.
// Absent outside of the band.
static inline Costs path_costs(const Pixel pixel, const int at, const Costs matching, const Costs same,
                               const Costs behind, const Costs ahead, const int least) {
  const Costs way = LEAST_WAY(same, behind, ahead, (Costs)(pixel.p1), (Costs)(pixel.p2 + least), min, PLAIN_SUM);
  const Costs costs = matching + way - (Costs)(least);
  return are_below((Costs)(at - pixel.first) + (Costs)(INDEX), pixel.end - pixel.first) ? costs : (Costs)(ABSENT);
}

#endif
