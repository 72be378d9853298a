// SPDX-License-Identifier: Apache-2.0
// A vector as wide as a CPU's registers: 32 lanes of 8 bits are no type of OpenCL C, but one of the compilers that are
// built on clang. Others take 16, and so do those that go by SPIR-V, whose vectors end there: it has no name for a
// wider one, and its translator ends the process. OpenCL C only.
#ifndef EGOSGM_KERNELS_BLOCK_H
#define EGOSGM_KERNELS_BLOCK_H

// The host may choose, 16 or 32.
#ifndef BLOCK
#if defined(__clang__) && defined(__AVX2__)
#define BLOCK 32
#else
#define BLOCK 16
#endif
#endif

#if BLOCK == 32
#if !defined(__clang__) || defined(__SPIR__) || defined(__SPIRV__)
#error "BLOCK: 16, as this compiler has no vectors of 32 lanes"
#endif

typedef uchar Block __attribute__((ext_vector_type(32)));
typedef ushort Ushorts __attribute__((ext_vector_type(32)));
#define BLOCK_LANE                                                                                                   \
  ((Block)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, \
           29, 30, 31))
#define USHORTS_OF(block) __builtin_convertvector(block, Ushorts)
#define BLOCK_OF(ushorts) __builtin_convertvector(ushorts, Block)
#define FIRST_VECTOR(block) ((block).lo)
#define SECOND_VECTOR(block) ((block).hi)
#define LEAST_OF_VECTORS(block) min((block).lo, (block).hi)

// Each lane's neighbour; beside the block lies nothing.
#define LANES_BELOW(block)                                                                                           \
  __builtin_shufflevector(block, (Block)(255), 32, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, \
                          19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30)
#define LANES_ABOVE(block)                                                                                            \
  __builtin_shufflevector(block, (Block)(255), 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, \
                          21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31, 32)

// In forms that clang turns into one instruction.
static inline Block least_of(const Block a, const Block b) { return a < b ? a : b; }
static inline Block saturated_sum(const Block a, const Block b) {
  const Block sum = a + b;
  return sum < a ? (Block)(255) : sum;
}

#else

typedef uchar16 Block;
typedef ushort16 Ushorts;
#define BLOCK_LANE ((Block)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#define USHORTS_OF(block) convert_ushort16(block)
#define BLOCK_OF(ushorts) convert_uchar16(ushorts)
#define FIRST_VECTOR(block) (block)
#define SECOND_VECTOR(block) (block)
#define LEAST_OF_VECTORS(block) (block)

static inline Block least_of(const Block a, const Block b) { return min(a, b); }
static inline Block saturated_sum(const Block a, const Block b) { return add_sat(a, b); }

#endif

// (a + b + 1) / 2 in the form that compilers turn into one instruction; rhadd goes a longer way (PoCL 3.1).
static inline Block mean_of(const Block a, const Block b) {
  return BLOCK_OF((USHORTS_OF(a) + USHORTS_OF(b) + (Ushorts)(1)) >> (Ushorts)(1));
}

#endif
