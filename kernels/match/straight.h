// SPDX-License-Identifier: Apache-2.0
// Runs of pixels that have one chunk, as those before them: most pixels in bands. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_STRAIGHT_H
#define EGOSGM_KERNELS_MATCH_STRAIGHT_H

#include "compiler.h"
#include "recurrence.h"
#include "row.h"

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

// The sum of a pixel's chunk, and with the other sweep's its winner.
ALWAYS_INLINE void leave_chunk(const bool meets, const SgmParameters q, const Row* row,
                                                       const Place* place, const int origin, const uchar8 cost,
                                                       const uchar8 sum) {
  if (!meets) {
    store_chunk(sum, place->cells);
    return;
  }
  Candidate* candidate = place->candidate;
  const ushort8 total = convert_ushort8(sum) + convert_ushort8(load_chunk(place->cells));
  const int first = row->bands[place->k].first - origin, last_of_band = row->bands[place->k].last - origin;
  candidate->totals = (ulong8)(~0ul, ~0ul, as_ulong2(total), ~0ul, ~0ul, ~0ul, ~0ul);
  const ushort8 allowed = total | barred_of_chunk(first, last_of_band);
  candidate->rank = ranked_in_chunk(allowed);
  if (row->seen) {
    const int least = candidate->rank >> 4, behind = q.disparities - 1 - (origin - q.min_disparity);
    offer_chunk(allowed, least, cost, behind, row->seen + place->k - origin);
  }
  candidate->disparity = origin + (candidate->rank & 15);
}

// Matches a pixel that goes straight and those after it, as long as they do. `steps`: the penalties to it.
ALWAYS_INLINE void match_straight(const bool meets, const bool backward, const SgmParameters q,
                                                          const Row* row, const uint extent, uint steps, Place* place) {
  const int origin = origin_of(extent);
  const uint lane = (uint)origin - (uint)q.min_disparity, moved_lane = place->moved + (uint)origin;
  global uchar* at[4] = {row->slot[0] + lane, row->slot[1] + moved_lane, row->slot[2] + moved_lane,
                         row->slot[3] + moved_lane};
  uint along = 0;
  while (place->k != row->end) {
    if (backward) place->cells -= EGOSGM_LANES;
    const uchar8 chunk_cost = matching_cost_of_chunk(place->own, place->other + origin, row->row_above, row->row_below);
    const uchar16 cost = (uchar16)(chunk_cost, chunk_cost);
    const uchar4 p2 = as_uchar4(steps);
    const uchar16 before[2] = {(uchar16)(place->last.lo, load_chunk(at[2] + along)),
                               (uchar16)(load_chunk(at[1] + along), load_chunk(at[3] + along))};
    uchar16 r[2] = {path_cost_of_chunks(before[0], cost, row->p1, p2.s0000000022222222),
                    path_cost_of_chunks(before[1], cost, row->p1, p2.s1111111133333333)};
    uchar16 least[2];
    minima_of_chunks(r, least);
    r[0] -= least[0];
    r[1] -= least[1];
    store_chunk(r[0].lo, at[0]);
    store_chunk(r[1].lo, at[1] + along);
    store_chunk(r[0].hi, at[2] + along);
    store_chunk(r[1].hi, at[3] + along);
    place->last = (uchar16)(r[0].lo, (uchar8)(ABSENT));
    const uchar16 means = mean(r[0], r[1]);
    leave_chunk(meets, q, row, place, origin, chunk_cost, add_sat(means.lo, means.hi));
    if (meets) ++place->candidate;
    if (!backward) place->cells += EGOSGM_LANES;
    place->own += row->code_step;
    place->other -= row->code_step;
    place->k += row->step;
    along += SLOT;
    const long k = place->k;
    if (k == row->end || extent_at(row->bands + k) != extent || extent_at(row->bands + k + row->above_right) != extent)
      break;
    steps = penalties_to(backward, &place->around, row->penalties + k, row->above_right);
  }
  place->moved += along;
}

#endif
