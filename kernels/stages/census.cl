// SPDX-License-Identifier: Apache-2.0
// Computes a code a pixel for matching: a bit for each comparison of two grey values in a window around it.
// - Census transform (Zabih and Woodfill 1994): every pixel of the window, row by row, against the centre.
// - Alike, in place of the census of 9x7 where it is asked for, of grey values of 16 bits: which pixels of the window
//   are about as bright as its centre, so that they may lie on its surface.
// - The grey value itself (8 bits), for sums of absolute differences.
// Pixels outside the image are those of its border.
//
// A view's codes lie in rows of `stride` = padding + width + padding, the right view's from right to left, so that the
// codes a pixel is compared with at growing disparities lie at growing addresses in both views. The padding repeats the
// border's codes.
#include "block.h"
#include "code.h"
#include "grey.h"
#include "method.h"

// lint: PIXEL_BYTES=1 CODE_BYTES=8 RADIUS_X=4 RADIUS_Y=3 PIXELS=16
// lint: PIXEL_BYTES=1 CODE_BYTES=4 RADIUS_X=2 RADIUS_Y=2 PIXELS=1
// lint: PIXEL_BYTES=2 CODE_BYTES=8 RADIUS_X=4 RADIUS_Y=3 PIXELS=16
// lint: PIXEL_BYTES=1 CODE_BYTES=4 RADIUS_X=0 RADIUS_Y=0 PIXELS=1
// lint: PIXEL_BYTES=2 CODE_BYTES=8 RADIUS_X=4 RADIUS_Y=3 PIXELS=1
// lint: PIXEL_BYTES=2 CODE_BYTES=4 RADIUS_X=2 RADIUS_Y=2 PIXELS=16
// lint: PIXEL_BYTES=2 CODE_BYTES=8 RADIUS_X=2 RADIUS_Y=2 PIXELS=16
// lint: PIXEL_BYTES=2 CODE_BYTES=8 RADIUS_X=2 RADIUS_Y=2 PIXELS=1
// lint: PIXEL_BYTES=2 CODE_BYTES=4 RADIUS_X=0 RADIUS_Y=0 PIXELS=16

#ifndef PIXELS
#error "PIXELS: of a work-item, 1 or 16"
#endif
#ifndef RADIUS_X
#error "RADIUS_X: half the window's width; 0 for the grey value"
#endif
#ifndef RADIUS_Y
#error "RADIUS_Y: half the window's height"
#endif

// The comparisons, and the place of each beside the centre.
#define WINDOW_WIDTH (2 * RADIUS_X + 1)
#define COUNT (WINDOW_WIDTH * (2 * RADIUS_Y + 1) - 1)
#define PLACE(i) ((i) < COUNT / 2 ? (i) : (i) + 1)
#define DX(i) (PLACE(i) % WINDOW_WIDTH - RADIUS_X)
#define DY(i) (PLACE(i) / WINDOW_WIDTH - RADIUS_Y)

// A code of one word: its distances are twice as large then, as those of one that is alone count twice (cost.h).
#define STANDS_TWICE (CODE_BYTES == 8 && COUNT <= 32)

// The rows of the window around a pixel; outside the image its border's.
typedef struct {
  global const Pixel* at[2 * RADIUS_Y + 1];
} Rows;

static inline Rows rows_around(const ImageSize size, global const Pixel* image, const int y) {
  Rows rows;
#pragma unroll
  for (int dy = -RADIUS_Y; dy <= RADIUS_Y; ++dy) {
    rows.at[RADIUS_Y + dy] = image + (size_t)clamp(y + dy, 0, size.height - 1) * size.width;
  }
  return rows;
}

#define AT(dx, dy) rows->at[RADIUS_Y + (dy)][clamp(x + (dx), 0, width - 1)]
#define BESIDE(dx, dy) load_greys(rows->at[RADIUS_Y + (dy)] + x + (dx))
// It asks for pixels of Rows, and compares the window.
#include "alike.h"

// alike: whether the code says what is alike, where that can be asked.
static inline Code code_at(const int width, const Rows* rows, const int x, const int alike) {
#if HAS_ALIKE
  if (alike) return alike_at(width, rows, x);
#endif
#if RADIUS_X == 0
  return to_8_bit(AT(0, 0));
#else
  Code code = 0;
#pragma unroll
  for (int i = 0; i < COUNT; ++i) code = code << 1 | (AT(DX(i), DY(i)) < AT(0, 0) ? 1 : 0);
  return STANDS_TWICE ? code << (4 * CODE_BYTES) | code : code;
#endif
}

#if PIXELS == 1

// A work-item a code, those of the padding too: they are the border's.
KERNEL void census(const ImageSize size, const int row_step, const int padding, const int alike,
                   global const uchar* images, global uint* all_codes) {
  const int at = get_global_id(0), y = get_global_id(1), view = get_global_id(2);
  const int stride = size.width + 2 * padding;
  if (at >= stride || y % row_step != 0) return;

  const size_t row = (size_t)view * size.height + y;
  global const Pixel* image = (global const Pixel*)images + (size_t)view * size.height * size.width;
  const int along = clamp(at - padding, 0, size.width - 1);
  const int x = view == EGOSGM_LEFT ? along : size.width - 1 - along;
  const Rows rows = rows_around(size, image, y);
  ((global Code*)all_codes)[row * stride + at] = code_at(size.width, &rows, x, alike);
}

#else

#if RADIUS_X == 0

#define CODES_AT_ONCE 16
static inline void write_codes_at(const Rows* rows, const int x, const int width, const int view, global Code* row) {
  write_codes(convert_codes(to_8_bit(load_grey(rows->at[RADIUS_Y] + x))), x, width, view, row);
}

#else

// No column needs clamping here. Bits are put into bytes: compilers keep these in narrow vectors.
static inline void write_codes_at(const Rows* rows, const int x, const int width, const int view, global Code* row) {
  const Greys centre = load_greys(rows->at[RADIUS_Y] + x);
  Bytes bytes[CODE_BYTES];
#pragma unroll
  for (int byte = 0; byte < CODE_BYTES; ++byte) bytes[byte] = 0;
#pragma unroll
  for (int i = 0; i < COUNT; ++i) {
    const int place = COUNT - 1 - i;
    bytes[place / 8] |= bit_where_less(BESIDE(DX(i), DY(i)), centre, 1 << place % 8);
  }
#if STANDS_TWICE
#pragma unroll
  for (int byte = 0; byte < 4; ++byte) bytes[byte + 4] = bytes[byte];
#endif
#if CODES_AT_ONCE == 32
  write_codes(JOINED_BYTES(FIRST_VECTOR, bytes), x, width, view, row);
  write_codes(JOINED_BYTES(SECOND_VECTOR, bytes), x + 16, width, view, row);
#else
  write_codes(JOINED_BYTES(WHOLE_BYTES, bytes), x, width, view, row);
#endif
}

#endif

// A work-item a row and view.
COMPILED_ONCE void census_row(const WorkItem at, const ImageSize size, const int row_step, const int padding,
                              const int alike, global const uchar* images, global uint* all_codes) {
  const int y = at.x, view = at.y;
  if (y >= size.height || y % row_step != 0) return;

  const int width = size.width;
  const size_t stride = (size_t)width + 2 * (size_t)padding;
  const Rows rows = rows_around(size, (global const Pixel*)images + (size_t)view * size.height * width, y);
  global Code* row = (global Code*)all_codes + ((size_t)view * size.height + y) * stride + padding;

  // Blocks from RADIUS_X on; the last one overlaps the one before it, to leave few pixels to the slow way.
  const int last_block = width - RADIUS_X - CODES_AT_ONCE;
  int x = 0;
  while (x < width) {
    const bool inside = last_block >= RADIUS_X && x >= RADIUS_X && x < width - RADIUS_X;
    if (inside) {
      const int first = min(x, last_block);
#if HAS_ALIKE
      if (alike) {
        write_alike_at(&rows, first, width, view, row);
      } else {
        write_codes_at(&rows, first, width, view, row);
      }
#else
      write_codes_at(&rows, first, width, view, row);
#endif
      x += first - x + CODES_AT_ONCE;
    } else {
      row[view == EGOSGM_LEFT ? x : width - 1 - x] = code_at(width, &rows, x, alike);
      x += 1;
    }
  }
  const Codes first = row[0], last = row[width - 1];
  int i = 0;
  for (; i + 16 <= padding; i += 16) {
    ((global PackedCodes*)(row - 16 - i))->codes = first;
    ((global PackedCodes*)(row + width + i))->codes = last;
  }
  for (; i < padding; ++i) {
    row[-1 - i] = row[0];
    row[width + i] = row[width - 1];
  }
}

KERNEL void census(const ImageSize size, const int row_step, const int padding, const int alike,
                   global const uchar* images, global uint* all_codes) {
  census_row(THIS_WORK_ITEM, size, row_step, padding, alike, images, all_codes);
}

#endif
