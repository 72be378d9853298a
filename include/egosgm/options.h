// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "egosgm/export.h"

namespace egosgm {

/// Matching cost of a pixel pair: Hamming distance of codes, or the mean absolute difference of a 3x3 window.
enum class MatchingCost { kCensus9x7, kCensus5x5, kSad3x3 };

/// The options' starting point, and the constants of the method.
/// kPaper: the method of Fućek et al. (IFAC 2017), docs/understand/paper.md.
enum class Preset { kDefault, kPaper };

/// The options of a pipeline. Meaning, unit, range and when to change each: list_options, `egosgm run --help` and
/// docs/use/options.md, from one table. Value semantics; not thread-safe.
struct EGOSGM_EXPORT PipelineOptions {
  int disparities;          ///< D: number of disparities; the range is [min_disparity, min_disparity + D) px
  int min_disparity;        ///< least disparity [px], of either sign
  bool temporal;            ///< false: every frame alone, over the full range; nothing of it is left for the next one
  bool track_right;         ///< predict, match and filter the right view too
  bool keep_predicted;      ///< a pixel without a measurement keeps its prediction
  bool coarse_match;        ///< also match at a quarter of the resolution, without the prediction
  bool vertical_alignment;  ///< estimate and remove vertical offsets between the views
  MatchingCost cost;
  int paths;                ///< 4 or 8
  int p1, p2;               ///< penalties of a step of one disparity, and of a larger one
  int max_speckle_px;       ///< regions of at most this size [pixels] are dropped in unpredicted frames; 0: none
  int max_memory_mib;       ///< memory for path sums [MiB]; 0: what the device has
  float left_right_px;      ///< largest difference between the views' disparities [px]
  float search_sigmas;      ///< half-width of a predicted pixel's search [standard deviations],
  float min_half_width_px;  ///< and at least this [px]
  float process_noise_px2;  ///< q: variance that a frame adds to every prediction [px^2] (eq. 6)
  float gate_px;            ///< a larger difference of prediction and measurement is not averaged [px]; 0: no gate
  Preset preset;            ///< chooses the constants of the method, and nothing above

  /// Constants of the method that differ from the preset's, as (name, value): for experiments. They may change or go.
  std::vector<std::pair<std::string, std::string>> constants;

  /// The default preset.
  PipelineOptions();
  /// Fućek et al. (IFAC 2017), and nothing that goes beyond them. docs/understand/paper.md goes through it step by
  /// step, and says what they leave open.
  static PipelineOptions paper();

  /// Throws InvalidArgument, naming the option, its value and what is allowed.
  void validate() const;
};

}  // namespace egosgm
