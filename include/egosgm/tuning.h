// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/named_options.h"

namespace egosgm {

/// The scheduling of BandedSgm's paths: diagonal wavefronts of tiles (CPUs, FPGAs) or a work-group a path (GPUs).
enum class Scheduling { kAutomatic, kWavefront, kPaths };

/// Sizes that decide how fast a device is, and change no bit of a result. 0, kAutomatic: what suits the device's class.
struct EGOSGM_EXPORT Tuning {
  Scheduling scheduling = Scheduling::kAutomatic;
  int tile_width = 0;          // BandedSgm in wavefronts: columns of a tile, 16 to 1024,
  int tile_height = 0;         // and rows, at most as many
  int block_lanes = 0;         // and disparities matched at once, 16 or 32
  int path_lanes = 0;          // BandedSgm on paths: work-items that share a path, a power of two,
  int path_lines = 0;          // and paths that share a work-group of at most 256
  int warp_band_rows = 0;      // ForwardWarp on CPUs: rows of the target that a work-item fills
  int speckle_strip_rows = 0;  // SpeckleRemoval on CPUs: rows that a work-item joins
  int row_group = 0;           // work-items that share a row in SearchBand, SpeckleRemoval and VerticalAlignment

  /// Throws InvalidArgument, naming the size, its value and what is allowed.
  void validate() const;
};

/// All of them by name, in the order above.
EGOSGM_EXPORT std::vector<NamedOption> list_tuning(const Tuning& tuning);

/// Sets one. Throws InvalidArgument for a name that does not exist or a value that does not parse.
EGOSGM_EXPORT void set_tuning(Tuning& tuning, std::string_view name, std::string_view value);

}  // namespace egosgm
