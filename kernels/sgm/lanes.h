// SPDX-License-Identifier: Apache-2.0
// Vectors of disparities and slots of path costs, as the sweeps of BandedSgm load, store and mask them. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_LANES_H
#define EGOSGM_KERNELS_MATCH_LANES_H

#include "block.h"
#include "compiler.h"
#include "shared.h"

#define ABSENT 255
#define VECTOR (2 * EGOSGM_LANES)
#define BLOCK_VECTORS (BLOCK / VECTOR)
#define MAX_VECTORS ((MAX_CHUNKS + 1) / 2)
#define MAX_BLOCKS ((MAX_VECTORS + BLOCK_VECTORS - 1) / BLOCK_VECTORS)
#define SLOT_PADDING 32  // the larger block: one is read and left where a vector ends
#define SLOT (MAX_VECTORS * VECTOR + 2 * SLOT_PADDING)
#define DIRECTIONS (PATHS / 2)
#define SLOTS_OF(q) ((size_t)(DIRECTIONS - 1) * ((q).width + (q).height))  // of a sweep
#define MAX_STEPS 8

// vload16 and vstore16 go byte by byte on some compilers (PoCL 3.1); a packed struct is a plain unaligned access on
// all.
typedef struct __attribute__((packed)) {
  uchar16 lanes;
} Lanes;
typedef struct __attribute__((packed)) {
  uchar8 lanes;
} Chunk;
typedef struct __attribute__((packed)) {
  Block lanes;
} PackedBlock;
typedef struct __attribute__((packed)) {
  ushort16 totals;
} Totals;
typedef struct __attribute__((packed)) {
  ushort8 totals;
} HalfTotals;

static inline uchar16 load(global const uchar* from) { return ((global const Lanes*)from)->lanes; }
static inline void store(const uchar16 lanes, global uchar* to) { ((global Lanes*)to)->lanes = lanes; }
static inline uchar8 load_chunk(global const uchar* from) { return ((global const Chunk*)from)->lanes; }
static inline void store_chunk(const uchar8 lanes, global uchar* to) { ((global Chunk*)to)->lanes = lanes; }
static inline Block load_block(global const uchar* from) { return ((global const PackedBlock*)from)->lanes; }
static inline void store_block(const Block lanes, global uchar* to) { ((global PackedBlock*)to)->lanes = lanes; }
static inline ushort8 load_totals(const ushort* from) { return ((const HalfTotals*)from)->totals; }
static inline void store_totals(const ushort16 totals, ushort* to) { ((Totals*)to)->totals = totals; }
static inline void store_end(ushort* to) { ((HalfTotals*)to)->totals = (ushort8)(65535); }

constant uchar16 kLane = (uchar16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);

#ifdef LEAST_OF_WORDS
static inline ushort8 least_word(const ushort8 v) { return LEAST_OF_WORDS(v); }

// The least lane of each vector, in all lanes.
static inline void minima(const uchar16* v, uchar16* least) {
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) {
    const uchar16 of_pairs = min(v[n], as_uchar16(as_ushort8(v[n]) >> (ushort8)(8)));
    least[n] = (uchar16)(as_uchar16(least_word(as_ushort8(of_pairs))).s0);
  }
}
#else
static inline ushort8 least_word(ushort8 v) {
  v = min(v, v.s45670123);
  v = min(v, v.s23016745);
  return min(v, v.s10325476);
}

// The least lane of each vector, in all lanes.
static inline void minima(const uchar16* v, uchar16* least) {
#if PATHS == 8
  const uchar16 a = min((uchar16)(v[0].lo, v[1].lo), (uchar16)(v[0].hi, v[1].hi));
  const uchar16 b = min((uchar16)(v[2].lo, v[3].lo), (uchar16)(v[2].hi, v[3].hi));
  uchar16 of_four = min((uchar16)(a.s0123, a.s89ab, b.s0123, b.s89ab), (uchar16)(a.s4567, a.scdef, b.s4567, b.scdef));
  of_four = min(of_four, of_four.s23016745ab89efcd);
  of_four = min(of_four, of_four.s1032547698badcfe);
  least[0] = (uchar16)(of_four.s0);
  least[1] = (uchar16)(of_four.s4);
  least[2] = (uchar16)(of_four.s8);
  least[3] = (uchar16)(of_four.sc);
#else
  uchar16 of_two = min((uchar16)(v[0].lo, v[1].lo), (uchar16)(v[0].hi, v[1].hi));
  of_two = min(of_two, of_two.s45670123cdef89ab);
  of_two = min(of_two, of_two.s23016745ab89efcd);
  of_two = min(of_two, of_two.s1032547698badcfe);
  least[0] = (uchar16)(of_two.s0);
  least[1] = (uchar16)(of_two.s8);
#endif
}
#endif

// Minima of vectors that hold two paths, a chunk of each.
static inline void minima_of_chunks(const uchar16* v, uchar16* least) {
#if PATHS == 8
  uchar16 of_four = min((uchar16)(v[0].s0123, v[0].s89ab, v[1].s0123, v[1].s89ab),
                        (uchar16)(v[0].s4567, v[0].scdef, v[1].s4567, v[1].scdef));
  of_four = min(of_four, of_four.s23016745ab89efcd);
  of_four = min(of_four, of_four.s1032547698badcfe);
  least[0] = of_four.s0000000044444444;
  least[1] = of_four.s88888888cccccccc;
#else
  least[0] = min(v[0], v[0].s45670123cdef89ab);
  least[0] = min(least[0], least[0].s23016745ab89efcd);
  least[0] = min(least[0], least[0].s1032547698badcfe);
#endif
}

// 255 in the lanes from `first` on, 0 in those before it.
static inline uchar16 lanes_from(const int first) {
  return as_uchar16(kLane >= (uchar16)((uchar)clamp(first, 0, VECTOR)));
}

// The lanes that lie outside of the disparity range, `first` being its end. In a range of whole vectors there are none.
#if PARTIAL_CHUNKS
#define absent_from(first) lanes_from(first)
#else
#define absent_from(first) ((uchar16)(0))
#endif

// The disparities of a block.
static inline Block block_from(const int first) {
  return BLOCK_LANE >= (Block)((uchar)clamp(first, 0, BLOCK)) ? (Block)(ABSENT) : (Block)(0);
}
#if PARTIAL_CHUNKS
#define absent_in_block(first) block_from(first)
#else
#define absent_in_block(first) ((Block)(0))
#endif

// 65535 where a lane is 255; lanes are 0 or 255.
static inline ushort16 widened(const uchar16 lanes) { return as_ushort16(convert_short16(as_char16(lanes))); }

// The mean as `mean_of` rounds it.
static inline uchar16 mean(const uchar16 a, const uchar16 b) {
  return convert_uchar16((convert_ushort16(a) + convert_ushort16(b) + (ushort16)(1)) >> (ushort16)(1));
}

// Half of the sum over all paths, in 8 bits: (L0 + L1 + 1) / 2 + (L2 + L3 + 1) / 2, at most 255.
static inline uchar16 half_sum(const uchar16* r) {
#if PATHS == 8
  return add_sat(mean(r[0], r[1]), mean(r[2], r[3]));
#else
  return add_sat(r[0], r[1]);
#endif
}

static inline Block half_sum_of_blocks(const Block* r) {
#if PATHS == 8
  return saturated_sum(mean_of(r[0], r[1]), mean_of(r[2], r[3]));
#else
  return saturated_sum(r[0], r[1]);
#endif
}

static inline ushort minimum_of_chunk(const ushort8 v) { return least_word(v).s0; }

static inline ushort minimum_of_totals(const ushort16 totals) { return minimum_of_chunk(min(totals.lo, totals.hi)); }

#endif
