// SPDX-License-Identifier: Apache-2.0
// A work-item of banded_sgm_paths.cl computes a vector at once: VECTOR neighbouring disparities of a pixel, 4 where
// work-items are lanes themselves, 16 for CPUs. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_VECTOR_H
#define EGOSGM_KERNELS_MATCH_VECTOR_H

#include "bit_count.h"
#include "method.h"

#if CODE_BYTES == 4
typedef uint Code;
#define CODE uint
#else
typedef ulong Code;
#define CODE ulong
#endif

#define JOINED(type, number) type##number
#define OF(type, number) JOINED(type, number)
typedef OF(CODE, VECTOR) Codes;
typedef OF(uchar, VECTOR) Bytes;
typedef OF(ushort, VECTOR) Totals;
typedef OF(uint, VECTOR) Ranks;
#define BYTES_OF OF(convert_uchar, VECTOR)
#define TOTALS_OF OF(convert_ushort, VECTOR)
#define RANKS_OF OF(convert_uint, VECTOR)

#if VECTOR == 4
// Path costs in 32 bits, which a work-item of a GPU computes in.
typedef int4 Costs;
#define UNSIGNED as_uint4
#define COSTS_OF convert_int4
#define INDEX 0, 1, 2, 3
#define BEHIND(edge, v) (Costs)(edge, (v).xyz)
#define AHEAD(v, edge) (Costs)((v).yzw, edge)
#define LAST(v) (v).w
static inline uint least_rank(const Ranks v) { return min(min(v.x, v.y), min(v.z, v.w)); }
static inline int least_cost(const Costs v) { return min(min(v.x, v.y), min(v.z, v.w)); }

static inline Codes load_codes(global const Code* from) { return vload4(0, from); }
static inline Bytes load(global const uchar* from) { return *(global const Bytes*)from; }
static inline void store(const Bytes bytes, global uchar* to) { *(global Bytes*)to = bytes; }

// (a + b + 1) / 2 and a saturated sum, of four bytes in one word: compilers for GPUs would go byte by byte.
static inline Bytes mean(const Bytes a, const Bytes b) {
  const uint x = as_uint(a), y = as_uint(b);
  return as_uchar4((x | y) - ((x ^ y) >> 1 & 0x7f7f7f7f));
}
static inline Bytes saturated_sum(const Bytes a, const Bytes b) {
  const uint x = as_uint(a), y = as_uint(b);
  const uint sum = ((x & 0x7f7f7f7f) + (y & 0x7f7f7f7f)) ^ ((x ^ y) & 0x80808080);
  const uint over = ((x & y) | ((x | y) & ~sum)) >> 7 & 0x01010101;
  return as_uchar4(sum | over * 255);
}
#else
typedef short16 Costs;
#define UNSIGNED as_ushort16
#define COSTS_OF convert_short16
#define INDEX 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15
#define BEHIND(edge, v) (Costs)(edge, (v).s0123, (v).s4567, (v).s89ab, (v).scd, (v).se)
#define AHEAD(v, edge) (Costs)((v).s1234, (v).s5678, (v).s9abc, (v).sde, (v).sf, edge)
#define LAST(v) (v).sf
static inline uint least_rank(const Ranks v) {
  const uint8 a = min(v.lo, v.hi);
  const uint4 b = min(a.lo, a.hi);
  return min(min(b.x, b.y), min(b.z, b.w));
}
static inline int least_cost(const Costs v) {
  const short8 a = min(v.lo, v.hi);
  const short4 b = min(a.lo, a.hi);
  return min(min(b.x, b.y), min(b.z, b.w));
}

// vload16 and vstore16 go byte by byte on some compilers (PoCL 3.1); a packed struct is a plain unaligned access.
typedef struct __attribute__((packed)) {
  Codes codes;
} PackedCodes;
typedef struct __attribute__((packed)) {
  Bytes bytes;
} PackedVector;
static inline Codes load_codes(global const Code* from) { return ((global const PackedCodes*)from)->codes; }
static inline Bytes load(global const uchar* from) { return ((global const PackedVector*)from)->bytes; }
static inline void store(const Bytes bytes, global uchar* to) { ((global PackedVector*)to)->bytes = bytes; }

// (a + b + 1) / 2; rhadd goes a longer way on some compilers (PoCL 3.1).
static inline Bytes mean(const Bytes a, const Bytes b) {
  return BYTES_OF((TOTALS_OF(a) + TOTALS_OF(b) + (Totals)(1)) >> (Totals)(1));
}
static inline Bytes saturated_sum(const Bytes a, const Bytes b) { return add_sat(a, b); }
#endif

// Which of `values` lie in [0, end), with one comparison each.
static inline Costs are_below(const Costs values, const int end) { return UNSIGNED(values) < UNSIGNED((Costs)(end)); }

// The matching costs of a pixel whose code is `own` with those whose codes are `others`; with COST_SAD these are the
// costs.
static inline Costs cost_of(const Code own, const Codes others) {
#if COST_SAD
  return COSTS_OF(others);
#elif VECTOR == 4
  return COSTS_OF(popcount((Codes)(own) ^ others)) * COST_SCALE;
#else
  Codes x = (Codes)(own) ^ others;
  BIT_COUNT(Codes, x);
  return COSTS_OF(x) * (Costs)(COST_SCALE);
#endif
}

// The codes of a vector of matches from `other` on; with COST_SAD their costs. `y`: the pixel's row.
static inline Codes fetch_vector(const SgmParameters q, global const Code* own, global const Code* other, const int y) {
#if COST_SAD
  const long stride = (long)q.width + 2 * (long)q.padding;
  const long above = y > 0 ? -stride : 0, below = y + 1 < q.height ? stride : 0;
  Codes sum = 0;
  for (int dx = -1; dx <= 1; ++dx) {
    sum += abs_diff((Codes)(own[above + dx]), load_codes(other + above - dx)) +
           abs_diff((Codes)(own[dx]), load_codes(other - dx)) +
           abs_diff((Codes)(own[below + dx]), load_codes(other + below - dx));
  }
  return min(sum / (Codes)(9), (Codes)(EGOSGM_MAX_COST));
#else
  return load_codes(other);
#endif
}

#endif
