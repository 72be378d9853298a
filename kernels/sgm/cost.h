// SPDX-License-Identifier: Apache-2.0
// Matching costs of BandedSgm: Hamming distances of codes, or sums of absolute differences. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_COST_H
#define EGOSGM_KERNELS_MATCH_COST_H

#include "bit_count.h"
#include "code.h"
#include "lanes.h"
#include "method.h"

#if CODE_BYTES == 4
typedef uint8 ChunkCodes;
#else
typedef ulong8 ChunkCodes;
#endif
typedef struct __attribute__((packed)) {
  ChunkCodes codes;
} PackedChunkCodes;

static inline ChunkCodes load_chunk_codes(global const Code* from) {
  return ((global const PackedChunkCodes*)from)->codes;
}

// Matching cost of 16 disparities, or 8. `own` and `other` point at the pixel's code and at the first disparity's in
// their padded rows, which run in opposite directions.
#if COST_SAD
#define MATCHING_COST(N, Codes, load)                                                     \
  ushort##N sum = 0;                                                                      \
  for (int dy = -1; dy <= 1; ++dy) {                                                      \
    const long row = dy < 0 ? above : dy > 0 ? below : 0;                                 \
    for (int dx = -1; dx <= 1; ++dx) {                                                    \
      sum += convert_ushort##N(abs_diff((Codes)(own[row + dx]), load(other + row - dx))); \
    }                                                                                     \
  }                                                                                       \
  return convert_uchar##N(min(sum / (ushort)9, (ushort##N)(EGOSGM_MAX_COST)))
#else
#define MATCHING_COST(N, Codes, load)            \
  Codes x = (Codes)(own[0]) ^ load(other);       \
  BIT_COUNT(Codes, x);                           \
  const uchar##N distance = convert_uchar##N(x); \
  return COST_SCALE == 2 ? add_sat(distance, distance) : distance
#endif

static inline uchar16 matching_cost(global const Code* own, global const Code* other, const long above,
                                    const long below) {
  MATCHING_COST(16, Codes, load_codes);
}

static inline Block matching_cost_of_block(global const Code* own, global const Code* other, const long above,
                                           const long below) {
  const uchar16 first = matching_cost(own, other, above, below);
#if BLOCK == 32
  return (Block)(first, matching_cost(own, other + VECTOR, above, below));
#else
  return first;
#endif
}

static inline uchar8 matching_cost_of_chunk(global const Code* own, global const Code* other, const long above,
                                            const long below) {
  MATCHING_COST(8, ChunkCodes, load_chunk_codes);
}

#endif
