// SPDX-License-Identifier: Apache-2.0
// The ways that paths take across the image, and what lies on them (banded_sgm_paths.cl). OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_PATH_H
#define EGOSGM_KERNELS_MATCH_PATH_H

#include "vector.h"

// A way across the image: first pixel and number of pixels, seen in the direction of a forward sweep.
typedef struct {
  int x, y, length;
} Line;

// The same with its place in memory: first pixel (of both views), its column, its and its matches' codes, and what a
// step adds to each.
typedef struct {
  int length;
  size_t pixel;
  long pixel_step;
  int x, x_step;
  int y, y_step;
  global const Code* own;
  global const Code* other;  // at the range's first disparity
  long own_step, other_step;
  global const uchar* penalties;  // P2 of a step at the pixel it leads to, in a backward sweep at the one it comes from
  long penalty_offset;
} Path;

// A pixel on it: P2 of the step to it, which lanes of the range its band holds, [first, end), none beyond the end of
// the path, and the place of the cells of the vectors that they lie in.
typedef struct {
  int p2;
  int first, end;
  size_t cells;
} Pixel;

// A pixel's code and those of what it may match; with COST_SAD, the costs themselves in `others`.
typedef struct {
  Code own;
  Codes others[VECTORS_A_LANE];
} Matches;

// Directions: 0 from the left, 1 from above, 2 from the upper left, 3 from the upper right.
inline Line line_of(const SgmParameters q, const int direction, const int index) {
  const int lines = direction == 0 ? q.height : direction == 1 ? q.width : q.width + q.height - 1;
  const int diagonal = index - (q.height - 1);
  Line line = {0, 0, 0};
  if (index < lines) {
    line.x = direction == 0 ? 0 : direction == 1 ? index : direction == 2 ? max(0, diagonal) : min(index, q.width - 1);
    line.y = direction == 0 ? index : direction == 1 ? 0 : direction == 2 ? max(0, -diagonal) : index - line.x;
    const int across = direction == 3 ? line.x + 1 : q.width - line.x, down = q.height - line.y;
    line.length = direction == 0 ? across : direction == 1 ? down : min(across, down);
  }
  return line;
}

// Backward sweeps see the image turned by 180 degrees; codes of the right view lie mirrored.
inline Path path_of(const SgmParameters q, const int direction, const bool backward, const int view, const Line line,
                    global const uint* all_codes, global const uchar* penalties) {
  const int sign = backward ? -1 : 1, view_sign = view == EGOSGM_LEFT ? 1 : -1;
  const long stride = (long)q.width + 2 * (long)q.padding;
  Path path;
  path.length = line.length;
  path.x = backward ? q.width - 1 - line.x : line.x;
  path.y = backward ? q.height - 1 - line.y : line.y;
  path.x_step = direction == 1 ? 0 : direction == 3 ? -sign : sign;
  path.y_step = direction == 0 ? 0 : sign;
  path.pixel = ((size_t)view * q.height + path.y) * q.width + path.x;
  path.pixel_step = path.y_step * (long)q.width + path.x_step;
  const int along = view == EGOSGM_LEFT ? path.x : q.width - 1 - path.x;
  global const Code* codes = (global const Code*)all_codes + q.padding;
  path.own = codes + ((size_t)view * q.height + path.y) * stride + along;
  path.other = codes + ((size_t)(1 - view) * q.height + path.y) * stride + (q.width - 1 - along) + q.min_disparity;
  path.own_step = path.y_step * stride + view_sign * path.x_step;
  path.other_step = path.y_step * stride - view_sign * path.x_step;
  path.penalties = penalties + direction;
  path.penalty_offset = backward ? -path.pixel_step : 0;
  return path;
}

#endif
