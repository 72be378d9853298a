// SPDX-License-Identifier: Apache-2.0
// The method's constants, each with its unit, in the C that host and kernels compile. What may be chosen is an option
// (include/egosgm/options.h). The CPU references have numbers of their own (tests/reference/method.h).
#ifndef EGOSGM_KERNELS_METHOD_H
#define EGOSGM_KERNELS_METHOD_H

// A point whose depth shrinks to less than this part of itself is as good as behind the camera.
#define EGOSGM_MIN_DEPTH_RATIO 1e-6f
// A predicted variance is cut off here: with a deviation of 1000 px nothing is known.
#define EGOSGM_MAX_VARIANCE_PX2 1e6f

// SearchBand looks at a block's coarse pixels and the ones around them, and believes this many that have a disparity.
#define EGOSGM_COARSE_MIN_COUNT 8
// So many of the least and of the largest of these are taken for mismatches. REQUIRES: less than half of the count.
#define EGOSGM_COARSE_OUTLIERS 2
// Where these are of one surface, as they span no more than one of their pixels, it may lie so much farther [px]:
// beside an outline, nearer surfaces draw the disparities of a small image.
#define EGOSGM_COARSE_FARTHER_PX 3.0f
// A block is of a thin thing where it holds predictions by so much nearer than the blocks EGOSGM_THIN_BLOCKS to the
// left and to the right do [px]. So many blocks above and below it, that thing may go on; every second one is asked.
#define EGOSGM_THIN_JUMP_PX 3.0f
#define EGOSGM_THIN_BLOCKS 2
#define EGOSGM_THIN_REACH 8

// Rows above and below one that is left out (stages/row_interpolation.cl) see one surface where their disparities
// differ by no more than this.
#define EGOSGM_ROWS_AGREE_PX 3.0f

// A doubtful disparity is known to 4 px, so that the next frame searches wide: the least variance where measurement and
// prediction contradict each other.
#define EGOSGM_DOUBTFUL_VARIANCE_PX2 16.0f

// Evidence (stages/evidence.cl) is counted in whole numbers, so many a bit of Hamming distance.
#define EGOSGM_EVIDENCE_UNITS 16
// Distances of the controls from the match [px]: two on each side; at a quarter of the resolution, four.
#define EGOSGM_NEAR_CONTROL 8
#define EGOSGM_FAR_CONTROL 14
#define EGOSGM_COARSE_CONTROLS \
  { -19, -14, -10, -7, 7, 10, 14, 19 }
// The row in the middle of a block is asked, as the codes of neighbouring rows are alike. A pixel of it without a
// disparity has no evidence; one that is asked counts as much as so many of these.
#define EGOSGM_EVIDENCE_WEIGHT 4
// The window, in blocks to all sides; half of a window counts with more than half of its pixels in it, so weighted.
#define EGOSGM_EVIDENCE_RADIUS 2
#define EGOSGM_EVIDENCE_LEAST_COUNT (30 * EGOSGM_EVIDENCE_WEIGHT)
// Rows of what is known of blocks begin at multiples of what a work-item reads of them.
#define EGOSGM_EVIDENCE_STRIDE(width) (((width) + 15) / 16 * (16 / EGOSGM_COARSE))
// The surface of a block: blocks whose grey values at a quarter of the resolution differ from its own by
// no more than so many times the fourth least difference to those around it, and half a grey level of 8 bits. A code
// counts by those of its 62 bits that are of such blocks, where at least so many are.
#define EGOSGM_ALIKE_TIMES 16
#define EGOSGM_ALIKE_LEAST 128
#define EGOSGM_ALIKE_LEAST_BITS 12
// A pixel's evidence is a sum over frames, at most MOST: of what it was, so many 64ths are kept, and a frame adds what
// its images say, less what noise must not reach, or twice that where the coarse match contradicts it. What was chosen
// in this frame alone, and not by the coarse match too, has OF_CHOICE less, as the best of many is better than chance.
// Below 0, the pixel dies; it is confirmed from CONFIRMED on, and given out by itself from TRUSTED on. A match outside
// of the other image cannot be asked: so many 64ths of its evidence are kept.
#define EGOSGM_EVIDENCE_MOST 160
#define EGOSGM_EVIDENCE_KEPT 45
#define EGOSGM_EVIDENCE_KEPT_UNSEEN 58
#define EGOSGM_EVIDENCE_OF_NOISE 24
#define EGOSGM_EVIDENCE_OF_CHOICE 48
#define EGOSGM_EVIDENCE_CONFIRMED 64
// A pixel with less than TRUSTED is published where confirmed pixels on a grid around, to all four sides, differ by no
// more than SAME_SURFACE, and is named flat: the images hardly say that it is there. A measurement that no prediction
// shares counts where LEAST of them are measured as much, but for LONE; COUNT while the camera stands.
#define EGOSGM_EVIDENCE_TRUSTED 96
#define EGOSGM_SUPPORTERS_RADIUS 24
#define EGOSGM_SUPPORTERS_STEP 8
#define EGOSGM_SUPPORTERS_LEAST 1
#define EGOSGM_SUPPORTERS_COUNT 12
#define EGOSGM_LONE_PX 2.0f
#define EGOSGM_SAME_SURFACE_PX 4.0f
// A block without texture: so many times the range of its grey values is less than the largest of them. Labels of
// regions spread so many times, along columns and then along rows.
#define EGOSGM_TEXTURELESS_CONTRAST 12
#define EGOSGM_TEXTURELESS_SPREADS 3
// The coarse match confirms a disparity that differs by no more than one and a half of its pixels, and contradicts
// others: its right view has whole ones.
#define EGOSGM_EVIDENCE_COARSE_PX 6.0f

// OutputVariance: the filter's and the measurement's variance, each cut, at every fourth pixel around; the sum of two
// second differences of disparities, each cut, at every pixel nearer by; and how far the disparities this far off to
// eight sides are from a pixel's own, each cut.
#define EGOSGM_VARIANCE_RADIUS 8
#define EGOSGM_VARIANCE_STEP 4
#define EGOSGM_MAX_MEAN_VARIANCE_PX2 2.0f
#define EGOSGM_ROUGHNESS_RADIUS 3
#define EGOSGM_MAX_ROUGHNESS_PX 1.5f
#define EGOSGM_JUMP_DISTANCE 2
#define EGOSGM_MAX_JUMP_PX 10.0f
// From the weighted sum s of these to an error^2, between what clean streets have and what videos with noise and fine
// structures have: that of a disparity on the right surface, which levels off (half of it at s^2 = HALF), and that of a
// wrong one, EGOSGM_WRONG_SURFACE_PX2 sqrt(s), times its chance (a half at s^5 = HALF).
#define EGOSGM_RIGHT_SURFACE_PX2 0.36f
#define EGOSGM_RIGHT_SURFACE_HALF 0.07f
#define EGOSGM_WRONG_SURFACE_PX2 2.52f
#define EGOSGM_WRONG_SURFACE_HALF 0.8f

// Prediction and measurement differ where they do by more than this.
#define EGOSGM_DIFFERENCE_PX 1.0f
// KalmanUpdate takes the mean innovation of a window of blocks, this many to all sides, for their drift: of every
// second row, where at least so many pixels agree within the gate, most are off to a side by SIDE, and the mean by
// LEAST_DRIFT. Innovations are summed up in such whole steps.
#define EGOSGM_DRIFT_RADIUS 2
#define EGOSGM_DRIFT_ROW_STEP 2
#define EGOSGM_DRIFT_LEAST_COUNT 60
#define EGOSGM_DRIFT_SIDE_PX 0.05f
#define EGOSGM_LEAST_DRIFT_PX 0.1f
#define EGOSGM_DRIFT_STEPS_PER_PX 256.0f

// DynamicMap asks images at a half, a quarter and an eighth of the resolution, in blocks of 2x2 of their pixels: so
// many pixels of the image a side. It asks so many places a side around the one to which the camera's motion leads;
// that one lies from number CENTRE on and before the next.
#define EGOSGM_DYNAMIC_BLOCK 4
#define EGOSGM_DYNAMIC_MAX_BLOCK 16
#define EGOSGM_DYNAMIC_PLACES 8
#define EGOSGM_DYNAMIC_CENTRE 3
// Costs are bits of a code of 24, of the four pixels of a block and of the 3x3 blocks around. The best place is another
// one where it costs so many half bits a pixel less than the camera's, and so many tenths of that at most.
#define EGOSGM_DYNAMIC_GAIN_HALF_BITS 5
#define EGOSGM_DYNAMIC_RATIO_TENTHS 7
// A hidden place counts as if it cost no more than HIDDEN bits. A place that looks different costs DIFFERENT at least.
#define EGOSGM_DYNAMIC_HIDDEN_BITS 5
#define EGOSGM_DYNAMIC_DIFFERENT_BITS 7
// Places are known to sixteenths. At half of the resolution the best place lies 0.8 off at least; LEAST_SQUARE is the
// square of that. So many of 3x3 blocks agree in their best places, to 1.5 in x and y.
#define EGOSGM_DYNAMIC_FINENESS 16
#define EGOSGM_DYNAMIC_LEAST_SQUARE 164
#define EGOSGM_DYNAMIC_AGREES 24
#define EGOSGM_DYNAMIC_VOTES 6
// The last map tells what was hidden and what is new by so many pixels and a part of the disparity. Alone, it
// contradicts the new one by LEAST pixels to MOST and that part, in so many of 5x5 blocks: what differs by more was
// rather uncovered.
#define EGOSGM_DYNAMIC_HIDES_PX 1.0f
#define EGOSGM_DYNAMIC_NEW_PX 1.5f
#define EGOSGM_DYNAMIC_PART 0.05f
#define EGOSGM_DYNAMIC_LEAST_PX 1.0f
#define EGOSGM_DYNAMIC_MOST_PX 3.0f
#define EGOSGM_DYNAMIC_DEPTH_VOTES 22
// A pixel is like a block where their disparities differ by no more than this. Of the blocks that are like it
// and REACH to all sides, one moves for every SHARE that do not: then the pixel is marked.
#define EGOSGM_DYNAMIC_ALIKE_PX 1.0f
#define EGOSGM_DYNAMIC_ALIKE_PART 0.03f
#define EGOSGM_DYNAMIC_REACH 3
#define EGOSGM_DYNAMIC_SHARE 3

// Reasons looks this many pixels to all sides for texture: it is flat where grey values two columns apart differ by
// less than this in the mean, of the 255 levels that the image fills (host/grey_levels.h).
#define EGOSGM_TEXTURE_RADIUS 4
#define EGOSGM_LEAST_CHANGE 2.0f
// A pixel that nothing was warped to was uncovered where what was warped this near in its row lies that far apart.
#define EGOSGM_UNCOVERED_RADIUS 8
#define EGOSGM_UNCOVERED_JUMP_PX 3.0f
// The texture of a block repeats where the codes of a grid of this radius and step around its middle are found again in
// their row, at least so many pixels off, and differ by no more bits in all than those of its match, or than BITS each.
#define EGOSGM_REPEAT_RADIUS 8
#define EGOSGM_REPEAT_STEP 4
#define EGOSGM_LEAST_REPEAT_PX 4
#define EGOSGM_REPEAT_BITS 3

// The disparities of RightMap are whole numbers of such steps.
#define EGOSGM_RIGHT_MAP_STEPS_PER_PX 65536.0f

// The weight of a WeightedMedian's vote falls by the difference of the grey values from this to none. A hole that at
// least so many of eight pixels vote for is filled, with this variance.
#define EGOSGM_VOTE_GREYS 48
#define EGOSGM_FILL_MIN_COUNT 6
#define EGOSGM_FILLED_VARIANCE_PX2 1.0f

// The largest matching cost of MatchingCost::kSad3x3, in grey values: about that of a census, so that path sums fit a
// byte.
#define EGOSGM_MAX_COST 63

// If the right view comes from the left view's sums, a right pixel takes of the left pixels that it may be the one
// with the least rank (sgm/sgm_cells.h). Sums are relative to a pixel's own paths and alone do not tell which of two
// pixels fits better: so many quarters of a pixel's least sum, 510 at most, do not count, and the matching cost counts
// so many times. What is added keeps ranks above 0.
#define EGOSGM_RANK_LEAST_QUARTERS 3
#define EGOSGM_RANK_COSTS 12
#define EGOSGM_RANK_ADDED 384

// VerticalAlignment samples every fourth row and second column, and not so many rows next to the upper and lower
// border, where the resampled image may repeat one.
#define EGOSGM_ALIGNED_BORDER_ROWS 4
#define EGOSGM_ALIGNED_ROW_STRIDE 4
#define EGOSGM_ALIGNED_COLUMN_STRIDE 2
// In grey values of 8 bits: a larger residual is rather a wrong match or an occlusion than an offset; a smaller
// gradient is noise. Fewer samples than this tell nothing.
#define EGOSGM_ALIGNED_MAX_RESIDUAL 12
#define EGOSGM_ALIGNED_MIN_GRADIENT 2
#define EGOSGM_ALIGNED_MIN_SAMPLES 256
// No row is moved by more than this. A frame moves a term by at most this: beyond, the linearisation does not hold.
#define EGOSGM_MAX_OFFSET_PX 2.0f
#define EGOSGM_MAX_OFFSET_STEP_PX 1.0f
// Pulls all terms but the first to 0, as if this share of the samples said so: where they lie in a corner of the image,
// they tell nothing of the others.
#define EGOSGM_OFFSET_PRIOR 0.01f

#endif
