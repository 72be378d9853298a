// SPDX-License-Identifier: Apache-2.0
// TexturelessRegions leaves out what runs out of the image at its top without a texture, as a sky does. Nothing bounds
// such a region there: what little of it has a disparity, has that of the outlines beside it. So where fewer than
// three quarters of its pixels have one, none of them is published. A wall in the sun is filled from all of its sides,
// and stays.
//
// The blocks beside such a region hold its outline, which lends its disparity to the pixels around. Of these blocks,
// the pixels that are about as bright as the region's blocks beside them are not published, either.
//
// Textureless blocks of EGOSGM_COARSE x EGOSGM_COARSE pixels that touch by their sides are a region. Its label is the
// least column of its blocks at the top, counted from 1 on. Labels spread along columns and rows by turns. A block that
// they do not reach in EGOSGM_TEXTURELESS_SPREADS turns stays.
#include "grey.h"
#include "method.h"
#include "pixels.h"

// lint: PIXEL_BYTES=1 PIXELS=1
// lint: PIXEL_BYTES=2 PIXELS=16

#define TEXTURED 0
#define UNREACHED 0xffff  // by a label

// The blocks of a row of them that a work-item takes.
#define FOR_BLOCKS_OF_ROW(x, blocks) for (int x = at.x; x < (blocks).width; x += at.items)

// Tells of each of four blocks whether it has no texture, by its least and largest grey value: -1 or 0. A black one has
// none, either, but is the edge of a rectified image.
static inline int4 are_textureless(const int4 least, const int4 largest) {
  return EGOSGM_TEXTURELESS_CONTRAST * (largest - least) < largest;
}

// The least and the largest grey value of pixels.
typedef struct {
  Pixel least, largest;
} GreyRange;
#define NO_GREYS ((GreyRange){(Pixel)~0, 0})

static inline GreyRange grey_range(const Pixel grey) {
  const GreyRange greys = {grey, grey};
  return greys;
}
static inline GreyRange joined_greys(const GreyRange a, const GreyRange b) {
  const GreyRange greys = {min(a.least, b.least), max(a.largest, b.largest)};
  return greys;
}
static inline int is_textureless(const GreyRange greys) {
  return are_textureless((int4)(greys.least), (int4)(greys.largest)).x;
}

// REQUIRES: a block of the image.
static inline GreyRange greys_of_block(const ImageSize size, global const Pixel* image, const int x, const int y) {
  const int left = EGOSGM_COARSE * x, top = EGOSGM_COARSE * y;
  GreyRange greys = NO_GREYS;
  for (int v = top; v < min(top + EGOSGM_COARSE, size.height); ++v) {
    for (int u = left; u < min(left + EGOSGM_COARSE, size.width); ++u) {
      greys = joined_greys(greys, grey_range(image[(size_t)v * size.width + u]));
    }
  }
  return greys;
}

#if PIXELS > 1
// REQUIRES: four blocks side by side that lie within the image.
static inline int4 four_are_textureless(const ImageSize size, global const Pixel* image, const int x, const int y) {
  Pixels least = load_grey(image + (size_t)y * size.width + x), largest = least;
  for (int v = y + 1; v < y + EGOSGM_COARSE; ++v) {
    const Pixels greys = load_grey(image + (size_t)v * size.width + x);
    least = min(least, greys);
    largest = max(largest, greys);
  }
  const int4 least_of_each = convert_int4(min(min(least.s048c, least.s159d), min(least.s26ae, least.s37bf)));
  const int4 largest_of_each = convert_int4(max(max(largest.s048c, largest.s159d), max(largest.s26ae, largest.s37bf)));
  return are_textureless(least_of_each, largest_of_each);
}
#endif

COMPILED_ONCE void find_in_row(const WorkItem at, const ImageSize size, global const uchar* images,
                               global ushort* labels) {
  const ImageSize blocks = coarse_size(size);
  global const Pixel* image = (global const Pixel*)images + (size_t)at.view * size.height * size.width;
  global ushort* row = labels + ((size_t)at.view * blocks.height + at.y) * blocks.width;
  FOR_BLOCKS_OF_ROW(x, blocks) {
    const ushort label = at.y == 0 ? x + 1 : UNREACHED;
#if PIXELS > 1
    if (EGOSGM_COARSE * x + PIXELS <= size.width && EGOSGM_COARSE * (at.y + 1) <= size.height) {
      const ushort4 labels_of_four = label + (at.y == 0 ? (ushort4)(0, 1, 2, 3) : (ushort4)(0));
      const int4 textureless = four_are_textureless(size, image, EGOSGM_COARSE * x, EGOSGM_COARSE * at.y);
      vstore4(select((ushort4)(TEXTURED), labels_of_four, convert_short4(textureless)), 0, row + x);
      x += 3;
      continue;
    }
#endif
    row[x] = is_textureless(greys_of_block(size, image, x, at.y)) ? label : TEXTURED;
  }
}

// A work-item takes a block, or a row of them.
KERNEL void find_textureless(const ImageSize size, global const uchar* images, global ushort* labels) {
  find_in_row(THIS_WORK_ITEM, size, images, labels);
}

// Gives a block the label of the one before it where that is less. Returns what the next one is given.
static inline ushort spread_to(const ushort before, global ushort* label) {
  const ushort own = *label;
  if (own == TEXTURED) return UNREACHED;
  *label = min(before, own);
  return min(before, own);
}

// Spreads labels along a row of blocks (in_rows), or a column, and back. A work-item takes one of a view.
KERNEL void spread_labels(const ImageSize blocks, const int in_rows, global ushort* labels) {
  const int count = in_rows ? blocks.width : blocks.height, step = in_rows ? 1 : blocks.width;
  global ushort* line = labels + (size_t)get_global_id(1) * blocks.height * blocks.width +
                        get_global_id(0) * (in_rows ? blocks.width : 1);
  ushort before = UNREACHED;
  for (int i = 0; i < count; ++i) before = spread_to(before, line + (size_t)i * step);
  before = UNREACHED;
  for (int i = count - 1; i >= 0; --i) before = spread_to(before, line + (size_t)i * step);
}

// Whether a block has the label of a column. One that is none of them, as after a failed command, counts nowhere.
static inline int has_label(const ImageSize blocks, const ushort label) {
  return label != TEXTURED && label <= blocks.width;
}

static inline void add_counts(const ImageSize blocks, global int* counts, const ushort label, const int pixels,
                              const int filled) {
  if (!has_label(blocks, label)) return;
  atomic_add(&counts[2 * label], pixels);
  atomic_add(&counts[2 * label + 1], filled);
}

COMPILED_ONCE void count_row(const WorkItem at, const ImageSize size, const int row_step, global const float* disparity,
                             global const ushort* labels, global int* counts) {
  const ImageSize blocks = coarse_size(size);
  global const float* view = disparity + (size_t)at.view * size.height * size.width;
  global const ushort* row = labels + ((size_t)at.view * blocks.height + at.y) * blocks.width;
  global int* of_view = counts + 2 * at.view * (blocks.width + 1);
  ushort label = TEXTURED;
  int pixels = 0, filled = 0;
  FOR_BLOCKS_OF_ROW(x, blocks) {
    if (row[x] != label) {
      add_counts(blocks, of_view, label, pixels, filled);
      label = row[x];
      pixels = 0;
      filled = 0;
    }
    if (!has_label(blocks, label)) continue;
    for (int v = EGOSGM_COARSE * at.y; v < min(EGOSGM_COARSE * (at.y + 1), size.height); ++v) {
      for (int u = EGOSGM_COARSE * x; u < min(EGOSGM_COARSE * (x + 1), size.width) && v % row_step == 0; ++u) {
        ++pixels;
        filled += view[(size_t)v * size.width + u] > EGOSGM_INVALID_DISPARITY;
      }
    }
  }
  add_counts(blocks, of_view, label, pixels, filled);
}

// Counts the pixels of each label, and those that have a disparity. The counts are 0 before.
KERNEL void count_filled(const ImageSize size, const int row_step, global const float* disparity,
                         global const ushort* labels, global int* counts) {
  count_row(THIS_WORK_ITEM, size, row_step, disparity, labels, counts);
}

// Whether a block is one of a region that is left out, by its view's labels and counts.
static inline int is_left_out(const ImageSize blocks, global const ushort* labels, global const int* counts,
                              const int x, const int y) {
  if (x < 0 || y < 0 || x >= blocks.width || y >= blocks.height) return 0;
  const ushort label = labels[y * blocks.width + x];
  return has_label(blocks, label) && 4 * counts[2 * label + 1] < 3 * counts[2 * label];
}

// Whether a block of column x in the rows around y is.
static inline int column_is_left_out(const ImageSize blocks, global const ushort* labels, global const int* counts,
                                     const int x, const int y) {
  return is_left_out(blocks, labels, counts, x, y - 1) || is_left_out(blocks, labels, counts, x, y) ||
         is_left_out(blocks, labels, counts, x, y + 1);
}

// The grey values of the blocks around one that are left out. REQUIRES: there is one.
static inline GreyRange greys_beside(const ImageSize size, global const Pixel* image, global const ushort* labels,
                                     global const int* counts, const int x, const int y) {
  GreyRange greys = NO_GREYS;
  for (int v = y - 1; v <= y + 1; ++v) {
    for (int u = x - 1; u <= x + 1; ++u) {
      if (!is_left_out(coarse_size(size), labels, counts, u, v)) continue;
      greys = joined_greys(greys, greys_of_block(size, image, u, v));
    }
  }
  return greys;
}

COMPILED_ONCE void leave_out_of_row(const WorkItem at, const ImageSize size, const int row_step,
                                    global const uchar* images, global const ushort* labels, global const int* counts,
                                    global float* disparity) {
  const ImageSize blocks = coarse_size(size);
  const size_t first = (size_t)at.view * size.height * size.width;
  global const Pixel* image = (global const Pixel*)images + first;
  global const ushort* of_view = labels + (size_t)at.view * blocks.height * blocks.width;
  global const int* counts_of_view = counts + 2 * at.view * (blocks.width + 1);
  int asked = at.x - 2, nearest = at.x - 2;  // the last column that was asked, and the last one that is left out
  FOR_BLOCKS_OF_ROW(x, blocks) {
    for (int u = max(asked, x - 2) + 1; u <= x + 1; ++u) {
      if (column_is_left_out(blocks, of_view, counts_of_view, u, at.y)) nearest = u;
    }
    asked = x + 1;
    if (nearest < x - 1) continue;
    const int whole = is_left_out(blocks, of_view, counts_of_view, x, at.y);
    if (!whole && of_view[at.y * blocks.width + x] != TEXTURED) continue;
    const GreyRange beside = whole ? NO_GREYS : greys_beside(size, image, of_view, counts_of_view, x, at.y);
    for (int v = EGOSGM_COARSE * at.y; v < min(EGOSGM_COARSE * (at.y + 1), size.height); ++v) {
      for (int u = EGOSGM_COARSE * x; u < min(EGOSGM_COARSE * (x + 1), size.width) && v % row_step == 0; ++u) {
        const size_t i = (size_t)v * size.width + u;
        if (whole || is_textureless(joined_greys(beside, grey_range(image[i])))) {
          disparity[first + i] = EGOSGM_INVALID_DISPARITY;
        }
      }
    }
  }
}

KERNEL void leave_out(const ImageSize size, const int row_step, global const uchar* images, global const ushort* labels,
                      global const int* counts, global float* disparity) {
  leave_out_of_row(THIS_WORK_ITEM, size, row_step, images, labels, counts, disparity);
}
