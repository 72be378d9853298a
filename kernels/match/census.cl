// SPDX-License-Identifier: Apache-2.0
// What matching compares, a code a pixel: a bit for each comparison of two grey values in a window around it.
// - Census transform (Zabih and Woodfill 1994): every pixel of the window, row by row, against the centre.
// - Sparse census: 32 pixels of a window against its centre (EGOSGM_CENSUS13X11).
// - The grey value itself (8 bits), for sums of absolute differences.
// Pixels outside the image are those of its border.
//
// A view's codes lie in rows of `stride` = padding + width + padding, the right view's from right to left, so that the
// codes a pixel is compared with at growing disparities lie at growing addresses in both views. The padding repeats the
// border's codes.
#include "method.h"
#include "grey.h"

// lint: PIXEL_BYTES=1 CODE_BYTES=8 COMPARISONS=1 RADIUS_X=4 RADIUS_Y=3 PIXELS=16
// lint: PIXEL_BYTES=1 CODE_BYTES=4 COMPARISONS=1 RADIUS_X=2 RADIUS_Y=2 PIXELS=1
// lint: PIXEL_BYTES=1 CODE_BYTES=4 COMPARISONS=2 RADIUS_X=4 RADIUS_Y=3 PIXELS=16
// lint: PIXEL_BYTES=1 CODE_BYTES=4 COMPARISONS=0 RADIUS_X=1 RADIUS_Y=1 PIXELS=1
// lint: PIXEL_BYTES=2 CODE_BYTES=8 COMPARISONS=1 RADIUS_X=4 RADIUS_Y=3 PIXELS=1
// lint: PIXEL_BYTES=2 CODE_BYTES=4 COMPARISONS=1 RADIUS_X=2 RADIUS_Y=2 PIXELS=16
// lint: PIXEL_BYTES=2 CODE_BYTES=4 COMPARISONS=2 RADIUS_X=4 RADIUS_Y=3 PIXELS=1
// lint: PIXEL_BYTES=2 CODE_BYTES=4 COMPARISONS=0 RADIUS_X=1 RADIUS_Y=1 PIXELS=16

#ifndef CODE_BYTES
#error "CODE_BYTES: 4 or 8, the size of a code"
#endif
#ifndef PIXELS
#error "PIXELS: of a work-item, 1 or 16"
#endif
#ifndef COMPARISONS
#error "COMPARISONS: 0 for the grey value, 1 for a census window, 2 for the sparse census"
#endif
#ifndef RADIUS_X
#error "RADIUS_X: half the window's width"
#endif
#ifndef RADIUS_Y
#error "RADIUS_Y: half the window's height"
#endif

#if CODE_BYTES == 4
typedef uint Code;
#else
typedef ulong Code;
#endif

#if COMPARISONS == 2
constant char kSparse[32][2] = EGOSGM_CENSUS13X11;
#endif

inline Code code_at(const ImageSize size, global const Pixel* image, const int x, const int y) {
#define AT(dx, dy) image[(size_t)clamp(y + (dy), 0, size.height - 1) * size.width + clamp(x + (dx), 0, size.width - 1)]
#if COMPARISONS == 0
  return to_8_bit(AT(0, 0));
#elif COMPARISONS == 1
  Code code = 0;
  for (int dy = -RADIUS_Y; dy <= RADIUS_Y; ++dy) {
    for (int dx = -RADIUS_X; dx <= RADIUS_X; ++dx) {
      if (dx != 0 || dy != 0) code = code << 1 | (AT(dx, dy) < AT(0, 0) ? 1 : 0);
    }
  }
  return code;
#else
  Code code = 0;
#pragma unroll
  for (int i = 0; i < 32; ++i) {
    code = code << 1 | (AT(kSparse[i][0], kSparse[i][1]) < AT(0, 0) ? 1 : 0);
  }
  return code;
#endif
}

#if PIXELS == 1

// A work-item a code, those of the padding too: they are the border's.
KERNEL void census(const ImageSize size, const int padding, global const uchar* images, global uint* all_codes) {
  const int at = get_global_id(0), y = get_global_id(1), view = get_global_id(2);
  const int stride = size.width + 2 * padding;
  if (at >= stride) return;

  const size_t row = (size_t)view * size.height + y;
  global const Pixel* image = (global const Pixel*)images + (size_t)view * size.height * size.width;
  const int along = clamp(at - padding, 0, size.width - 1);
  const int x = view == EGOSGM_LEFT ? along : size.width - 1 - along;
  ((global Code*)all_codes)[row * stride + at] = code_at(size, image, x, y);
}

#else

#if CODE_BYTES == 4
typedef uint16 Codes;
#define convert_codes convert_uint16
#else
typedef ulong16 Codes;
#define convert_codes convert_ulong16
#endif

typedef struct __attribute__((packed)) {
  Codes codes;
} PackedCodes;

// Appends a bit to codes of 8 bits: compilers keep these in narrow vectors.
inline uchar16 append(const uchar16 bits, const Pixels first, const Pixels second) {
  return bits + bits - as_uchar16(convert_char16(first < second));
}

// 16 pixels at once, where no column needs clamping.
inline Codes codes_at(const ImageSize size, global const Pixel* image, const int x, const int y) {
#define ROW(dy) (image + (size_t)clamp(y + (dy), 0, size.height - 1) * size.width + x)
  Codes codes = 0;
#if COMPARISONS == 0
  codes = convert_codes(to_8_bit(load_grey(ROW(0))));
#elif COMPARISONS == 1
  const Pixels centre = load_grey(ROW(0));
  uchar16 bits = 0;
  int count = 0;
#pragma unroll
  for (int dy = -RADIUS_Y; dy <= RADIUS_Y; ++dy) {
    global const Pixel* row = ROW(dy);
#pragma unroll
    for (int dx = -RADIUS_X; dx <= RADIUS_X; ++dx) {
      if (dx == 0 && dy == 0) continue;
      bits = append(bits, load_grey(row + dx), centre);
      if (++count % 8 == 0) codes = (codes << (Codes)(8)) | convert_codes(bits);
    }
  }
  codes = (codes << (Codes)(count % 8)) | (convert_codes(bits) & (Codes)((1 << count % 8) - 1));
#else
  const Pixels centre = load_grey(ROW(0));
  global const Pixel* rows[2 * RADIUS_Y + 1];
#pragma unroll
  for (int dy = -RADIUS_Y; dy <= RADIUS_Y; ++dy) rows[RADIUS_Y + dy] = ROW(dy);
#pragma unroll
  for (int byte = 0; byte < 4; ++byte) {
    uchar16 bits = 0;
#pragma unroll
    for (int i = 8 * byte; i < 8 * byte + 8; ++i) {
      bits = append(bits, load_grey(rows[RADIUS_Y + kSparse[i][1]] + kSparse[i][0]), centre);
    }
    codes = (codes << (Codes)(8)) | convert_codes(bits);
  }
#endif
  return codes;
}

// A work-item a row and view.
KERNEL void census(const ImageSize size, const int padding, global const uchar* images, global uint* all_codes) {
  const int y = get_global_id(0);
  const int view = get_global_id(1);
  if (y >= size.height) return;

  const int width = size.width;
  const size_t stride = (size_t)width + 2 * (size_t)padding;
  global const Pixel* image = (global const Pixel*)images + (size_t)view * size.height * width;
  global Code* row = (global Code*)all_codes + ((size_t)view * size.height + y) * stride + padding;

  // Blocks of 16 from RADIUS_X on; the last one overlaps the one before it, to leave few pixels to the slow way.
  const int last_block = width - RADIUS_X - 16;
  int x = 0;
  while (x < width) {
    const bool inside = last_block >= RADIUS_X && x >= RADIUS_X && x < width - RADIUS_X;
    if (inside) {
      const int first = min(x, last_block);
      const Codes codes = codes_at(size, image, first, y);
      if (view == EGOSGM_LEFT) {
        ((global PackedCodes*)(row + first))->codes = codes;
      } else {
        ((global PackedCodes*)(row + width - 16 - first))->codes = codes.sfedcba9876543210;
      }
      x += first - x + 16;
    } else {
      row[view == EGOSGM_LEFT ? x : width - 1 - x] = code_at(size, image, x, y);
      x += 1;
    }
  }
  for (int i = 1; i <= padding; ++i) {
    row[-i] = row[0];
    row[width - 1 + i] = row[width - 1];
  }
}

#endif
