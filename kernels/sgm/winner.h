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

// A winner before its neighbourhood is looked at: the sums of 16 lanes between MAX_STEPS of 65535 on both sides.
typedef ulong8 Window;

// Its place in one word: the disparity in the upper half, in the lower one the total and the lane (see `ranked`).
static inline int winner_at(const int disparity, const int rank) { return disparity << 16 | rank; }

// A window with the winner in lane 0. `totals`: at the winner's, of MAX_STEPS on both sides.
static inline void put_window(const ushort* totals, Window* window) {
  ushort* to = (ushort*)window;
  store_totals(((const Totals*)(totals - MAX_STEPS))->totals, to);
  to[2 * MAX_STEPS] = totals[MAX_STEPS];
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

// A total of each of PIXELS pixels.
#if PIXELS == 1
typedef ushort TotalOfEach;
#define TOTALS_OF_INTS convert_ushort
#define INTS_OF_TOTALS convert_int
#else
typedef ushort16 TotalOfEach;
#define TOTALS_OF_INTS convert_ushort16
#define INTS_OF_TOTALS convert_int16
#define MERGED_LOW(a, b)                                                                                             \
  (ushort16)((a).s0, (b).s0, (a).s1, (b).s1, (a).s2, (b).s2, (a).s3, (b).s3, (a).s8, (b).s8, (a).s9, (b).s9, (a).sa, \
             (b).sa, (a).sb, (b).sb)
#define MERGED_HIGH(a, b)                                                                                            \
  (ushort16)((a).s4, (b).s4, (a).s5, (b).s5, (a).s6, (b).s6, (a).s7, (b).s7, (a).sc, (b).sc, (a).sd, (b).sd, (a).se, \
             (b).se, (a).sf, (b).sf)
#endif

// Totals at MAX_STEPS lanes of PIXELS pixels, from `first` lanes beside the winners on: a vector has one lane of all.
static inline void totals_beside(const Window* windows, const int* winners, const int first, TotalOfEach* lanes) {
#define BESIDE(i) (const ushort*)(windows + (i)) + (MAX_STEPS + (winners[i] & 15) + first)
#if PIXELS == 1
  for (int i = 0; i < MAX_STEPS; ++i) lanes[i] = (BESIDE(0))[i];
#else
#pragma unroll
  for (int i = 0; i < MAX_STEPS; ++i) {
    lanes[i] = (ushort16)(load_totals(BESIDE(i)), load_totals(BESIDE(i + MAX_STEPS)));
  }
  // Eight rows of eight become columns, in both halves: a round merges the first four with the others, lane by lane.
#pragma unroll
  for (int round = 0; round < 3; ++round) {
    const TotalOfEach from[MAX_STEPS] = {lanes[0], lanes[1], lanes[2], lanes[3],
                                         lanes[4], lanes[5], lanes[6], lanes[7]};
#pragma unroll
    for (int i = 0; i < MAX_STEPS / 2; ++i) {
      lanes[2 * i] = MERGED_LOW(from[i], from[i + MAX_STEPS / 2]);
      lanes[2 * i + 1] = MERGED_HIGH(from[i], from[i + MAX_STEPS / 2]);
    }
  }
#endif
}

// Steps to one side of the winners until the sums above their own add up to `limit`. `lanes`: from the nearest on.
static inline TotalOfEach steps_along(const TotalOfEach* lanes, const int step, const TotalOfEach here,
                                      const ushort limit) {
  TotalOfEach total = 0, steps = 0;
#pragma unroll
  for (int i = 0; i < MAX_STEPS; ++i) {
    total = add_sat(total, sub_sat(lanes[i * step], here));
    steps += total < (TotalOfEach)(limit) ? (TotalOfEach)(1) : (TotalOfEach)(0);
  }
  return steps;
}

#endif
