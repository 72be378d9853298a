// SPDX-License-Identifier: Apache-2.0
// The place of a pixel's costs in the slot of a path, and the penalties of the steps to it. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_SLOTS_H
#define EGOSGM_KERNELS_MATCH_SLOTS_H

#include "lanes.h"

// The part of a band that tells the place of its costs in a slot, in one word: its origin and its chunks.
static inline uint extent_at(global const Band* band) { return *(global const uint*)band; }
static inline int origin_of(const uint extent) { return (short)extent; }
static inline int chunks_of(const uint extent) { return extent >> 16; }
// Bands that fit one vector, one block of several, one chunk.
static inline bool is_narrow(const uint extent) { return extent < 3u << 16; }
static inline bool is_block(const uint extent) { return extent >> 16 == BLOCK / EGOSGM_LANES; }
static inline bool is_chunk(const uint extent) { return extent < 2u << 16; }

// Makes what a predecessor with `extent` left in a slot absent, `at` being its first disparity's place. More may be
// wiped: all else is absent.
static inline void wipe(global uchar* at, const uint extent) {
  store_block((Block)(ABSENT), at);
  for (int v = BLOCK_VECTORS; v < chunks_of(extent) / 2; ++v) store((uchar16)(ABSENT), at + VECTOR * v);
}

// Whether what a predecessor with `extent` left in a slot is overwritten by a pixel with `own`.
static inline bool covers(const uint own, const uint extent) {
  return origin_of(own) <= origin_of(extent) &&
         origin_of(extent) + EGOSGM_LANES * chunks_of(extent) <= origin_of(own) + EGOSGM_LANES * chunks_of(own);
}

// Results of StepPenalties at pixels around the next one of a backward sweep, a byte a path: before it, above that,
// above.
typedef struct {
  uint before, above_before, above;
} Penalties;

// P2 of the steps to the next pixel, a byte a path. They lie at a step's lower or right pixel: for a backward sweep
// that is the one it comes from.
static inline uint penalties_to(const bool backward, Penalties* around, global const uint* here,
                                const long above_right) {
  const uint own = here[0];
  if (!backward) return own;
  const uint right = here[above_right];
  const uint steps =
      (around->before & 0xff) | (around->above & 0xff00) | (around->above_before & 0xff0000) | (right & 0xff000000);
  around->before = own;
  around->above_before = around->above;
  around->above = right;
  return steps;
}

#endif
