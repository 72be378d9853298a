// SPDX-License-Identifier: Apache-2.0
// DynamicMap compares smaller images by a census of 5x5, in blocks of 2x2 pixels. OpenCL C only.
#ifndef EGOSGM_KERNELS_SMALL_CENSUS_H
#define EGOSGM_KERNELS_SMALL_CENSUS_H

#include "pixels.h"

// A work-item takes one element of a row, or on CPUs all of them.
#define FOR_EACH(x, width) for (int x = at.x; x < (width); x += at.items)

// A pixel of the small image is the mean of 2x2 grey values of the left image, made to fill 16 bits.
COMPILED_ONCE void halve_row(const WorkItem at, const ImageSize size, const int pixel_bytes, global const uchar* images,
                             global ushort* halved) {
  const int width = size.width / 2;
  const size_t first = (size_t)2 * at.y * size.width, second = first + size.width;
  global ushort* to = halved + (size_t)at.y * width;
  if (pixel_bytes == 1) {
    FOR_EACH(x, width) {
      to[x] = (ushort)((images[first + 2 * x] + images[first + 2 * x + 1] + images[second + 2 * x] +
                        images[second + 2 * x + 1])
                       << 6);
    }
  } else {
    global const ushort* wide = (global const ushort*)images;
    FOR_EACH(x, width) {
      to[x] =
          (ushort)((wide[first + 2 * x] + wide[first + 2 * x + 1] + wide[second + 2 * x] + wide[second + 2 * x + 1]) /
                   4);
    }
  }
}

// A pixel is the mean of 2x2 pixels of an image that `halve_row` or this function made.
COMPILED_ONCE void shrink_row(const WorkItem at, const ImageSize size, global const ushort* from, global ushort* to) {
  const int width = size.width / 2;
  global const ushort* first = from + (size_t)2 * at.y * size.width;
  global const ushort* second = first + size.width;
  FOR_EACH(x, width) {
    to[(size_t)at.y * width + x] = (ushort)((first[2 * x] + first[2 * x + 1] + second[2 * x] + second[2 * x + 1]) / 4);
  }
}

// A code has a bit for each pixel of a window of 5x5 that is darker than its centre. Pixels outside of the image repeat
// its border.
static inline uint small_code_at(const ImageSize size, global const ushort* image, const int x, const int y) {
  const int centre = image[(size_t)y * size.width + x];
  uint code = 0;
  for (int v = y - 2; v <= y + 2; ++v) {
    global const ushort* row = image + (size_t)clamp(v, 0, size.height - 1) * size.width;
    for (int u = x - 2; u <= x + 2; ++u) {
      if (u != x || v != y) code = code << 1 | (row[clamp(u, 0, size.width - 1)] < centre ? 1 : 0);
    }
  }
  return code;
}

#if PIXELS > 1
typedef struct __attribute__((packed)) {
  ushort16 greys;
} PackedSmallGreys;
typedef struct __attribute__((packed)) {
  uint16 codes;
} PackedSmallCodes;

// Makes the codes of 16 pixels whose windows lie in the image. Halves of 12 bits keep compilers to narrow vectors.
static inline void small_codes_at(const int width, global const ushort* centre, global uint* to) {
  const ushort16 greys = ((global const PackedSmallGreys*)centre)->greys;
  ushort16 halves[2] = {0, 0};
#pragma unroll
  for (int i = 0; i < 25; ++i) {
    if (i == 12) continue;
    const int bit = i < 12 ? 11 - i : 24 - i;
    const ushort16 other = ((global const PackedSmallGreys*)(centre + (i / 5 - 2) * width + i % 5 - 2))->greys;
    halves[i < 12 ? 0 : 1] |= as_ushort16(other < greys) & (ushort16)((ushort)(1 << bit));
  }
  ((global PackedSmallCodes*)to)->codes = convert_uint16(halves[0]) << (uint16)(12) | convert_uint16(halves[1]);
}
#endif

COMPILED_ONCE void encode_row(const WorkItem at, const ImageSize size, global const ushort* image, global uint* codes) {
  global uint* row = codes + (size_t)at.y * size.width;
#if PIXELS > 1
  const int is_inner = at.y >= 2 && at.y + 2 < size.height;
  for (int x = 2 - 16; x < size.width; x += 16) {
    if (is_inner && x >= 2 && x + 18 <= size.width) {
      small_codes_at(size.width, image + (size_t)at.y * size.width + x, row + x);
    } else {
      for (int u = max(x, 0); u < min(x + 16, size.width); ++u) row[u] = small_code_at(size, image, u, at.y);
    }
  }
#else
  FOR_EACH(x, size.width) row[x] = small_code_at(size, image, x, at.y);
#endif
}

// `load_grey` says why the vector is loaded through a packed struct.
#if PIXELS == 1
#define LOAD_PLACES(from) vload8(0, from)
#else
typedef struct __attribute__((packed)) {
  uint8 codes;
} PackedPlaces;
#define LOAD_PLACES(from) (((global const PackedPlaces*)(from))->codes)
#endif

// Counts the bits that are set in each byte of a word.
static inline uint8 byte_counts(const uint8 word) {
  uint8 x = word;
  x -= x >> 1u & 0x55555555u;
  x = (x & 0x33333333u) + (x >> 2u & 0x33333333u);
  return x + (x >> 4u) & 0x0f0f0f0fu;
}

// Sums the bits by which the four pixels of a block differ from those at each place of a row of places.
static inline uchar8 costs_of_row(const uint4 own, const int width, global const uint* places) {
  uint8 counts = byte_counts(LOAD_PLACES(places) ^ own.x);
  counts += byte_counts(LOAD_PLACES(places + 1) ^ own.y);
  counts += byte_counts(LOAD_PLACES(places + width) ^ own.z);
  counts += byte_counts(LOAD_PLACES(places + width + 1) ^ own.w);
  return convert_uchar8(counts * 0x01010101u >> 24u);
}

#endif
