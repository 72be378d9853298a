// SPDX-License-Identifier: Apache-2.0
// PIXELS neighbouring pixels of a row as one value: 1 for GPUs, whose work-items are lanes themselves; 16 for CPUs,
// whose compilers make masked, slow vectors of work-items that guard their bounds. What is written once with these
// types is right for both if it chooses by ?: only, and joins comparisons by & and | only.
#ifndef EGOSGM_KERNELS_PIXELS_H
#define EGOSGM_KERNELS_PIXELS_H

#include "compiler.h"
#include "shared.h"

#ifndef PIXELS
#error "PIXELS: of a work-item, 1 or 16"
#endif

// Shorts: whole numbers of 16 bits, of which a vector holds twice as many; one alone is not slower with 32.
#if PIXELS == 1
typedef float Floats;
typedef int Ints;
typedef int Shorts;
typedef uint Uints;
#define FLOATS_OF_INTS convert_float
#define INTS_OF_FLOATS convert_int
#define INTS_OF_UINTS as_int
#define INTS_OF_SHORTS(value) (value)
#define SHORTS_OF_INTS(value) (value)
#define LANE_INDICES 0
#else
typedef float16 Floats;
typedef int16 Ints;
typedef short16 Shorts;
typedef uint16 Uints;
#define FLOATS_OF_INTS convert_float16
#define INTS_OF_FLOATS convert_int16
#define INTS_OF_UINTS as_int16
#define INTS_OF_SHORTS convert_int16
#define SHORTS_OF_INTS convert_short16
#define LANE_INDICES (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
#endif

// The blocks of PIXELS pixels of a row that the work-item `at` takes: all of them where it has the row alone, else one.
#define FOR_PIXELS(x, width) for (int x = at.x * PIXELS; x < (width); x += at.items * PIXELS)

// Long work is done in several loops over a chunk of blocks each: a CPU has many turns of a short loop under way,
// but hardly two of a long one, whose instructions wait for each other.
#if PIXELS == 1
#define CHUNK 1
#else
#define CHUNK 8
#endif
#define FOR_CHUNKS(start, width) \
  for (int start = at.x * PIXELS * CHUNK; start < (width); start += at.items * PIXELS * CHUNK)
// Block `i` of the chunk, which begins at column x.
#define FOR_BLOCKS(x, i, start, width) for (int i = 0, x = start; i < CHUNK && x < (width); ++i, x += PIXELS)

// In place of a row's width, in a copy of the code for blocks that lie within the row together with all that they read
// beside them: loads and stores then ask nothing, and the compiler keeps values in registers.
#define EVERYWHERE INT_MAX
static inline int is_within(const int x, const int reach, const int width) {
  return PIXELS > 1 && x >= reach && x + PIXELS + reach <= width;
}

#define INVALID ((Floats)(EGOSGM_INVALID_DISPARITY))

// Whether there is a disparity, by the sign of a difference: LLVM narrows comparisons that are joined to bytes and
// widens them again, which takes longer than what is joined. What is joined with nothing is compared with INVALID.
// REQUIRES: a number.
static inline Ints is_valid(const Floats d) {
#if PIXELS == 1
  return d > INVALID;
#else
  return as_int16(INVALID - d) >> 31;
#endif
}

// A condition as a number; and whether one holds in any pixel, for work that most blocks need not do. any() asks lane
// by lane on some compilers (PoCL 3.1).
static inline Floats one_where(const Ints condition) { return condition ? (Floats)(1.0f) : (Floats)(0.0f); }
static inline int any_of(const Ints condition) {
#if PIXELS == 1
  return condition;
#else
  const int8 halves = condition.lo | condition.hi;
  const long2 pairs = as_long2(halves.lo | halves.hi);
  return (pairs.x | pairs.y) != 0;
#endif
}

#if PIXELS > 1
// The sums of lanes 0 to 3, 4 to 7, and so on.
static inline int4 sums_of_fours(const Ints lanes) {
  const int8 pairs = lanes.even + lanes.odd;
  return pairs.even + pairs.odd;
}
#endif

// A lane of a block that lies in memory.
#define LANE(type, block, lane) (((const type*)&(block))[lane])

// Values of a row at places, lane by lane: gather instructions are slower, and what a compiler makes of a loop, or of
// loads that may be joined. The places lie in memory: they are quicker loaded one by one than taken out of a vector.
#define VALUE_AT(row, places, lane) (row)[LANE(int, places, lane)]
#if PIXELS == 1
#define GATHERED(Values, row, places) ((Values)(VALUE_AT(row, places, 0)))
#else
#define GATHERED(Values, row, places)                                                                                 \
  ((Values)(VALUE_AT(row, places, 0), VALUE_AT(row, places, 1), VALUE_AT(row, places, 2), VALUE_AT(row, places, 3),   \
            VALUE_AT(row, places, 4), VALUE_AT(row, places, 5), VALUE_AT(row, places, 6), VALUE_AT(row, places, 7),   \
            VALUE_AT(row, places, 8), VALUE_AT(row, places, 9), VALUE_AT(row, places, 10), VALUE_AT(row, places, 11), \
            VALUE_AT(row, places, 12), VALUE_AT(row, places, 13), VALUE_AT(row, places, 14),                          \
            VALUE_AT(row, places, 15)))
#endif
static inline Floats gather(volatile global const float* row, const Ints* places) {
  return GATHERED(Floats, row, *places);
}

// A block where its row begins or ends. Not inlined: inlined at every load and store, it would be most of
// what is compiled. Without a branch a lane: a row has few blocks.
#if PIXELS == 1
#define AT_EDGE static inline
#else
#define AT_EDGE static __attribute__((noinline, cold))
AT_EDGE Floats load_pixels_at_edge(global const float* row, const int x, const int width) {
  const Ints at = x + LANE_INDICES, inside = clamp(at, (Ints)(0), (Ints)(width - 1));
  return at == inside ? GATHERED(Floats, row, inside) : INVALID;
}
AT_EDGE Ints load_bytes_at_edge(global const uchar* row, const int x, const int width) {
  const Ints at = x + LANE_INDICES, inside = clamp(at, (Ints)(0), (Ints)(width - 1));
  return at == inside ? GATHERED(Ints, row, inside) : (Ints)(0);
}
AT_EDGE Ints load_words_at_edge(global const int* row, const int x, const int width) {
  const Ints at = x + LANE_INDICES, inside = clamp(at, (Ints)(0), (Ints)(width - 1));
  return at == inside ? GATHERED(Ints, row, inside) : (Ints)(0);
}
// `count` < 16 lanes, by powers of two.
#define STORE_LANES(lanes, to, count) \
  if ((count)&8) {                    \
    vstore8((lanes).lo, 0, to);       \
    (lanes).lo = (lanes).hi;          \
    (to) += 8;                        \
  }                                   \
  if ((count)&4) {                    \
    vstore4((lanes).s0123, 0, to);    \
    (lanes).s0123 = (lanes).s4567;    \
    (to) += 4;                        \
  }                                   \
  if ((count)&2) {                    \
    vstore2((lanes).s01, 0, to);      \
    (lanes).s0 = (lanes).s2;          \
    (to) += 2;                        \
  }                                   \
  if ((count)&1) *(to) = (lanes).s0
AT_EDGE void store_pixels_at_edge(Floats pixels, global float* to, const int count) { STORE_LANES(pixels, to, count); }
AT_EDGE void store_bytes_at_edge(uchar16 bytes, global uchar* to, const int count) { STORE_LANES(bytes, to, count); }
AT_EDGE void store_words_at_edge(Ints words, global int* to, const int count) { STORE_LANES(words, to, count); }
#endif

// Pixels x .. x + PIXELS - 1 of a row; what lies outside of it is invalid.
ALWAYS_INLINE Floats load_pixels(global const float* row, const int x, const int width) {
#if PIXELS == 1
  return x >= 0 && x < width ? row[x] : EGOSGM_INVALID_DISPARITY;
#else
  return width == EVERYWHERE || is_within(x, 0, width) ? vload16(0, row + x) : load_pixels_at_edge(row, x, width);
#endif
}

// Values that were put side by side.
static inline Floats load_pixels_of(const float* values) {
#if PIXELS == 1
  return values[0];
#else
  return vload16(0, values);
#endif
}

static inline Ints load_ints_of(const int* values) {
#if PIXELS == 1
  return values[0];
#else
  return vload16(0, values);
#endif
}

typedef struct __attribute__((packed)) {
  Floats lanes;
} PackedFloats;

// Writes pixels x .. x + PIXELS - 1, as far as the row goes. REQUIRES: x lies in it. Not by vstore16, which some
// compilers (PoCL 3.1) take to four pieces.
ALWAYS_INLINE void store_pixels(const Floats pixels, global float* row, const int x, const int width) {
#if PIXELS == 1
  row[x] = pixels;
#else
  if (x + PIXELS <= width) {
    ((global PackedFloats*)(row + x))->lanes = pixels;
  } else {
    store_pixels_at_edge(pixels, row + x, width - x);
  }
#endif
}

typedef struct __attribute__((packed)) {
  uchar16 lanes;
} PackedBytes;

// Bytes x .. x + PIXELS - 1 of a row; what lies outside of it is 0.
static inline Ints load_bytes(global const uchar* row, const int x, const int width) {
#if PIXELS == 1
  return x >= 0 && x < width ? row[x] : 0;
#else
  if (is_within(x, 0, width)) return convert_int16(((global const PackedBytes*)(row + x))->lanes);
  return load_bytes_at_edge(row, x, width);
#endif
}

// Writes bytes. REQUIRES: values from 0 to 255; x lies in the row.
static inline void store_bytes(const Ints values, global uchar* row, const int x, const int width) {
#if PIXELS == 1
  row[x] = (uchar)values;
#else
  if (x + PIXELS <= width) {
    ((global PackedBytes*)(row + x))->lanes = convert_uchar16(values);
  } else {
    store_bytes_at_edge(convert_uchar16(values), row + x, width - x);
  }
#endif
}

typedef struct __attribute__((packed)) {
  int16 lanes;
} PackedInts;

// Words x .. x + PIXELS - 1 of a row; what lies outside of it is 0.
static inline Ints load_words(global const int* row, const int x, const int width) {
#if PIXELS == 1
  return x >= 0 && x < width ? row[x] : 0;
#else
  return is_within(x, 0, width) ? ((global const PackedInts*)(row + x))->lanes : load_words_at_edge(row, x, width);
#endif
}

// Stores words of four bytes each, the lowest first.
static inline void store_words(const Ints words, global uchar* row, const int x, const int width) {
#if PIXELS == 1
  ((global int*)row)[x] = words;
#else
  if (x + PIXELS <= width) {
    ((global PackedInts*)(row + 4 * x))->lanes = words;
  } else {
    store_words_at_edge(words, (global int*)row + x, width - x);
  }
#endif
}

// rint below 2^22, in instructions that every compiler vectorises; what is larger stays as large.
static inline Floats nearest(const Floats value) {
  const Floats shift = 12582912.0f;  // 1.5 * 2^23
  return (value + shift) - shift;
}

#endif
