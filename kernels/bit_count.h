// SPDX-License-Identifier: Apache-2.0
// Bits set in each lane of a vector of codes. OpenCL C only.
#ifndef EGOSGM_KERNELS_BIT_COUNT_H
#define EGOSGM_KERNELS_BIT_COUNT_H

// Compilers know this form and use what the device has. A product right behind it would melt into it, and they then do
// not know it any more.
#define REPEATED(Codes, byte) ((Codes)(~(Code)0 / 255 * (byte)))
#define BIT_COUNT(Codes, x)                                                    \
  x -= x >> (Codes)(1) & REPEATED(Codes, 0x55);                                \
  x = (x & REPEATED(Codes, 0x33)) + (x >> (Codes)(2) & REPEATED(Codes, 0x33)); \
  x = (x + (x >> (Codes)(4))) & REPEATED(Codes, 0x0f);                         \
  x = x * REPEATED(Codes, 0x01) >> (Codes)(8 * CODE_BYTES - 8)

#endif
