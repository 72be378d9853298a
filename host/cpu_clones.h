// SPDX-License-Identifier: Apache-2.0
// Loops that are worth a version of their own for CPUs with wider vectors than every x86-64 has. All versions give the
// same bits: contraction is off, and no compiler reorders sums. Every aarch64 has NEON, which the one version uses.
#pragma once

#include <cstddef>  // __GLIBC__

// The C library's loader chooses the version. Sanitizers instrument what it asks, which runs before they are ready.
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define EGOSGM_CPU_CLONES [[gnu::target_clones("avx2", "default")]]
#else
#define EGOSGM_CPU_CLONES
#endif
