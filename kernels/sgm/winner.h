// SPDX-License-Identifier: Apache-2.0
// From sums to a winner with its neighbourhood, and what a left pixel offers to the right ones. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_WINNER_H
#define EGOSGM_KERNELS_MATCH_WINNER_H

#include "lanes.h"
#include "sgm_cells.h"

typedef struct __attribute__((packed)) {
  uint16 ranks;
} Ranks;
typedef struct __attribute__((packed)) {
  uint8 ranks;
} ChunkRanks;

// Both together: steps to the left and to the right of the winner until the sums above its own add up to `limit`.
// `beside` holds the sums of the eight lanes before the winner, the nearest first, and of the eight after it.
static inline uint count_steps(const ushort16 beside, const ushort winner, const ushort limit) {
  const ushort16 from_1 = (ushort16)(0, -1, -1, -1, -1, -1, -1, -1, 0, -1, -1, -1, -1, -1, -1, -1);
  const ushort16 from_2 = (ushort16)(0, 0, -1, -1, -1, -1, -1, -1, 0, 0, -1, -1, -1, -1, -1, -1);
  const ushort16 from_4 = (ushort16)(0, 0, 0, 0, -1, -1, -1, -1, 0, 0, 0, 0, -1, -1, -1, -1);
  ushort16 total = sub_sat(beside, (ushort16)(winner));
  total = add_sat(total, total.s00123456889abcde & from_1);
  total = add_sat(total, total.s000123458889abcd & from_2);
  total = add_sat(total, total.s00000123888889ab & from_4);
  const ulong2 counted = as_ulong2(convert_uchar16(as_ushort16(total < (ushort16)(limit))) & (uchar16)(1));
  return (uint)((counted.x + counted.y) * 0x0101010101010101ul >> 56);
}

// A winner before its neighbourhood is looked at: the sums of 16 lanes between MAX_STEPS of 65535 on both sides, the
// winner's total and lane (see `ranked`), and its disparity.
typedef struct {
  ulong8 totals;
  int rank;
  int disparity;
} Candidate;

// A winner with its neighbourhood in lane 0. `totals`: at the winner's, of MAX_STEPS on both sides.
static inline void put_window(const ushort* totals, const int winner_total, Candidate* candidate) {
  ushort* window = (ushort*)&candidate->totals;
  store_totals(((const Totals*)(totals - MAX_STEPS))->totals, window);
  window[2 * MAX_STEPS] = totals[MAX_STEPS];
  candidate->rank = winner_total << 4;
}

// Inputs of `leave_winners` for a pixel: disparity, path sums of the two neighbours above the winner's (0 both if one
// is missing), steps; 16 bits each.
static inline ulong winner_of(const SgmParameters q, const Candidate* candidate) {
  const int here = candidate->rank >> 4;
  const ushort* at = (const ushort*)&candidate->totals + MAX_STEPS + (candidate->rank & 15);
  const int before = at[-1], after = at[1];
  const ushort16 beside = (ushort16)(load_totals(at - MAX_STEPS).s76543210, load_totals(at + 1));
  const uint steps = count_steps(beside, (ushort)here, (ushort)q.s_max);
  const bool fits = before != 65535 && after != 65535;
  const ushort rise_before = fits ? (ushort)(before - here) : (ushort)0,
               rise_after = fits ? (ushort)(after - here) : (ushort)0;
  return (ulong)(ushort)candidate->disparity | (ulong)rise_before << 16 | (ulong)rise_after << 32 | (ulong)steps << 48;
}

// 65535 in the lanes outside of [first, last]: the others are no more than last - first above first.
static inline ushort16 barred(const int first, const int last) {
  return as_ushort16(convert_ushort16(kLane) - (ushort16)((ushort)first) > (ushort16)((ushort)(last - first)));
}
static inline ushort8 barred_of_chunk(const int first, const int last) {
  return as_ushort8(convert_ushort8(kLane.lo) - (ushort8)((ushort)first) > (ushort8)((ushort)(last - first)));
}

// The least total of 16 lanes in its upper bits, its lane in the lower four: the smallest disparity wins a tie.
static inline int ranked(const ushort16 totals) {
  return minimum_of_totals((totals << (ushort16)(4)) | convert_ushort16(kLane));
}
static inline int ranked_in_chunk(const ushort8 totals) {
  return minimum_of_chunk((totals << (ushort8)(4)) | convert_ushort8(kLane.lo));
}

// Offers a left pixel to the right pixels of 16 lanes, or 8: the one of lane i lies i before `seen`. `least`: of all
// its totals. `behind`: of the first lane. Lanes outside of the band have totals of 65535.
static inline void offer(const ushort16 totals, const int least, const uchar16 cost, const int behind,
                         global uint* seen) {
  const ushort16 each = (ushort16)((ushort)behind) - convert_ushort16(kLane);
  const uint16 ranks =
      convert_uint16(RANK(totals, least, convert_ushort16(cost))) << (uint16)(16) | convert_uint16(each);
  global Ranks* at = (global Ranks*)(seen - (VECTOR - 1));
  at->ranks = min(at->ranks, ranks.sfedcba9876543210);
}

// The offers of 8 lanes, the last lane's first.
static inline uint8 offered_by_chunk(const ushort8 totals, const int least, const uchar8 cost, const int behind) {
  const ushort8 each = (ushort8)((ushort)behind) - convert_ushort8(kLane.lo);
  const uint8 ranks = convert_uint8(RANK(totals, least, convert_ushort8(cost))) << (uint8)(16) | convert_uint8(each);
  return ranks.s76543210;
}
static inline uint8 load_ranks(global const uint* from) { return ((global const ChunkRanks*)from)->ranks; }
static inline void store_ranks(const uint8 ranks, global uint* to) { ((global ChunkRanks*)to)->ranks = ranks; }

// Winners of PIXELS pixels, and a field of each.
#if PIXELS == 1
typedef ulong Winners;
#define FIELD(winners, bit) ((int)((long)((winners) << (48 - (bit))) >> 48))
#else
typedef ulong16 Winners;
#define FIELD(winners, bit) convert_int16(as_long16((winners) << (48 - (bit))) >> 48)
#endif

static inline Winners load_winners(const ulong* from) {
#if PIXELS == 1
  return from[0];
#else
  return vload16(0, from);
#endif
}

#endif
