// SPDX-License-Identifier: Apache-2.0
// The code of a pixel, which matching compares (census.cl). OpenCL C only.
#ifndef EGOSGM_KERNELS_CODE_H
#define EGOSGM_KERNELS_CODE_H

#ifndef CODE_BYTES
#error "CODE_BYTES: 4 or 8, the size of a code"
#endif

#if CODE_BYTES == 4
typedef uint Code;
typedef uint16 Codes;
#else
typedef ulong Code;
typedef ulong16 Codes;
#endif
typedef struct __attribute__((packed)) {
  Codes codes;
} PackedCodes;

static inline Codes load_codes(global const Code* from) { return ((global const PackedCodes*)from)->codes; }

#endif
