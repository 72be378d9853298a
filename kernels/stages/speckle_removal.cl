// SPDX-License-Identifier: Apache-2.0
// Small regions by union-find over runs (connected pixels in a row). A run is known by the index of its first pixel;
// parents[run] is never above run, so that the root of a region is its first run, whatever the order in which runs are
// joined. A device may go on after a kernel that failed: indices that are read from memory are held below what they
// can be, which also ends every loop.
// lint: ROW_GROUP=1 PIXELS=16
// lint: ROW_GROUP=64 PIXELS=1

#ifndef ROW_GROUP
#error "ROW_GROUP: work-items that share a row"
#endif

#define NO_RUN 0xffff  // of an invalid pixel

#include "pixels.h"

// vload16 goes byte by byte on some compilers (PoCL 3.1); a packed struct is a plain unaligned access on all, but byte
// by byte for NVIDIA's GPUs, if it is not said where values begin.
typedef struct __attribute__((packed, aligned(sizeof(ushort)))) {
  ushort16 lanes;
} Runs;

ushort16 load_runs(global const ushort* runs) { return ((global const Runs*)runs)->lanes; }

bool is_connected(float a, float b, float max_difference) {
  return a > EGOSGM_INVALID_DISPARITY && b > EGOSGM_INVALID_DISPARITY && fabs(a - b) <= max_difference;
}

int16 are_connected(float16 a, float16 b, float max_difference) {
  return a > EGOSGM_INVALID_DISPARITY & b > EGOSGM_INVALID_DISPARITY & fabs(a - b) <= max_difference;
}

// Bit i is set where lane i is.
uint bits_of(int16 lanes) {
  const int16 bits = lanes & (int16)(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768);
  const int8 bits8 = bits.lo | bits.hi;
  const int4 bits4 = bits8.lo | bits8.hi;
  return bits4.x | bits4.y | bits4.z | bits4.w;
}

int lowest_bit(uint bits) { return 31 - clz(bits & -bits); }

#if ROW_GROUP == 1
// Finds where runs begin, as far as a row has seventeen pixels from x on, sixteen at a time: an inclusive maximum of
// the columns that do not continue their left neighbour's run. Returns the column behind; `begin` is where its left
// neighbour's run begins.
COMPILED_ONCE int find_runs_by_lanes(const int width, const float max_difference, global const float* disparity,
                                     const uint row, global ushort* runs, global uint* parents, global uint* sizes,
                                     int* begin) {
  int x = 0;
  for (; x + 17 <= width; x += 16) {
    const float16 d = vload16(0, disparity + x);
    float16 left = d;
    if (x > 0) {
      left = vload16(0, disparity + x - 1);
    } else {
      left = (float16)(EGOSGM_INVALID_DISPARITY, d.s0, d.s12, d.s3456, d.s789abcde);
    }
    const int16 columns = x + (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    int16 begins = are_connected(left, d, max_difference) ? (int16)(0) : columns;
    begins = max(begins, (int16)(0, begins.s0, begins.s12, begins.s3456, begins.s789abcde));
    begins = max(begins, (int16)((int2)(0), begins.s01, begins.s2345, begins.s6789abcd));
    begins = max(begins, (int16)((int4)(0), begins.s0123, begins.s456789ab));
    begins = max(begins, (int16)((int8)(0), begins.lo));
    begins = max(begins, (int16)(*begin));
    *begin = begins.sf;
    const int16 valid = d > EGOSGM_INVALID_DISPARITY;
    ((global Runs*)(runs + x))->lanes = convert_ushort16(valid ? begins : (int16)(NO_RUN));
    const int16 ends = valid & ~are_connected(d, vload16(0, disparity + x + 1), max_difference);
    for (uint left_ends = bits_of(ends); left_ends != 0; left_ends &= left_ends - 1) {
      const int end = x + lowest_bit(left_ends);
      const int first = runs[end];
      parents[first] = row + first;
      sizes[first] = end - first + 1;
    }
  }
  return x;
}
#endif

// Finds where the run of each pixel begins, and the length of each run. A work-group of ROW_GROUP a row and view.
KERNEL __attribute__((reqd_work_group_size(ROW_GROUP, 1, 1))) void find_runs(const ImageSize size,
                                                                             const float max_difference,
                                                                             global const float* disparity,
                                                                             global ushort* runs, global uint* parents,
                                                                             global uint* sizes) {
  const int lane = get_local_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  const size_t row = ((size_t)view * size.height + y) * size.width;
  int begin_before = 0;
#if ROW_GROUP > 1
  local int begins[ROW_GROUP];
#endif
  int tile = 0;
#if ROW_GROUP == 1
  tile = find_runs_by_lanes(size.width, max_difference, disparity + row, row, runs + row, parents + row, sizes + row,
                            &begin_before);
#endif
  for (; tile < size.width; tile += ROW_GROUP) {
    const int x = tile + lane;
    const float d = x < size.width ? disparity[row + x] : EGOSGM_INVALID_DISPARITY;
    const float left = x > 0 && x <= size.width ? disparity[row + x - 1] : EGOSGM_INVALID_DISPARITY;
    const float right = x + 1 < size.width ? disparity[row + x + 1] : EGOSGM_INVALID_DISPARITY;
    int begin = is_connected(left, d, max_difference) ? begin_before : x;
#if ROW_GROUP > 1
    begins[lane] = begin;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int step = 1; step < ROW_GROUP; step *= 2) {
      const int before = lane >= step ? begins[lane - step] : 0;
      barrier(CLK_LOCAL_MEM_FENCE);
      begins[lane] = max(begins[lane], before);
      barrier(CLK_LOCAL_MEM_FENCE);
    }
    begin = begins[lane];
    begin_before = begins[ROW_GROUP - 1];
    barrier(CLK_LOCAL_MEM_FENCE);
#else
    begin_before = begin;
#endif
    if (x < size.width) {
      const bool is_valid = d > EGOSGM_INVALID_DISPARITY;
      runs[row + x] = is_valid ? begin : NO_RUN;
      if (is_valid && !is_connected(d, right, max_difference)) {
        parents[row + begin] = row + begin;
        sizes[row + begin] = x - begin + 1;
      }
    }
  }
}

// The index of the run at column x of a row.
uint run_at(global const ushort* runs, size_t row, int x) { return row + min((int)runs[row + x], x); }

uint root_of(global uint* parents, uint run) {
  for (uint parent = parents[run]; parent < run; parent = parents[run]) {
    parents[run] = min(parents[parent], parent);
    run = parents[run];
  }
  return run;
}

// Hangs the larger root below the smaller one.
void join(global uint* parents, uint a, uint b) {
  a = root_of(parents, a);
  b = root_of(parents, b);
  parents[max(a, b)] = min(a, b);
}

// Joins each row of a strip with the one above; the strip's own runs are touched by no other work-item. A work-item a
// strip and view. Sixteen pixels at a time: few of them join what their left neighbour has not joined before them.
COMPILED_ONCE void join_strips_row(const WorkItem at, const ImageSize size, const float max_difference,
                                   const int strip_rows, global const float* disparity, global const ushort* runs,
                                   global uint* parents) {
  const int strip = at.x;
  const int view = at.y;
  const int end = min((strip + 1) * strip_rows, size.height);
  for (int y = strip * strip_rows + 1; y < end; ++y) {
    const size_t row = ((size_t)view * size.height + y) * size.width;
    const size_t above = row - size.width;
    int x = 0;
    if (is_connected(disparity[row], disparity[above], max_difference)) join(parents, row, above);
    for (x = 1; x + 16 <= size.width; x += 16) {
      const int16 joins =
          are_connected(vload16(0, disparity + row + x), vload16(0, disparity + above + x), max_difference);
      const int16 left_joins =
          are_connected(vload16(0, disparity + row + x - 1), vload16(0, disparity + above + x - 1), max_difference);
      const short16 same = load_runs(runs + row + x) == load_runs(runs + row + x - 1) &
                           load_runs(runs + above + x) == load_runs(runs + above + x - 1);
      for (uint left = bits_of(joins & ~(left_joins & convert_int16(same))); left != 0; left &= left - 1) {
        const int lane = x + lowest_bit(left);
        join(parents, run_at(runs, row, lane), run_at(runs, above, lane));
      }
    }
    for (; x < size.width; ++x) {
      if (is_connected(disparity[row + x], disparity[above + x], max_difference)) {
        join(parents, run_at(runs, row, x), run_at(runs, above, x));
      }
    }
  }
}

KERNEL void join_strips(const ImageSize size, const float max_difference, const int strip_rows,
                        global const float* disparity, global const ushort* runs, global uint* parents) {
  join_strips_row(THIS_WORK_ITEM, size, max_difference, strip_rows, disparity, runs, parents);
}

uint root_now(volatile global uint* parents, uint run) {
  for (uint parent = atomic_or(&parents[run], 0u); parent < run; parent = atomic_or(&parents[run], 0u)) run = parent;
  return run;
}

// Joins the first row of each strip but the first with the one above. A work-item a pixel of such rows.
KERNEL void join_seams(const ImageSize size, const float max_difference, const int strip_rows,
                       global const float* disparity, global const ushort* runs, volatile global uint* parents) {
  const int x = get_global_id(0);
  const int y = (get_global_id(1) + 1) * strip_rows;
  const int view = get_global_id(2);
  if (x >= size.width || y >= size.height) return;

  const size_t row = ((size_t)view * size.height + y) * size.width;
  const size_t above = row - size.width;
  if (!is_connected(disparity[row + x], disparity[above + x], max_difference)) return;
  const int run = runs[row + x];
  const int run_above = runs[above + x];
  if (x > 0 && runs[row + x - 1] == run && runs[above + x - 1] == run_above &&
      is_connected(disparity[row + x - 1], disparity[above + x - 1], max_difference)) {
    return;  // the pixel to the left joins the same two
  }
  // The larger root is hung below the smaller one; if another work-item has hung it elsewhere meanwhile, that is joined
  // next.
  uint a = row + min(run, x);
  uint b = above + min(run_above, x);
  while (true) {
    a = root_now(parents, a);
    b = root_now(parents, b);
    if (a == b) break;
    const uint larger = max(a, b);
    const uint smaller = min(a, b);
    const uint parent = atomic_min(&parents[larger], smaller);
    if (parent >= larger) break;
    a = parent;
    b = smaller;
  }
}

// Bit i is set where a run begins at x + i, of the PIXELS pixels from x on.
uint beginnings(global const ushort* runs, int x, int width) {
  uint bits = 0;
#if PIXELS > 1
  if (x + PIXELS <= width) {
    const ushort16 columns = (ushort)x + (ushort16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const short16 begins = load_runs(runs + x) == columns;
    return bits_of(convert_int16(begins));
  }
#endif
  for (int i = 0; i < PIXELS && x + i < width; ++i) bits |= (runs[x + i] == x + i ? 1u : 0u) << i;
  return bits;
}

// Adds every run to its root. Only roots are added to, and only others are read.
COMPILED_ONCE void measure_row(const WorkItem at, const ImageSize size, global const ushort* runs,
                               global const uint* parents, global uint* roots, volatile global uint* sizes) {
  const int y = at.y;
  const int view = at.view;
  const int width = size.width;
  const size_t row = ((size_t)view * size.height + y) * size.width;
  FOR_PIXELS(x, width) {
    for (uint left = beginnings(runs + row, x, width); left != 0; left &= left - 1) {
      const size_t run = row + x + lowest_bit(left);
      uint root = run;
      while (parents[root] < root) root = parents[root];
      roots[run] = root;
      if (root != run) atomic_add(&sizes[root], sizes[run]);
    }
  }
}

KERNEL void measure(const ImageSize size, global const ushort* runs, global const uint* parents, global uint* roots,
                    volatile global uint* sizes) {
  measure_row(THIS_WORK_ITEM, size, runs, parents, roots, sizes);
}

COMPILED_ONCE void drop_row(const WorkItem at, const ImageSize size, const uint max_size, global const ushort* runs,
                            global const uint* roots, global const uint* sizes, global float* disparity) {
  const int y = at.y;
  const int view = at.view;
  const int width = size.width;
  const size_t row = ((size_t)view * size.height + y) * size.width;
  FOR_PIXELS(x, width) {
    for (uint left = beginnings(runs + row, x, width); left != 0; left &= left - 1) {
      const int run = x + lowest_bit(left);
      if (sizes[min((size_t)roots[row + run], row + run)] > max_size) continue;
      for (int i = run; i < size.width && runs[row + i] == run; ++i) disparity[row + i] = EGOSGM_INVALID_DISPARITY;
    }
  }
}

KERNEL void drop(const ImageSize size, const uint max_size, global const ushort* runs, global const uint* roots,
                 global const uint* sizes, global float* disparity) {
  drop_row(THIS_WORK_ITEM, size, max_size, runs, roots, sizes, disparity);
}
