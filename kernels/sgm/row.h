// SPDX-License-Identifier: Apache-2.0
// A row of a tile, and where in it a sweep is. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_ROW_H
#define EGOSGM_KERNELS_MATCH_ROW_H

#include "compiler.h"
#include "cost.h"
#include "slots.h"
#include "winner.h"

// Values that the pixels of a row share. Pixels count from its first one in the tile, backward ones down.
typedef struct {
  global const Band* bands;
  global const uint* penalties;
  // Slots of the paths from the left, from above, from the upper left and from the upper right; the latter three move
  // on with x.
  global uchar* slot[4];
  Window* windows;            // of the first pixel, in the image's order
  int* winners;               // (winner_at)
  global uint* seen;          // the rank of the right pixel at the row's first one; null: none are kept
  long row_above, row_below;  // to the codes of these rows
  long above_right;           // to that pixel
  long end;
  int step, code_step;
  uchar16 p1, p1_across_rows;
} Row;

// The next pixel.
typedef struct {
  long k;
  global uchar* cells;             // its sums, or in a backward sweep their end
  global const Code *own, *other;  // its code, and that of disparity 0 in the other view
  Penalties around;
  uint wiped[4];  // the extents of those before it on the four paths
  uchar16 last;   // the path costs of the one to the left, where its band is narrow
#if BLOCK_VECTORS == 2
  Block last_block, least_of_block;  // the same where it takes a block, and what is still to be taken off
#endif
  uint moved;  // how far the slots have moved on, less the least disparity
} Place;

// Goes on to the next pixel, but for its sums and `moved`. What was to the upper right is above it.
ALWAYS_INLINE void go_on(const Row* row, Place* place) {
  place->wiped[2] = place->wiped[1];
  place->wiped[1] = place->wiped[3];
  place->own += row->code_step;
  place->other -= row->code_step;
  place->k += row->step;
}

#endif
