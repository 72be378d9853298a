// SPDX-License-Identifier: Apache-2.0
// The recurrence of semi-global matching, the one place of it. Costs of a path are kept relative to their minimum:
// L(p, d) = t(d) - min t with t(d) = C(p, d) + min(L(q, d), L(q, d -+ 1) + P1, P2(p, q)), where q is the pixel before p
// on the path. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_RECURRENCE_H
#define EGOSGM_KERNELS_MATCH_RECURRENCE_H

// t(d) - C(p, d), of any vector of disparities: from the costs of q at the same ones (`same`), and at those one below
// and one above. `least`, `sum`: of two vectors; the sum saturates where costs have 8 bits.
#define LEAST_WAY(same, below, above, p1, p2, least, sum) least(least(same, sum(least(below, above), p1)), p2)

// P1 of a step from one matched row to the next, `row_step` further: there a slanted surface's disparity changes by so
// many times as much.
static inline int p1_across_rows(const int p1, const int row_step) { return p1 / row_step; }

#endif
