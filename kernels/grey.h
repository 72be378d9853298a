// SPDX-License-Identifier: Apache-2.0
// Grey values of 8 or 16 bits.
#ifndef EGOSGM_KERNELS_GREY_H
#define EGOSGM_KERNELS_GREY_H

#include "shared.h"

#ifndef PIXEL_BYTES
#error "PIXEL_BYTES: 1 or 2, the size of a grey value"
#endif

#if PIXEL_BYTES == 1
typedef uchar Pixel;
typedef uchar16 Pixels;
#define to_8_bit(value) (value)
#else
typedef ushort Pixel;
typedef ushort16 Pixels;
#define to_8_bit(value) ((value) >> 8)
#endif

// vload16 goes byte by byte on some compilers (PoCL 3.1); a packed struct is a plain unaligned access on CPUs. Not for
// GPUs, where work-items take a pixel each: LLVM 19 makes an aligned load of either for NVIDIA's, which faults.
typedef struct __attribute__((packed)) {
  Pixels pixels;
} PackedPixels;

static inline Pixels load_grey(global const Pixel* from) { return ((global const PackedPixels*)from)->pixels; }

#endif
