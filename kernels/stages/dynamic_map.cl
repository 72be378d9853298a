// SPDX-License-Identifier: Apache-2.0
// DynamicMap marks what moves by itself in the left view. It looks for each block of the new image in the last one: at
// the place to which the camera's motion and the block's disparity lead, and around it. Small images bear noise. All
// but that place is counted in whole numbers.
#include "method.h"
#include "pixels.h"
#include "small_census.h"

// lint: PIXELS=1
// lint: PIXELS=16

#define PLACES EGOSGM_DYNAMIC_PLACES
#define CENTRE EGOSGM_DYNAMIC_CENTRE
#define ONE EGOSGM_DYNAMIC_FINENESS

// A word says these things of a block in its lowest byte. The next two bytes are its place's fraction or its best
// place.
#define ASKED 1
#define HIDDEN 2
#define NEW 4
#define NEARER 8
#define FARTHER 16
#define MOVES 32

KERNEL void halve(const ImageSize size, const int pixel_bytes, global const uchar* images, global ushort* halved) {
  halve_row(THIS_WORK_ITEM, size, pixel_bytes, images, halved);
}

// The first view is the last image.
KERNEL void shrink_halves(const ImageSize size, global const ushort* last, global const ushort* current,
                          global ushort* last_to, global ushort* current_to) {
  const int is_last = get_global_id(2) == 0;
  shrink_row(THIS_WORK_ITEM, size, is_last ? last : current, is_last ? last_to : current_to);
}

KERNEL void encode_small(const ImageSize size, global const ushort* last, global const ushort* current,
                         global uint* last_codes, global uint* current_codes) {
  const int is_last = get_global_id(2) == 0;
  encode_row(THIS_WORK_ITEM, size, is_last ? last : current, is_last ? last_codes : current_codes);
}

// A block has the disparity of the pixel in its middle, or of one beside it.
static inline float disparity_of_block(const int width, global const float* middle) {
  if (middle[0] > EGOSGM_INVALID_DISPARITY) return middle[0];
  if (middle[-width - 1] > EGOSGM_INVALID_DISPARITY) return middle[-width - 1];
  return middle[-width] > EGOSGM_INVALID_DISPARITY ? middle[-width] : middle[-1];
}

// Finds the costs of each block at the places around the one in the last image to which the camera's motion leads, and
// reads the last map there. `motion` leads from the new frame to the last one. `side` is a block's, in pixels of
// `size`.
COMPILED_ONCE void compare_places_row(const WorkItem at, const ImageSize size, const ImageSize image,
                                      const ImageSize blocks, const int side, const DisparityMotion motion,
                                      global const uint* last_codes, global const uint* codes, global const float* last,
                                      global const float* disparity, global float* of_blocks, global int* places,
                                      global uchar* costs) {
  const int y = at.y;
  const float shift = 12582912.0f;  // 1.5 * 2^23: rounds
  const float farthest = 1048576.0f;
  FOR_EACH(x, blocks.width) {
    const size_t block = (size_t)y * blocks.width + x;
    const int middle_x = side * x + side / 2, middle_y = side * y + side / 2;
    const float d = disparity_of_block(size.width, disparity + (size_t)middle_y * size.width + middle_x);
    of_blocks[block] = d;
    places[block] = 0;
    if (!(d > EGOSGM_INVALID_DISPARITY)) continue;

    const float own_x = middle_x - 0.5f, own_y = middle_y - 0.5f;
    const float wx = own_x - motion.cx, wy = own_y - motion.cy, wd = d + motion.doffs;
    const float w = motion.w[0] * wx + motion.w[1] * wy + motion.w[2] * wd + motion.w[3];
    if (!(w > EGOSGM_MIN_DEPTH_RATIO)) continue;
    const float phi = 1.0f / w;
    const float u = (motion.x[0] * wx + motion.x[1] * wy + motion.x[2] * wd + motion.x[3]) * phi + motion.cx;
    const float v = (motion.y[0] * wx + motion.y[1] * wy + motion.y[2] * wd + motion.y[3]) * phi + motion.cy;
    if (!(fabs(u) < farthest) || !(fabs(v) < farthest)) continue;

    const float off_x = (u - own_x) * 2.0f / side, off_y = (v - own_y) * 2.0f / side;
    const float whole_x = floor(off_x), whole_y = floor(off_y);
    const int first_x = 2 * x + (int)whole_x - CENTRE, first_y = 2 * y + (int)whole_y - CENTRE;
    if (first_x < 0 || first_y < 0 || first_x + PLACES + 1 > image.width || first_y + PLACES + 1 > image.height) {
      continue;
    }
    const int seen_x = (int)((u + shift) - shift), seen_y = (int)((v + shift) - shift);
    if (seen_x < 0 || seen_y < 0 || seen_x >= size.width || seen_y >= size.height) continue;
    const float seen = last[(size_t)seen_y * size.width + seen_x], expected = wd * phi - motion.doffs;
    if (!(seen > EGOSGM_INVALID_DISPARITY)) continue;
    const float part = EGOSGM_DYNAMIC_PART * fmax(expected, 0.0f), apart = fabs(seen - expected);
    int kinds = ASKED;
    if (seen > expected + EGOSGM_DYNAMIC_HIDES_PX + part) kinds |= HIDDEN;
    if (seen < expected - EGOSGM_DYNAMIC_NEW_PX - part) kinds |= NEW;
    if (apart > EGOSGM_DYNAMIC_LEAST_PX && apart < EGOSGM_DYNAMIC_MOST_PX + part) {
      kinds |= seen > expected ? NEARER : FARTHER;
    }
    places[block] = kinds | (int)((off_x - whole_x) * ONE) << 8 | (int)((off_y - whole_y) * ONE) << 16;

    global const uint* row = codes + (size_t)2 * y * image.width + 2 * x;
    const uint4 own = (uint4)(row[0], row[1], row[image.width], row[image.width + 1]);
    global const uint* from = last_codes + (size_t)first_y * image.width + first_x;
    global uchar8* rows = (global uchar8*)costs + PLACES * block;
    for (int i = 0; i < PLACES; ++i) {
      rows[i] = costs_of_row(own, image.width, from + i * image.width);
    }
  }
}

KERNEL void compare_places(const ImageSize size, const ImageSize image, const ImageSize blocks, const int side,
                           const DisparityMotion motion, global const uint* last_codes, global const uint* codes,
                           global const float* last, global const float* disparity, global float* of_blocks,
                           global int* places, global uchar* costs) {
  compare_places_row(THIS_WORK_ITEM, size, image, blocks, side, motion, last_codes, codes, last, disparity, of_blocks,
                     places, costs);
}

// Finds the best place of each block by the costs of the 3x3 blocks around it that were asked, and whether that is
// another one than the camera's. The cost at the camera's place is interpolated where is_finest, at half of the
// resolution. It is the least of the four around at coarser resolutions, where places are far apart.
COMPILED_ONCE void find_places_row(const WorkItem at, const ImageSize blocks, const int is_finest,
                                   global const int* places, global const uchar* costs, global int* found) {
  const int y = at.y;
  FOR_EACH(x, blocks.width) {
    const size_t block = (size_t)y * blocks.width + x;
    const int known = places[block];
    found[block] = known & 255;
    if (!(known & ASKED)) continue;

    ushort8 rows[PLACES];
    for (int i = 0; i < PLACES; ++i) rows[i] = 0;
    int count = 0;
    for (int v = max(y - 1, 0); v <= min(y + 1, blocks.height - 1); ++v) {
      for (int u = max(x - 1, 0); u <= min(x + 1, blocks.width - 1); ++u) {
        const size_t other = (size_t)v * blocks.width + u;
        if (!(places[other] & ASKED)) continue;
        ++count;
#pragma unroll
        for (int i = 0; i < PLACES; ++i) rows[i] += convert_ushort8(((global const uchar8*)costs)[PLACES * other + i]);
      }
    }
    if (count < 3) continue;
    ushort8 leasts = rows[0];
#pragma unroll
    for (int i = 1; i < PLACES; ++i) leasts = min(leasts, rows[i]);
    const ushort* sums = (const ushort*)rows;
    const ushort4 of_four = min(leasts.lo, leasts.hi);
    const ushort2 of_two = min(of_four.lo, of_four.hi);
    const int best = min(of_two.x, of_two.y);

    // Costs are ONE * ONE times as large from here on.
    const int part_x = known >> 8 & 255, part_y = known >> 16 & 255;
    const int centre = CENTRE * PLACES + CENTRE;
    const int a = sums[centre], b = sums[centre + 1], c = sums[centre + PLACES], d = sums[centre + PLACES + 1];
    const int interpolated =
        (ONE - part_y) * ((ONE - part_x) * a + part_x * b) + part_y * ((ONE - part_x) * c + part_x * d);
    const int there = is_finest ? interpolated : ONE * ONE * min(min(a, b), min(c, d));
    const int pixels = ONE * ONE * 4 * count;
    const int asked = known & HIDDEN ? min(there, EGOSGM_DYNAMIC_HIDDEN_BITS * pixels) : there;
    const int least = ONE * ONE * best;
    int kinds = known & 255;
    if (!(there > EGOSGM_DYNAMIC_DIFFERENT_BITS * pixels)) kinds &= ~NEW;
    int best_x = 0, best_y = 0;
    if (2 * (asked - least) > EGOSGM_DYNAMIC_GAIN_HALF_BITS * pixels &&
        10 * least < EGOSGM_DYNAMIC_RATIO_TENTHS * asked) {
      int place = 0;
      while (place < PLACES * PLACES - 1 && sums[place] != best) ++place;
      best_x = ONE * (place % PLACES - CENTRE) - part_x;
      best_y = ONE * (place / PLACES - CENTRE) - part_y;
      if (!is_finest || best_x * best_x + best_y * best_y > EGOSGM_DYNAMIC_LEAST_SQUARE) kinds |= MOVES;
    }
    found[block] = kinds | (best_x + 128) << 8 | (best_y + 128) << 16;
  }
}

KERNEL void find_places(const ImageSize blocks, const int is_finest, global const int* places,
                        global const uchar* costs, global int* found) {
  find_places_row(THIS_WORK_ITEM, blocks, is_finest, places, costs, found);
}

// Counts the blocks around (x, y), `radius` to all sides, of which all `kinds` hold.
static inline int count_around(const ImageSize blocks, global const int* found, const int x, const int y,
                               const int radius, const int kinds) {
  int count = 0;
  for (int v = max(y - radius, 0); v <= min(y + radius, blocks.height - 1); ++v) {
    for (int u = max(x - radius, 0); u <= min(x + radius, blocks.width - 1); ++u) {
      count += (found[(size_t)v * blocks.width + u] & kinds) == kinds;
    }
  }
  return count;
}

// Tells whether enough blocks around have the best place of a block that moves.
static inline int has_votes(const ImageSize blocks, global const int* found, const int x, const int y) {
  const int own = found[(size_t)y * blocks.width + x];
  int count = 0;
  for (int v = max(y - 1, 0); v <= min(y + 1, blocks.height - 1); ++v) {
    for (int u = max(x - 1, 0); u <= min(x + 1, blocks.width - 1); ++u) {
      const int other = found[(size_t)v * blocks.width + u];
      const int apart_x = abs((other >> 8 & 255) - (own >> 8 & 255)), apart_y = abs((other >> 16) - (own >> 16));
      count += (other & MOVES) && apart_x <= EGOSGM_DYNAMIC_AGREES && apart_y <= EGOSGM_DYNAMIC_AGREES;
    }
  }
  return count >= EGOSGM_DYNAMIC_VOTES;
}

// Marks each block: 0 was not asked, 1 was asked, 2 moves. A coarser block that moves takes its four finer ones along.
// Maps vote too where is_finest.
COMPILED_ONCE void vote_row(const WorkItem at, const ImageSize blocks, const ImageSize coarse, const int is_finest,
                            global const int* found, global const uchar* coarse_marks, global uchar* marks) {
  const int y = at.y;
  FOR_EACH(x, blocks.width) {
    const size_t block = (size_t)y * blocks.width + x;
    const int own = found[block];
    int moves =
        x / 2 < coarse.width && y / 2 < coarse.height && coarse_marks[(size_t)(y / 2) * coarse.width + x / 2] == 2;
    if (own & MOVES) moves |= has_votes(blocks, found, x, y);
    if (is_finest) {
      if (own & NEW) moves |= count_around(blocks, found, x, y, 1, ASKED | NEW) >= EGOSGM_DYNAMIC_VOTES;
      const int side = own & (NEARER | FARTHER);
      if (side) moves |= count_around(blocks, found, x, y, 2, ASKED | side) >= EGOSGM_DYNAMIC_DEPTH_VOTES;
    }
    marks[block] = moves ? 2 : own & ASKED;
  }
}

KERNEL void vote_blocks(const ImageSize blocks, const ImageSize coarse, const int is_finest, global const int* found,
                        global const uchar* coarse_marks, global uchar* marks) {
  vote_row(THIS_WORK_ITEM, blocks, coarse, is_finest, found, coarse_marks, marks);
}

// Marks the pixels of a block as the blocks around are that lie on the pixel's surface. The last blocks take the rest
// of the image.
COMPILED_ONCE void mark_row(const WorkItem at, const ImageSize size, const ImageSize blocks,
                            global const float* disparity, global const float* of_blocks,
                            global const uchar* block_marks, global uchar* marks) {
  const int side = EGOSGM_DYNAMIC_BLOCK, y = at.y;
  const int end_y = y + 1 < blocks.height ? side * (y + 1) : size.height;
  FOR_EACH(x, blocks.width) {
    const int end_x = x + 1 < blocks.width ? side * (x + 1) : size.width;
    const int reach = EGOSGM_DYNAMIC_REACH;
    const int left = max(x - reach, 0), right = min(x + reach, blocks.width - 1);
    const int top = max(y - reach, 0), bottom = min(y + reach, blocks.height - 1);
    int any = 0;
    for (int v = top; v <= bottom; ++v) {
      for (int u = left; u <= right; ++u) any |= block_marks[(size_t)v * blocks.width + u] == 2;
    }
    for (int pixel_y = side * y; pixel_y < end_y; ++pixel_y) {
      for (int pixel_x = side * x; pixel_x < end_x; ++pixel_x) {
        const size_t pixel = (size_t)pixel_y * size.width + pixel_x;
        marks[pixel] = 0;
        const float d = disparity[pixel];
        if (!any || !(d > EGOSGM_INVALID_DISPARITY)) continue;
        const float most = EGOSGM_DYNAMIC_ALIKE_PX + EGOSGM_DYNAMIC_ALIKE_PART * fmax(d, 0.0f);
        int moving = 0, others = 0;
        for (int v = top; v <= bottom; ++v) {
          for (int u = left; u <= right; ++u) {
            const size_t block = (size_t)v * blocks.width + u;
            const int is_alike = block_marks[block] && fabs(of_blocks[block] - d) <= most;
            moving += is_alike && block_marks[block] == 2;
            others += is_alike && block_marks[block] == 1;
          }
        }
        if (moving > 0 && EGOSGM_DYNAMIC_SHARE * moving >= others) marks[pixel] = 255;
      }
    }
  }
}

KERNEL void mark(const ImageSize size, const ImageSize blocks, global const float* disparity,
                 global const float* of_blocks, global const uchar* block_marks, global uchar* marks) {
  mark_row(THIS_WORK_ITEM, size, blocks, disparity, of_blocks, block_marks, marks);
}
