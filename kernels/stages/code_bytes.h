// SPDX-License-Identifier: Apache-2.0
// Codes of census.cl as vectors, which are put together byte by byte: compilers keep these in narrow vectors. OpenCL C
// only.
#ifndef EGOSGM_KERNELS_CODE_BYTES_H
#define EGOSGM_KERNELS_CODE_BYTES_H

#include "block.h"
#include "code.h"
#include "grey.h"
#include "method.h"

#if PIXELS > 1

#if CODE_BYTES == 4
#define convert_codes convert_uint16
#else
#define convert_codes convert_ulong16
#endif

// Writes the codes of pixels x .. x + 15 of a row, the right view's from right to left.
static inline void write_codes(const Codes codes, const int x, const int width, const int view, global Code* row) {
  if (view == EGOSGM_LEFT) {
    ((global PackedCodes*)(row + x))->codes = codes;
  } else {
    ((global PackedCodes*)(row + width - 16 - x))->codes = codes.sfedcba9876543210;
  }
}

#if RADIUS_X > 0

// A block of 8-bit pixels at once, or 16 of 16 bits.
#if PIXEL_BYTES == 1
#define CODES_AT_ONCE BLOCK
typedef Block Greys;
typedef Block Bytes;
typedef struct __attribute__((packed)) {
  Block greys;
} PackedGreys;
static inline Greys load_greys(global const Pixel* from) { return ((global const PackedGreys*)from)->greys; }
static inline Bytes bit_where_less(const Greys a, const Greys b, const int bit) {
  return a < b ? (Block)((uchar)bit) : (Block)(0);
}
#else
#define CODES_AT_ONCE 16
typedef Pixels Greys;
typedef uchar16 Bytes;
static inline Greys load_greys(global const Pixel* from) { return load_grey(from); }
static inline Bytes bit_where_less(const Greys a, const Greys b, const int bit) {
  return as_uchar16(convert_char16(a < b)) & (uchar16)((uchar)bit);
}
#endif

// Codes of their bytes, the lowest first.
static inline uint16 joined_bytes(const uchar16 b0, const uchar16 b1, const uchar16 b2, const uchar16 b3) {
  const ushort16 upper = convert_ushort16(b3) << (ushort16)(8) | convert_ushort16(b2);
  const ushort16 lower = convert_ushort16(b1) << (ushort16)(8) | convert_ushort16(b0);
  return convert_uint16(upper) << (uint16)(16) | convert_uint16(lower);
}
#if CODE_BYTES == 4
#define JOINED_BYTES(HALF, bytes) joined_bytes(HALF(bytes[0]), HALF(bytes[1]), HALF(bytes[2]), HALF(bytes[3]))
#else
#define JOINED_BYTES(HALF, bytes)                                                                                   \
  (convert_ulong16(joined_bytes(HALF(bytes[4]), HALF(bytes[5]), HALF(bytes[6]), HALF(bytes[7]))) << (ulong16)(32) | \
   convert_ulong16(joined_bytes(HALF(bytes[0]), HALF(bytes[1]), HALF(bytes[2]), HALF(bytes[3]))))
#endif
#define WHOLE_BYTES(bytes) (bytes)

#endif
#endif

#endif
