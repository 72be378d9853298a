// SPDX-License-Identifier: Apache-2.0
// Hints for compilers. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_COMPILER_H
#define EGOSGM_KERNELS_MATCH_COMPILER_H

// Compilers that are made for many CPUs take this one for an older (PoCL as distributions build it). In a function that
// says so, and is not inlined, they count bits in one instruction. Defined by the host where the CPU has it.
#ifdef COUNTS_BITS
#define WITH_BIT_COUNT static __attribute__((noinline, target("avx512vpopcntdq")))
#else
#define WITH_BIT_COUNT static inline
#endif

// The least of eight 16-bit lanes, in the first one: an instruction of x86 that paths wait for, in place of six.
#if defined(__clang__) && defined(__SSE4_1__)
typedef short ShortsOfX86 __attribute__((vector_size(16)));
#define LEAST_OF_WORDS(v) __builtin_astype(__builtin_ia32_phminposuw128(__builtin_astype(v, ShortsOfX86)), ushort8)
#endif

// Functions that must become part of the kernel's loop. Unoptimised code, which oclgrind and valgrind run, needs no
// such thing, and oclgrind does not know what compilers note where they inline.
#ifdef __OPTIMIZE__
#define ALWAYS_INLINE static inline __attribute__((always_inline))
#else
#define ALWAYS_INLINE static inline
#endif

#endif
