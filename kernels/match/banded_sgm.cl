// SPDX-License-Identifier: Apache-2.0
// Semi-global matching (Hirschmueller 2008) in a band per pixel, on diagonal wavefronts.
//
// Four of the eight paths come to a pixel from pixels that a sweep from the top left has done: from the left, the upper
// left, above and the upper right. The other four are the same sweep over the image turned by 180 degrees. So two
// sweeps do it all. They need each other's sums only where both have been: each goes to the middle of the image first,
// the forward one down to it and the backward one up, and then on, over the sums of the other one, to the winners.
//
// In a sweep, a pixel needs the one before it and three of the row above; tiles skewed by a column a row need the tiles
// to the left, above and to the upper right, so all tiles (i, j) with j + 2 i = wave run at once: a launch a wave, a
// work-item a tile. Where a device has no more compute units than there are sweeps, a work-item takes all tiles of a
// sweep up to the middle or from there, row by row, and nobody waits.
//
// Costs of a path are kept relative to their minimum: L(p, d) = t(d) - min t with t(d) = C(p, d) + min(L(q, d), L(q, d
// +- 1) + P1, P2(p, q)), which is the paper's recurrence and fits 8 bits. 255 stands for "absent": outside the band of
// q, or outside the disparity range. The sweep that comes first leaves half the sum of its four paths, in 8 bits, in
// `sums`; the other one adds its own and finds the winner.
//
// A path's costs lie in a slot of their own, at the place of their disparity, and all else in the slot is 255. So a
// pixel reads its predecessor's costs at its own disparities, whatever the predecessor's band was, and then wipes them
// before it writes its own. Vectors hold two chunks. Most pixels in bands have one, and those before them the same one:
// two paths then share a vector, nothing is looked at beside it, and nothing is wiped. Bands of several vectors are
// matched in blocks (block.h), of which the last one may hold a single vector.
//
// Where the right view is read off the left one's sums, the sweep that finds the winners leaves at each right pixel the
// least rank of the left pixels that it may be (sgm_cells.h).
#include "block.h"
#include "sgm_cells.h"

#ifndef __ENDIAN_LITTLE__
#error "bands and penalties are read as words: a little-endian device"
#endif

// lint: MAX_CHUNKS=8 PATHS=4 CODE_BYTES=8 COST_SCALE=1 COST_SAD=0 PARTIAL_CHUNKS=1 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=16
// lint: MAX_CHUNKS=8 PATHS=4 CODE_BYTES=4 COST_SCALE=2 COST_SAD=0 PARTIAL_CHUNKS=1 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=16
// lint: MAX_CHUNKS=8 PATHS=4 CODE_BYTES=4 COST_SCALE=2 COST_SAD=1 PARTIAL_CHUNKS=1 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=16
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=8 COST_SCALE=1 COST_SAD=0 PARTIAL_CHUNKS=1 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=16
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=4 COST_SCALE=2 COST_SAD=0 PARTIAL_CHUNKS=1 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=1
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=4 COST_SCALE=2 COST_SAD=0 PARTIAL_CHUNKS=0 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=16
// lint: MAX_CHUNKS=8 PATHS=8 CODE_BYTES=4 COST_SCALE=2 COST_SAD=1 PARTIAL_CHUNKS=1 TILE_WIDTH=9 TILE_HEIGHT=4 PIXELS=16

#ifndef MAX_CHUNKS
#error "MAX_CHUNKS: chunks of EGOSGM_LANES disparities in the whole range"
#endif
#ifndef PATHS
#error "PATHS: 4 or 8"
#endif
#ifndef CODE_BYTES
#error "CODE_BYTES: 4 or 8, the size of a code"
#endif
#ifndef COST_SCALE
#error "COST_SCALE: what a bit of Hamming distance costs, 1 or 2"
#endif
#ifndef COST_SAD
#error "COST_SAD: 0 for the Hamming distance of codes, 1 for a 3x3 sum of absolute differences of grey values"
#endif
#ifndef PARTIAL_CHUNKS
#error "PARTIAL_CHUNKS: 1 if the range is not a multiple of two chunks"
#endif
#ifndef TILE_WIDTH
#error "TILE_WIDTH: columns of a tile"
#endif
#ifndef TILE_HEIGHT
#error "TILE_HEIGHT: rows of a tile"
#endif

#define ABSENT 255
#define MAX_COST 63
#define VECTOR (2 * EGOSGM_LANES)
#define BLOCK_VECTORS (BLOCK / VECTOR)
#define MAX_VECTORS ((MAX_CHUNKS + 1) / 2)
#define MAX_BLOCKS ((MAX_VECTORS + BLOCK_VECTORS - 1) / BLOCK_VECTORS)
#define SLOT_PADDING 32  // the larger block: one is read and left where a vector ends
#define SLOT (MAX_VECTORS * VECTOR + 2 * SLOT_PADDING)
#define DIRECTIONS (PATHS / 2)
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
#if CODE_BYTES == 4
typedef uint Code;
typedef uint8 ChunkCodes;
typedef uint16 Codes;
#else
typedef ulong Code;
typedef ulong8 ChunkCodes;
typedef ulong16 Codes;
#endif
typedef struct __attribute__((packed)) {
  Codes codes;
} PackedCodes;
typedef struct __attribute__((packed)) {
  ChunkCodes codes;
} PackedChunkCodes;
typedef struct __attribute__((packed)) {
  uint16 ranks;
} Ranks;
typedef struct __attribute__((packed)) {
  uint8 ranks;
} ChunkRanks;
typedef struct __attribute__((packed)) {
  ushort16 totals;
} Totals;
typedef struct __attribute__((packed)) {
  ushort8 totals;
} HalfTotals;

inline uchar16 load(global const uchar* from) { return ((global const Lanes*)from)->lanes; }
inline void store(const uchar16 lanes, global uchar* to) { ((global Lanes*)to)->lanes = lanes; }
inline uchar8 load_chunk(global const uchar* from) { return ((global const Chunk*)from)->lanes; }
inline void store_chunk(const uchar8 lanes, global uchar* to) { ((global Chunk*)to)->lanes = lanes; }
inline Block load_block(global const uchar* from) { return ((global const PackedBlock*)from)->lanes; }
inline void store_block(const Block lanes, global uchar* to) { ((global PackedBlock*)to)->lanes = lanes; }
inline Codes load_codes(global const Code* from) { return ((global const PackedCodes*)from)->codes; }
inline ChunkCodes load_chunk_codes(global const Code* from) { return ((global const PackedChunkCodes*)from)->codes; }
inline ushort8 load_totals(const ushort* from) { return ((const HalfTotals*)from)->totals; }
inline void store_totals(const ushort16 totals, ushort* to) { ((Totals*)to)->totals = totals; }
inline void store_end(ushort* to) { ((HalfTotals*)to)->totals = (ushort8)(65535); }

constant uchar16 kLane = (uchar16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);

// The least lane of each vector, in all lanes.
inline void minima(const uchar16* v, uchar16* least) {
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

// The same of vectors that hold two paths, a chunk of each.
inline void minima_of_chunks(const uchar16* v, uchar16* least) {
  uchar16 of_four = min((uchar16)(v[0].s0123, v[0].s89ab, v[1].s0123, v[1].s89ab),
                        (uchar16)(v[0].s4567, v[0].scdef, v[1].s4567, v[1].scdef));
  of_four = min(of_four, of_four.s23016745ab89efcd);
  of_four = min(of_four, of_four.s1032547698badcfe);
  least[0] = of_four.s0000000044444444;
  least[1] = of_four.s88888888cccccccc;
}

// 255 in the lanes from `first` on, 0 in those before it.
inline uchar16 lanes_from(const int first) { return as_uchar16(kLane >= (uchar16)((uchar)clamp(first, 0, VECTOR))); }

// The lanes that lie outside of the disparity range, `first` being its end. In a range of whole vectors there are none.
#if PARTIAL_CHUNKS
#define absent_from(first) lanes_from(first)
#else
#define absent_from(first) ((uchar16)(0))
#endif

// The same of a block.
inline Block block_from(const int first) {
  return BLOCK_LANE >= (Block)((uchar)clamp(first, 0, BLOCK)) ? (Block)(ABSENT) : (Block)(0);
}
#if PARTIAL_CHUNKS
#define absent_in_block(first) block_from(first)
#else
#define absent_in_block(first) ((Block)(0))
#endif

// 65535 where a lane is 255; lanes are 0 or 255.
inline ushort16 widened(const uchar16 lanes) { return as_ushort16(convert_short16(as_char16(lanes))); }

inline ushort minimum_of_chunk(ushort8 v) {
  v = min(v, v.s45674567);
  v = min(v, v.s23232323);
  v = min(v, v.s11111111);
  return v.s0;
}

inline ushort minimum_of_totals(const ushort16 totals) { return minimum_of_chunk(min(totals.lo, totals.hi)); }

// Bits set in each code; compilers know this form and use what the device has.
#define REPEATED(Codes, byte) ((Codes)(~(Code)0 / 255 * (byte)))
#define BIT_COUNT(Codes, x)                                                    \
  x -= x >> (Codes)(1) & REPEATED(Codes, 0x55);                                \
  x = (x & REPEATED(Codes, 0x33)) + (x >> (Codes)(2) & REPEATED(Codes, 0x33)); \
  x = (x + (x >> (Codes)(4))) & REPEATED(Codes, 0x0f);                         \
  x = x * REPEATED(Codes, 0x01) >> (Codes)(8 * CODE_BYTES - 8)

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
  return convert_uchar##N(min(sum / (ushort)9, (ushort##N)(MAX_COST)))
#else
// A product would melt into the bit count, which compilers then do not know any more.
#define MATCHING_COST(N, Codes, load)            \
  Codes x = (Codes)(own[0]) ^ load(other);       \
  BIT_COUNT(Codes, x);                           \
  const uchar##N distance = convert_uchar##N(x); \
  return COST_SCALE == 2 ? add_sat(distance, distance) : distance
#endif

inline uchar16 matching_cost(global const Code* own, global const Code* other, const long above, const long below) {
  MATCHING_COST(16, Codes, load_codes);
}

inline Block matching_cost_of_block(global const Code* own, global const Code* other, const long above,
                                    const long below) {
  const uchar16 first = matching_cost(own, other, above, below);
#if BLOCK == 32
  return (Block)(first, matching_cost(own, other + VECTOR, above, below));
#else
  return first;
#endif
}

inline uchar8 matching_cost_of_chunk(global const Code* own, global const Code* other, const long above,
                                     const long below) {
  MATCHING_COST(8, ChunkCodes, load_chunk_codes);
}

// t(d) of one path, from the predecessor's costs at the same 16 disparities and at those one below and one above.
inline uchar16 path_cost(const uchar16 cost, const uchar16 same, const uchar16 below, const uchar16 above,
                         const uchar16 p1, const uchar16 p2) {
  return add_sat(cost, min(min(same, add_sat(min(below, above), p1)), p2));
}

// The same where the predecessor's costs lie in a slot, `from` at the first of the 16 disparities.
inline uchar16 path_cost_from(global const uchar* from, const uchar16 cost, const uchar16 p1, const uchar16 p2) {
  return path_cost(cost, load(from), load(from - 1), load(from + 1), p1, p2);
}

// The same where they are at hand and nothing lies beside them.
inline uchar16 path_cost_beside(const uchar16 before, const uchar16 cost, const uchar16 p1, const uchar16 p2) {
  const uchar16 below = before.s00123456789abcde | (uchar16)(ABSENT, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
  const uchar16 above = before.s123456789abcdeff | (uchar16)(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, ABSENT);
  return path_cost(cost, before, below, above, p1, p2);
}

// The same of two paths at once, a chunk of each.
inline uchar16 path_cost_of_chunks(const uchar16 before, const uchar16 cost, const uchar16 p1, const uchar16 p2) {
  const ulong2 lanes = as_ulong2(before);
  const uchar16 below = as_uchar16(lanes << (ulong2)(8) | (ulong2)(ABSENT)),
                above = as_uchar16(lanes >> (ulong2)(8) | (ulong2)((ulong)ABSENT << 56));
  return path_cost(cost, before, below, above, p1, p2);
}

// As `mean_of` has it of blocks.
inline uchar16 mean(const uchar16 a, const uchar16 b) {
  return convert_uchar16((convert_ushort16(a) + convert_ushort16(b) + (ushort16)(1)) >> (ushort16)(1));
}

// Half of the sum over all paths, in 8 bits: (L0 + L1 + 1) / 2 + (L2 + L3 + 1) / 2, at most 255.
inline uchar16 half_sum(const uchar16* r) {
#if PATHS == 8
  return add_sat(mean(r[0], r[1]), mean(r[2], r[3]));
#else
  return add_sat(r[0], r[1]);
#endif
}

inline Block half_sum_of_blocks(const Block* r) {
#if PATHS == 8
  return saturated_sum(mean_of(r[0], r[1]), mean_of(r[2], r[3]));
#else
  return saturated_sum(r[0], r[1]);
#endif
}

// Of a band what says where a pixel's costs lie in a slot, in one word: its origin and its chunks.
inline uint extent_at(global const Band* band) { return *(global const uint*)band; }
inline int origin_of(const uint extent) { return (short)extent; }
inline int chunks_of(const uint extent) { return extent >> 16; }
// Bands that fit one vector.
inline bool is_narrow(const uint extent) { return extent < 3u << 16; }
inline bool is_chunk(const uint extent) { return extent < 2u << 16; }

// Makes what a predecessor with `extent` left in a slot absent, `at` being its first disparity's place.
inline void wipe(global uchar* at, const uint extent) {
  store((uchar16)(ABSENT), at);
  if (!is_narrow(extent)) {
    for (int v = 1; v < chunks_of(extent) / 2; ++v) store((uchar16)(ABSENT), at + VECTOR * v);
  }
}

// Whether what a predecessor with `extent` left in a slot is overwritten by a pixel with `own`.
inline bool covers(const uint own, const uint extent) {
  return origin_of(own) <= origin_of(extent) &&
         origin_of(extent) + EGOSGM_LANES * chunks_of(extent) <= origin_of(own) + EGOSGM_LANES * chunks_of(own);
}

// Both together: steps to the left and to the right of the winner until the sums above its own add up to `limit`.
// `beside` holds the sums of the eight lanes before the winner, the nearest first, and of the eight after it.
inline uint count_steps(const ushort16 beside, const ushort winner, const ushort limit) {
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

// What `refine` needs of a pixel: disparity, path sums of the two neighbours above the winner's (0 both if one is
// missing), steps; 16 bits each.
inline ulong winner_of(const SgmParameters q, const Candidate* candidate) {
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
inline ushort16 barred(const int first, const int last) {
  return as_ushort16(convert_ushort16(kLane) - (ushort16)((ushort)first) > (ushort16)((ushort)(last - first)));
}
inline ushort8 barred_of_chunk(const int first, const int last) {
  return as_ushort8(convert_ushort8(kLane.lo) - (ushort8)((ushort)first) > (ushort8)((ushort)(last - first)));
}

// The least total of 16 lanes in its upper bits, its lane in the lower four: the smallest disparity wins a tie.
inline int ranked(const ushort16 totals) {
  return minimum_of_totals((totals << (ushort16)(4)) | convert_ushort16(kLane));
}
inline int ranked_in_chunk(const ushort8 totals) {
  return minimum_of_chunk((totals << (ushort8)(4)) | convert_ushort8(kLane.lo));
}

// Offers a left pixel to the right pixels of 16 lanes, or 8: the one of lane i lies i before `seen`. `least`: of all
// its totals. `behind`: of the first lane. Lanes outside of the band have totals of 65535.
inline void offer(const ushort16 totals, const int least, const uchar16 cost, const int behind, global uint* seen) {
  const ushort16 each = (ushort16)((ushort)behind) - convert_ushort16(kLane);
  const uint16 ranks =
      convert_uint16(RANK(totals, least, convert_ushort16(cost))) << (uint16)(16) | convert_uint16(each);
  global Ranks* at = (global Ranks*)(seen - (VECTOR - 1));
  at->ranks = min(at->ranks, ranks.sfedcba9876543210);
}
inline void offer_chunk(const ushort8 totals, const int least, const uchar8 cost, const int behind, global uint* seen) {
  const ushort8 each = (ushort8)((ushort)behind) - convert_ushort8(kLane.lo);
  const uint8 ranks = convert_uint8(RANK(totals, least, convert_ushort8(cost))) << (uint8)(16) | convert_uint8(each);
  global ChunkRanks* at = (global ChunkRanks*)(seen - (EGOSGM_LANES - 1));
  at->ranks = min(at->ranks, ranks.s76543210);
}

// Whether a pixel has one chunk, all of it in the disparity range, and those before it on all paths have the same: as
// most pixels in bands. Then a path's costs stay in their places, and nothing else is in a slot to look at or to wipe.
inline bool goes_straight(const SgmParameters q, const uint extent, const uint* before, const int lane) {
#if PATHS == 8
  if (!is_chunk(extent)) return false;
#if PARTIAL_CHUNKS
  if (lane + EGOSGM_LANES > q.disparities) return false;
#endif
  return ((extent ^ before[0]) | (extent ^ before[1]) | (extent ^ before[2]) | (extent ^ before[3])) == 0;
#else
  return false;
#endif
}

// What StepPenalties left at pixels around the next one of a backward sweep, a byte a path: before it, above that,
// above.
typedef struct {
  uint before, above_before, above;
} Penalties;

// P2 of the steps to the next pixel, a byte a path. They lie at a step's lower or right pixel: for a backward sweep
// that is the one it comes from.
inline uint penalties_to(const bool backward, Penalties* around, global const uint* here, const long above_right) {
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

// The rows that a sweep takes before it comes to those that the other one has been to.
inline int own_rows(const int height, const bool backward) { return backward ? height / 2 : height - height / 2; }

// A pixel with more than one vector.
typedef struct {
  global uchar* at[DIRECTIONS];        // its first disparity's place in the slot of each path
  global uchar* wiped_at[DIRECTIONS];  // and that of its predecessor's
  uint wiped[DIRECTIONS];              // the predecessors' extents
  bool is_wiped[DIRECTIONS];           // whether its own costs do not overwrite theirs
  uchar p1, p2[DIRECTIONS];
  global const Code *own, *other;  // its code, and that of its first disparity
  long row_above, row_below;       // to the codes of these rows
  int disparities;                 // of the range, from its first one on
  global uchar* cells;
  int origin, first, last;  // of its band; the latter two count from its origin
  global uint* seen;        // the rank of the right pixel at its first disparity; null: none are kept
} Pixel;

// What comes of it between its two passes: path costs before their minima are taken off, and matching costs.
typedef struct {
  Block t[DIRECTIONS][MAX_BLOCKS], cost[MAX_BLOCKS];
} PathCosts;

// The first pass: path costs of a block, and their least in each lane.
inline void follow_paths(const Pixel* pixel, const int b, const Block absent, PathCosts* costs, Block* least) {
  const int at = BLOCK * b;
  const Block cost = absent | matching_cost_of_block(pixel->own, pixel->other + at, pixel->row_above, pixel->row_below);
  costs->cost[b] = cost;
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) {
    global const uchar* from = pixel->at[n] + at;
    const Block beside = saturated_sum(least_of(load_block(from - 1), load_block(from + 1)), (Block)(pixel->p1));
    const Block t = saturated_sum(cost, least_of(least_of(load_block(from), beside), (Block)(pixel->p2[n])));
    costs->t[n][b] = t;
    least[n] = least_of(least[n], t);
  }
}

// The least total so far of each lane of a vector, and the vector that has it.
typedef struct {
  ushort16 total, vector;
} Best;

// Adds the other sweep's sums of a vector, and remembers the least.
inline void add_sums(const Pixel* pixel, const int v, const uchar16 absent, const uchar16 sum, ushort* totals,
                     Best* best) {
  const int at = VECTOR * v;
  const ushort16 total = (convert_ushort16(sum) + convert_ushort16(load(pixel->cells + at))) | widened(absent);
  store_totals(total, totals + at);
  const int first = pixel->first - at, last = pixel->last - at;
  const bool is_inner = first <= 0 && last >= VECTOR - 1;
  const ushort16 allowed = is_inner ? total : total | barred(first, last);
  best->vector = select(best->vector, (ushort16)((ushort)v), allowed < best->total);
  best->total = min(best->total, allowed);
}

// The second pass: leaves a block's path costs in their slots, and half of their sum, or adds the other half.
inline void leave_block(const bool meets, const bool is_tail, const Pixel* pixel, const int b, const Block absent,
                        const PathCosts* costs, const Block* least, ushort* totals, Best* best) {
  Block r[DIRECTIONS];
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) {
    r[n] = (costs->t[n][b] - least[n]) | absent;
    store_block(r[n], pixel->at[n] + BLOCK * b);
  }
  const Block sum = half_sum_of_blocks(r);
  if (meets) {
    add_sums(pixel, BLOCK_VECTORS * b, FIRST_VECTOR(absent), FIRST_VECTOR(sum), totals, best);
    if (BLOCK_VECTORS == 2 && !is_tail) {
      add_sums(pixel, BLOCK_VECTORS * b + 1, SECOND_VECTOR(absent), SECOND_VECTOR(sum), totals, best);
    }
  } else if (is_tail) {
    store(FIRST_VECTOR(sum), pixel->cells + BLOCK * b);
  } else {
    store_block(sum, pixel->cells + BLOCK * b);
  }
}

// The winner and its neighbourhood; and offers the pixel to the right ones.
inline void find_winner(const Pixel* pixel, const int vectors, const PathCosts* costs, ushort* totals, const Best* best,
                        Candidate* candidate) {
  store_end(totals - MAX_STEPS);
  store_end(totals + VECTOR * vectors);
  const ushort winner_total = minimum_of_totals(best->total);
  const ushort16 lanes = best->vector * (ushort16)(VECTOR) + convert_ushort16(kLane);
  const int best_lane = minimum_of_totals(lanes | as_ushort16(best->total != (ushort16)(winner_total)));
  // The winner's neighbourhood, with the winner in lane 0.
  ushort* window = (ushort*)&candidate->totals;
  store_totals(((const Totals*)(totals + best_lane - MAX_STEPS))->totals, window);
  window[2 * MAX_STEPS] = totals[best_lane + MAX_STEPS];
  candidate->rank = winner_total << 4;
  candidate->disparity = pixel->origin + best_lane;
  for (int v = 0; pixel->seen && v < vectors; ++v) {
    const int at = VECTOR * v;
    const ushort16 allowed = ((const Totals*)(totals + at))->totals | barred(pixel->first - at, pixel->last - at);
    offer(allowed, winner_total, ((const uchar16*)costs->cost)[v], pixel->disparities - 1 - at, pixel->seen - at);
  }
}

__attribute__((always_inline)) inline void match_blocks(const bool meets, const int vectors, const Pixel* pixel,
                                                        Candidate* candidate) {
  const int blocks = vectors / BLOCK_VECTORS;
  const bool has_tail = vectors % BLOCK_VECTORS != 0;
  const Block tail = block_from(VECTOR) | absent_in_block(pixel->disparities - BLOCK * blocks);
  PathCosts costs;
  Block least[DIRECTIONS];
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) least[n] = (Block)(ABSENT);
  for (int b = 0; b < blocks; ++b)
    follow_paths(pixel, b, absent_in_block(pixel->disparities - BLOCK * b), &costs, least);
  if (has_tail) follow_paths(pixel, blocks, tail, &costs, least);

  uchar16 minimum[DIRECTIONS];
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) minimum[n] = LEAST_OF_VECTORS(least[n]);
  minima(minimum, minimum);
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) {
    least[n] = (Block)(minimum[n].s0);
    if (pixel->is_wiped[n]) wipe(pixel->wiped_at[n], pixel->wiped[n]);
  }

  ushort totals[MAX_BLOCKS * BLOCK + 2 * MAX_STEPS];
  Best best = {(ushort16)(65535), (ushort16)(0)};
  for (int b = 0; b < blocks; ++b) {
    const Block absent = absent_in_block(pixel->disparities - BLOCK * b);
    leave_block(meets, false, pixel, b, absent, &costs, least, totals + MAX_STEPS, &best);
  }
  if (has_tail) leave_block(meets, true, pixel, blocks, tail, &costs, least, totals + MAX_STEPS, &best);
  if (meets) find_winner(pixel, vectors, &costs, totals + MAX_STEPS, &best, candidate);
}

// Both flags are constants wherever it is called: each direction has code of its own, whose steps need no registers.
__attribute__((always_inline)) inline void sweep_tile(const bool meets, const bool backward, const SgmParameters q,
                                                      const int tile_x, const int first_y, const int end_y,
                                                      const int view, global const uint* all_codes,
                                                      global const Band* bands, global const uint* offsets,
                                                      global const uchar* penalties, global uchar* slots,
                                                      global uchar* sums, global ulong* winners, global uint* ranks) {
  const int width = q.width, height = q.height;
  const size_t first_pixel = (size_t)view * width * height;
  global const Code* codes = (global const Code*)all_codes;
  const size_t code_stride = (size_t)width + 2 * (size_t)q.padding;
  const uchar16 p1 = (uchar16)((uchar)q.p1);
  slots += (size_t)(2 * view + backward) * 3 * (width + height) * SLOT + SLOT_PADDING;

  Candidate candidates[TILE_WIDTH];
  const int step = backward ? -1 : 1;
  const int code_step = view == EGOSGM_LEFT ? step : -step;
  const bool reads_off = meets && q.reads_off;

  for (int y = first_y; y < end_y; ++y) {
    const int row = y - first_y;
    const int from = max(0, tile_x * TILE_WIDTH - row), to = min(width, (tile_x + 1) * TILE_WIDTH - row);
    if (from >= to) continue;
    const int image_y = backward ? height - 1 - y : y, image_x = backward ? width - 1 - from : from;
    const size_t row_start = first_pixel + (size_t)image_y * width;
    // To the pixels before this one on the four paths. Where there is none, to one whose band and penalty do no harm:
    // wiping some place in the slot, and a step from nowhere.
    const long above = y > 0 ? -step * (long)width : 0, above_right = y > 0 ? above + step : 0;
    const long left = from > 0 ? -step : 0;

    const int along = view == EGOSGM_LEFT ? image_x : width - 1 - image_x;
    global const Code* own = codes + ((size_t)view * height + image_y) * code_stride + q.padding + along;
    global const Code* other =
        codes + ((size_t)(1 - view) * height + image_y) * code_stride + q.padding + (width - 1 - along);
    const long row_above = image_y > 0 ? -(long)code_stride : 0,
               row_below = image_y + 1 < height ? (long)code_stride : 0;

    global const Band* row_bands = bands + row_start + image_x;
    // The sums move along with the pixel; a backward sweep comes from their end. Where offsets and bands do not belong
    // together, after a kernel that failed, it stays within the sums, which begin with a row that is nobody's.
    const int cells_of_row = width * MAX_CHUNKS, offset = (int)offsets[row_start + image_x];
    const int first_cell = backward ? clamp(offset + chunks_of(extent_at(row_bands)), 0, cells_of_row)
                                    : clamp(offset, 0, cells_of_row - (to - from) * MAX_CHUNKS);
    global uchar* cells = sums + ((row_start + width) * MAX_CHUNKS + first_cell) * EGOSGM_LANES;

    global uint* seen = reads_off ? ranks + (size_t)image_y * code_stride + q.padding + image_x : 0;

    global const uint* row_penalties = (global const uint*)penalties + row_start + image_x;
    Penalties around = {row_penalties[left], row_penalties[above + left], row_penalties[above]};

    // Slots of the paths from the left, from above, from the upper left and from the upper right; the latter three move
    // on with x.
    global uchar* slot[4] = {slots + (size_t)y * SLOT, slots + (size_t)(height + from) * SLOT,
                             slots + ((long)2 * height + width - y + from) * SLOT,
                             slots + (size_t)(2 * height + 2 * width + y + from) * SLOT};
    uint wiped[4] = {extent_at(row_bands + left), extent_at(row_bands + above), extent_at(row_bands + (above + left)),
                     0};
    uchar16 last = (uchar16)(ABSENT);
    if (from > 0 && is_narrow(wiped[0])) last = load(slot[0] + (origin_of(wiped[0]) - q.min_disparity));
    uint moved = -(uint)q.min_disparity;
    const long end = step * (long)(to - from);
    Candidate* candidate = candidates;
    for (long k = 0; k != end;) {
      const uint extent = extent_at(row_bands + k);
      const int origin = origin_of(extent);
      wiped[3] = extent_at(row_bands + k + above_right);
      uint steps = penalties_to(backward, &around, row_penalties + k, above_right);
      // Its first disparity's place in the slot of the path from the left, and from `slot` on in those that move.
      const uint lane = (uint)origin - (uint)q.min_disparity, moved_lane = moved + (uint)origin;

      if (goes_straight(q, extent, wiped, (int)lane)) {
        // As long as it goes on like this.
        global uchar* at[4] = {slot[0] + lane, slot[1] + moved_lane, slot[2] + moved_lane, slot[3] + moved_lane};
        uint along = 0;
        while (k != end) {
          if (backward) cells -= EGOSGM_LANES;
          const uchar8 chunk_cost = matching_cost_of_chunk(own, other + origin, row_above, row_below);
          const uchar16 cost = (uchar16)(chunk_cost, chunk_cost);
          const uchar4 p2 = as_uchar4(steps);
          const uchar16 before[2] = {(uchar16)(last.lo, load_chunk(at[2] + along)),
                                     (uchar16)(load_chunk(at[1] + along), load_chunk(at[3] + along))};
          uchar16 r[2] = {path_cost_of_chunks(before[0], cost, p1, p2.s0000000022222222),
                          path_cost_of_chunks(before[1], cost, p1, p2.s1111111133333333)};
          uchar16 least[2];
          minima_of_chunks(r, least);
          r[0] -= least[0];
          r[1] -= least[1];
          store_chunk(r[0].lo, at[0]);
          store_chunk(r[1].lo, at[1] + along);
          store_chunk(r[0].hi, at[2] + along);
          store_chunk(r[1].hi, at[3] + along);
          last = (uchar16)(r[0].lo, (uchar8)(ABSENT));
          const uchar16 means = mean(r[0], r[1]);
          const uchar8 sum = add_sat(means.lo, means.hi);
          if (!meets) {
            store_chunk(sum, cells);
          } else {
            const ushort8 total = convert_ushort8(sum) + convert_ushort8(load_chunk(cells));
            const int first = row_bands[k].first - origin, last_of_band = row_bands[k].last - origin;
            candidate->totals = (ulong8)(~0ul, ~0ul, as_ulong2(total), ~0ul, ~0ul, ~0ul, ~0ul);
            const ushort8 allowed = total | barred_of_chunk(first, last_of_band);
            candidate->rank = ranked_in_chunk(allowed);
            if (reads_off) {
              const int least = candidate->rank >> 4;
              offer_chunk(allowed, least, chunk_cost, q.disparities - 1 - (int)lane, seen + k - origin);
            }
            candidate->disparity = origin + (candidate->rank & 15);
            ++candidate;
          }
          if (!backward) cells += EGOSGM_LANES;
          own += code_step;
          other -= code_step;
          k += step;
          along += SLOT;
          if (k == end || extent_at(row_bands + k) != extent || extent_at(row_bands + k + above_right) != extent) break;
          steps = penalties_to(backward, &around, row_penalties + k, above_right);
        }
        moved += along;
        continue;
      }
      const uchar4 each = as_uchar4(steps);
      const uchar16 p2[4] = {each.s0000000000000000, each.s1111111111111111, each.s2222222222222222,
                             each.s3333333333333333};
      if (backward) cells -= EGOSGM_LANES * chunks_of(extent);
      if (is_narrow(extent)) {
        const uchar16 absent = lanes_from(EGOSGM_LANES * chunks_of(extent)) | absent_from(q.disparities - (int)lane);
        const uchar16 cost = absent | matching_cost(own, other + origin, row_above, row_below);
        uchar16 r[DIRECTIONS];
        if (extent == wiped[0]) {
          r[0] = path_cost_beside(last, cost, p1, p2[0]);
        } else {
          r[0] = path_cost_from(slot[0] + lane, cost, p1, p2[0]);
          wipe(slot[0] + (origin_of(wiped[0]) - q.min_disparity), wiped[0]);
        }
#pragma unroll
        for (int n = 1; n < DIRECTIONS; ++n) {
          r[n] = path_cost_from(slot[n] + moved_lane, cost, p1, p2[n]);
          wipe(slot[n] + (moved + (uint)origin_of(wiped[n])), wiped[n]);
        }
        uchar16 least[DIRECTIONS];
        minima(r, least);
#pragma unroll
        for (int n = 0; n < DIRECTIONS; ++n) {
          r[n] = (r[n] - least[n]) | absent;
          store(r[n], slot[n] + (n > 0 ? moved_lane : lane));
        }
        last = r[0];
        const uchar16 sum = half_sum(r);
        if (meets) {
          const ushort16 total = (convert_ushort16(sum) + convert_ushort16(load(cells))) | widened(absent);
          const int first = row_bands[k].first - origin, last_of_band = row_bands[k].last - origin;
          candidate->totals = (ulong8)(~0ul, ~0ul, as_ulong4(total), ~0ul, ~0ul);
          const ushort16 allowed = total | barred(first, last_of_band);
          candidate->rank = ranked(allowed);
          if (reads_off) {
            offer(allowed, candidate->rank >> 4, cost, q.disparities - 1 - (int)lane, seen + k - origin);
          }
          candidate->disparity = origin + (candidate->rank & 15);
        } else if (is_chunk(extent)) {
          store_chunk(sum.lo, cells);
        } else {
          store(sum, cells);
        }
      } else {
        Pixel pixel;
#pragma unroll
        for (int n = 0; n < DIRECTIONS; ++n) {
          const uint start = n > 0 ? moved : -(uint)q.min_disparity;
          pixel.at[n] = slot[n] + (start + (uint)origin);
          pixel.wiped_at[n] = slot[n] + (start + (uint)origin_of(wiped[n]));
          pixel.is_wiped[n] = !covers(extent, wiped[n]);
          pixel.wiped[n] = wiped[n];
          pixel.p2[n] = (uchar)(steps >> 8 * n);
        }
        pixel.p1 = (uchar)q.p1;
        pixel.own = own;
        pixel.other = other + origin;
        pixel.row_above = row_above;
        pixel.row_below = row_below;
        pixel.disparities = q.disparities - (int)lane;
        pixel.cells = cells;
        pixel.origin = origin;
        pixel.first = row_bands[k].first - origin;
        pixel.last = row_bands[k].last - origin;
        pixel.seen = reads_off ? seen + k - origin : 0;
        match_blocks(meets, chunks_of(extent) / 2, &pixel, candidate);
      }
      // The next one's: what was to the upper right is above it.
      if (meets) ++candidate;
      if (!backward) cells += EGOSGM_LANES * chunks_of(extent);
      wiped[0] = extent;
      wiped[2] = wiped[1];
      wiped[1] = wiped[3];
      own += code_step;
      other -= code_step;
      k += step;
      moved += SLOT;
    }
    // Apart from the sweep, whose pixels wait for each other: these do not.
    if (meets) {
      for (int i = 0; i < to - from; ++i) winners[row_start + image_x + step * i] = winner_of(q, &candidates[i]);
    }
  }
}

// The tile of a wave in a row of tiles, or all tiles of a view and direction.
__attribute__((always_inline)) inline void sweep(const bool meets, const SgmParameters q, const int first_row,
                                                 const int view, const bool backward, const int wave,
                                                 const int tile_columns, global const uint* all_codes,
                                                 global const Band* bands, global const uint* offsets,
                                                 global const uchar* penalties, global uchar* slots, global uchar* sums,
                                                 global ulong* winners, global uint* ranks) {
  const bool all = wave == EGOSGM_ALL_TILES;
  const int first_y = meets ? own_rows(q.height, backward) : 0;
  const int end_y = meets ? q.height : own_rows(q.height, backward);
  const int end_row = all ? (end_y - first_y + TILE_HEIGHT - 1) / TILE_HEIGHT : first_row + 1;
  for (int tile_y = first_row; tile_y < end_row; ++tile_y) {
    const int tile_of_wave = wave - 2 * tile_y;
    const int first = all ? 0 : max(tile_of_wave, 0), end = all ? tile_columns : min(tile_of_wave + 1, tile_columns);
    const int y = first_y + tile_y * TILE_HEIGHT;
    for (int tile_x = first; tile_x < end; ++tile_x) {
      if (backward) {
        sweep_tile(meets, true, q, tile_x, y, min(y + TILE_HEIGHT, end_y), view, all_codes, bands, offsets, penalties,
                   slots, sums, winners, ranks);
      } else {
        sweep_tile(meets, false, q, tile_x, y, min(y + TILE_HEIGHT, end_y), view, all_codes, bands, offsets, penalties,
                   slots, sums, winners, ranks);
      }
    }
  }
}

// Compilers that are made for many CPUs take this one for an older (PoCL as distributions build it). In a function that
// says so, and is not inlined, they count bits in one instruction. Defined by the host where the CPU has it.
#ifdef COUNTS_BITS
#define WITH_BIT_COUNT __attribute__((noinline, target("avx512vpopcntdq")))
#else
#define WITH_BIT_COUNT inline
#endif

WITH_BIT_COUNT void to_middle(const SgmParameters q, const int first_row, const int view, const bool backward,
                              const int wave, const int tile_columns, global const uint* all_codes,
                              global const Band* bands, global const uint* offsets, global const uchar* penalties,
                              global uchar* slots, global uchar* sums) {
  sweep(false, q, first_row, view, backward, wave, tile_columns, all_codes, bands, offsets, penalties, slots, sums, 0,
        0);
}

WITH_BIT_COUNT void from_middle(const SgmParameters q, const int first_row, const int view, const bool backward,
                                const int wave, const int tile_columns, global const uint* all_codes,
                                global const Band* bands, global const uint* offsets, global const uchar* penalties,
                                global uchar* slots, global uchar* sums, global ulong* winners, global uint* ranks) {
  sweep(true, q, first_row, view, backward, wave, tile_columns, all_codes, bands, offsets, penalties, slots, sums,
        winners, ranks);
}

// Both sweeps to the middle of the image, where they leave their sums.
KERNEL void sweep_to_middle(const SgmParameters q, const int wave, const int tile_columns, global const uint* all_codes,
                            global const Band* bands, global const uint* offsets, global const uchar* penalties,
                            global uchar* slots, global uchar* sums) {
  to_middle(q, get_global_id(0), get_global_id(1), get_global_id(2) > 0, wave, tile_columns, all_codes, bands, offsets,
            penalties, slots, sums);
}

// Both on from there, over the sums of the other one, to the winners.
KERNEL void sweep_from_middle(const SgmParameters q, const int wave, const int tile_columns,
                              global const uint* all_codes, global const Band* bands, global const uint* offsets,
                              global const uchar* penalties, global uchar* slots, global const uchar* sums,
                              global ulong* winners, global uint* ranks) {
  from_middle(q, get_global_id(0), get_global_id(1), get_global_id(2) > 0, wave, tile_columns, all_codes, bands,
              offsets, penalties, slots, (global uchar*)sums, winners, ranks);
}

#if PIXELS == 1
typedef ulong Winners;
#define FIELD(winners, bit) ((int)((long)((winners) << (48 - (bit))) >> 48))
#else
typedef ulong16 Winners;
#define FIELD(winners, bit) convert_int16(as_long16((winners) << (48 - (bit))) >> 48)
#endif

inline Winners load_winners(global const ulong* row, const int x, const int width) {
#if PIXELS == 1
  return row[x];
#else
  if (x + PIXELS <= width) return vload16(0, row + x);
  ulong lanes[PIXELS];
  for (int i = 0; i < PIXELS; ++i) lanes[i] = row[min(x + i, width - 1)];
  return vload16(0, lanes);
#endif
}

// Disparity with its sub-pixel part, by a symmetric V through the winner and its neighbours, and the matching variance
// (options.h).
KERNEL void refine(const SgmParameters q, global const ulong* winners, global float* disparities,
                   global float* variances) {
  const int width = q.width;
  const size_t row = ((size_t)get_global_id(2) * q.height + get_global_id(1)) * q.width;
  FOR_PIXELS(x, width) {
    const Winners winner = load_winners(winners + row, x, width);
    const Ints rise_before = FIELD(winner, 16), rise_after = FIELD(winner, 32);
    const Ints steps = FIELD(winner, 48);
    store_pixels(refined(FIELD(winner, 0), rise_before, rise_after), disparities + row, x, width);
    store_pixels(matching_variance(q, steps, rise_before, rise_after), variances + row, x, width);
  }
}
