// SPDX-License-Identifier: Apache-2.0
// Runs of pixels that have one chunk, as those before them: most pixels in bands. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_STRAIGHT_H
#define EGOSGM_KERNELS_MATCH_STRAIGHT_H

#include "compiler.h"
#include "recurrence.h"
#include "row.h"

// Vectors that hold the paths of a sweep, a chunk of two paths each: of path v, and of path v + PATH_PAIRS.
#define PATH_PAIRS (DIRECTIONS / 2)

// Whether a pixel has one chunk, all of it in the disparity range, as the one to its left, and those above it fit a
// vector, as most pixels in bands. Then the path from the left stays in a register.
static inline bool goes_straight(const SgmParameters q, const uint extent, const uint* before) {
  if (!is_chunk(extent)) return false;
#if PARTIAL_CHUNKS
  if ((int)((uint)origin_of(extent) - (uint)q.min_disparity) + EGOSGM_LANES > q.disparities) return false;
#endif
  bool fit = is_chunk(before[0]);
#pragma unroll
  for (int n = 1; n < DIRECTIONS; ++n) fit &= is_narrow(before[n]);
  return fit;
}

// The places in the slots for a pixel's costs, and of those before it to wipe. As many as a row has: made of two,
// SPIR-V is not valid (LLVM 19's translator).
typedef struct {
  global uchar *at[4], *wiped_at[4];
} Places;

// A chunk of path n's predecessor in the lower half, one of path n + PATH_PAIRS's in the upper half.
static inline uchar16 load_pair(const Places* to, const int n, const uint along, const int beside) {
  return (uchar16)(load_chunk(to->at[n] + along + beside), load_chunk(to->at[n + PATH_PAIRS] + along + beside));
}
static inline uchar16 load_upper(const ulong2 lower, global const uchar* upper) {
  return (uchar16)(as_uchar16(lower).lo, load_chunk(upper));
}

// The path from the left along a run, before its minimum is taken off: t(d) and, in all lanes, min t. So the next pixel
// need not wait for t - min t, as min(L(q, d), L(q, d +- 1) + P1, P2) = min(t, t(d +- 1) + P1, min t + P2) - min t. The
// upper halves are not used, and 0 in `least`.
typedef struct {
  uchar16 t, least;
} FromLeft;

static inline uchar8 path_costs_of(const FromLeft left) { return left.t.lo - left.least.lo; }

// A chunk as it lies at a pixel's own disparities, and at those one below and one above. The upper halves are not used.
typedef struct {
  ulong2 same, below, above;
} Before;

// A chunk so many lanes further up. By halves of the way, as a shift by all bits is undefined; branches would be
// mispredicted.
static inline ulong2 moved(const ulong2 chunk, const int lanes) {
  const ulong2 up = (ulong2)((ulong)(4 * clamp(lanes, 0, EGOSGM_LANES))),
               down = (ulong2)((ulong)(4 * clamp(-lanes, 0, EGOSGM_LANES)));
  return ~(~chunk >> up >> up << down << down);  // of what is absent, nothing
}

// `lanes`: how far the pixel's origin lies above that of the one before.
static inline Before before_at(const uchar16 t, const int lanes) {
  const ulong2 chunk = as_ulong2(t);
  const Before before = {moved(chunk, lanes), moved(chunk, lanes - 1), moved(chunk, lanes + 1)};
  return before;
}

// The costs before, of an origin that stayed.
static inline Before straight_before(const uchar16 t) {
  const ulong2 chunk = as_ulong2(t);
  const Before before = {chunk, chunk << (ulong2)(8) | (ulong2)(ABSENT),
                         chunk >> (ulong2)(8) | (ulong2)((ulong)ABSENT << 56)};
  return before;
}

static inline uchar16 in_lower_lanes(const ushort8 v) { return (uchar16)(as_uchar16(v).s00000000, (uchar8)(0)); }

// The path costs of a pixel that goes straight, but for those from the left left in the slots in place of those before
// it, and half of their sum.
ALWAYS_INLINE uchar8 follow_chunk(const uchar8 chunk_cost, const uint steps, const Row* row, const Places* to,
                                  const uint along, const Before before, FromLeft* left) {
  const uchar16 cost = (uchar16)(chunk_cost, chunk_cost);
  const uchar4 p2 = as_uchar4(steps);
  const uchar16 p1 = (uchar16)(row->p1.lo, row->p1_across_rows.hi);
#if PATHS == 8
  const uchar16 p2_of[PATH_PAIRS] = {p2.s0000000022222222, p2.s1111111133333333};
#else
  const uchar16 p2_of[PATH_PAIRS] = {p2.s0000000011111111};
#endif
  uchar16 t[PATH_PAIRS], least[PATH_PAIRS];
  global const uchar* upper = to->at[PATH_PAIRS] + along;
  // No sum of a cost and P2 is above 255, and nothing lies below the minimum.
  t[0] = LEAST_WAY(load_upper(before.same, upper), load_upper(before.below, upper - 1),
                   load_upper(before.above, upper + 1), p1, add_sat(left->least, p2_of[0]), min, add_sat) +
         (cost - left->least);
#if PATHS == 8
  t[1] = add_sat(cost, LEAST_WAY(load_pair(to, 1, along, 0), load_pair(to, 1, along, -1), load_pair(to, 1, along, 1),
                                 row->p1_across_rows, p2_of[1], min, add_sat));
#endif
#pragma unroll
  for (int n = 1; n < DIRECTIONS; ++n) store((uchar16)(ABSENT), to->wiped_at[n] + along);
  minima_of_chunks(t, least);
  left->t = t[0];
  // Apart from the others, as the next pixel waits for it.
  left->least = in_lower_lanes(least_word(convert_ushort8(t[0].lo)));
#pragma unroll
  for (int n = 0; n < PATH_PAIRS; ++n) {
    t[n] -= least[n];
    if (n > 0) store_chunk(t[n].lo, to->at[n] + along);
    store_chunk(t[n].hi, to->at[n + PATH_PAIRS] + along);
  }
#if PATHS == 8
  t[0] = mean(t[0], t[1]);
#endif
  return add_sat(t[0].lo, t[0].hi);
}

// The ranks of the right pixels that a left pixel of one chunk may be, in a run: its neighbour's are the same but for
// one. What was just written must not be read again in other pieces, which stalls.
typedef struct {
  global uint* at;  // the first one's place
  uint8 ranks;
} Seen;

static inline Seen seen_from(global uint* first) {
  Seen seen = {first, 0};
  if (first) seen.ranks = load_ranks(first);
  return seen;
}
static inline void leave_seen(const Seen* seen) {
  if (seen->at) store_ranks(seen->ranks, seen->at);
}
static inline void move_seen(const bool backward, Seen* seen) {
  if (!seen->at) return;
  if (backward) {
    seen->at[EGOSGM_LANES - 1] = seen->ranks.s7;
    --seen->at;
    seen->ranks = (uint8)(seen->at[0], seen->ranks.s0123, seen->ranks.s456);
  } else {
    seen->at[0] = seen->ranks.s0;
    ++seen->at;
    seen->ranks = (uint8)(seen->ranks.s1234, seen->ranks.s567, seen->at[EGOSGM_LANES - 1]);
  }
}

// The sum of a pixel's chunk, and with the other sweep's its winner.
ALWAYS_INLINE void leave_chunk(const bool meets, const SgmParameters q, const Row* row, const Place* place,
                               const int origin, const uchar8 cost, const uchar8 sum, Seen* seen) {
  if (!meets) {
    store_chunk(sum, place->cells);
    return;
  }
  const ushort8 total = convert_ushort8(sum) + convert_ushort8(load_chunk(place->cells));
  const int first = row->bands[place->k].first - origin, last_of_band = row->bands[place->k].last - origin;
  row->windows[place->k] = (Window)(~0ul, ~0ul, as_ulong2(total), ~0ul, ~0ul, ~0ul, ~0ul);
  const ushort8 allowed = total | barred_of_chunk(first, last_of_band);
  const int rank = ranked_in_chunk(allowed);
  if (seen->at) {
    seen->ranks =
        min(seen->ranks, offered_by_chunk(allowed, rank >> 4, cost, q.disparities - 1 - (origin - q.min_disparity)));
  }
  row->winners[place->k] = winner_at(origin + (rank & 15), rank);
}

static inline Seen seen_of(const Row* row, const Place* place, const int origin) {
  return seen_from(row->seen ? row->seen + place->k - origin - (EGOSGM_LANES - 1) : 0);
}

// Matches a pixel that goes straight and those after it, as long as they do. `steps`: the penalties to it.
ALWAYS_INLINE void match_straight(const bool meets, const bool backward, const SgmParameters q, const Row* row,
                                  uint extent, uint steps, Place* place) {
  int origin = origin_of(extent);
  const int turn = origin - origin_of(place->wiped[0]);
  const uint lane = (uint)origin - (uint)q.min_disparity, moved_lane = place->moved + (uint)origin;
  Places to;
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) to.at[n] = row->slot[n] + (n > 0 ? moved_lane : lane);
  store_chunk((uchar8)(ABSENT), to.at[0] - turn);
  Seen seen = seen_of(row, place, origin);
  FromLeft left = {place->last, (uchar16)(0)};
  Before before = before_at(left.t, turn);
  uint along = 0;
  while (true) {
#pragma unroll
    for (int n = 1; n < DIRECTIONS; ++n)
      to.wiped_at[n] = row->slot[n] + (place->moved + (uint)origin_of(place->wiped[n]));
    if (backward) place->cells -= EGOSGM_LANES;
    const uchar8 cost = matching_cost_of_chunk(place->own, place->other + origin, row->row_above, row->row_below);
    const uchar8 sum = follow_chunk(cost, steps, row, &to, along, before, &left);
    leave_chunk(meets, q, row, place, origin, cost, sum, &seen);
    go_on(row, place);
    place->wiped[0] = extent;
    if (!backward) place->cells += EGOSGM_LANES;
    along += SLOT;
    if (place->k == row->end) break;
    const uint next = extent_at(row->bands + place->k);
    place->wiped[3] = extent_at(row->bands + place->k + row->above_right);
    if (!goes_straight(q, next, place->wiped)) break;
    steps = penalties_to(backward, &place->around, row->penalties + place->k, row->above_right);
    if (next == extent) {
      before = straight_before(left.t);
      move_seen(backward, &seen);
    } else {
      const int lanes = origin_of(next) - origin;
      left.t = (uchar16)(path_costs_of(left), (uchar8)(0));
      left.least = (uchar16)(0);
      before = before_at(left.t, lanes);
#pragma unroll
      for (int n = 0; n < DIRECTIONS; ++n) to.at[n] += lanes;
      extent = next;
      origin += lanes;
      leave_seen(&seen);
      seen = seen_of(row, place, origin);
    }
  }
  leave_seen(&seen);
  const uchar8 last = path_costs_of(left);
  store_chunk(last, to.at[0]);
  place->last = (uchar16)(last, (uchar8)(ABSENT));
  place->moved += along;
}

#endif
