// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/banded_sgm_paths.h"
#include "host/stages/maps.h"
#include "host/stages/read_off.h"
#include "host/stages/search_band.h"
#include "host/stages/stripes.h"
#include "host/tuning_defaults.h"

namespace egosgm {

/// Semi-global matching of both views in their bands: disparity and matching variance. Two ways to the same bits:
/// diagonal wavefronts (see kernels/sgm/banded_sgm.cl) and a few work-items a path (see
/// kernels/sgm/banded_sgm_paths.cl).
///
/// Its memory grows with width x height x disparities. Where that is more than the device holds, or than the options
/// allow, the image is matched in horizontal stripes, one after the other in the same memory. Paths then begin
/// kStripeOverlap rows above and below a stripe instead of at the image's edge.
class BandedSgm {
 public:
  /// The size of a wavefront's tile; at most as high as wide. `block_lanes`: disparities that are matched at once, 16
  /// or 32 (see kernels/sgm/block.h); 0: what suits the compiler.
  struct Tile {
    int width = cpu_tuning().tile_width, height = cpu_tuning().tile_height;
    int block_lanes = 0;
    /// Needs of another match with the same program, so that it need not be built twice. A code of one
    /// word stands twice in two.
    int max_chunks = 0, code_words = 0;
  };

  /// Launches of the wavefronts, two sweeps a view, to the middle of the image and from there: one for every wave of
  /// tiles, or one for each half of the way, whose work-items take a sweep each and wait for nobody; or the latter of
  /// one view after the other, in the memory of one. Automatic: the last that leaves no compute unit without a sweep.
  enum class Launches { kAutomatic, kWaves, kSweeps, kSweepsOfAView };

  /// `group`: how paths share work-groups, where they do; by default what suits the device. `tile`, `launches`: where
  /// they do not. Same bits.
  BandedSgm(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
            const BandedSgmOptions& options, std::optional<BandedSgmPaths::Group> group = {});
  BandedSgm(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
            const BandedSgmOptions& options, std::optional<BandedSgmPaths::Group> group, Tile tile,
            Launches launches = Launches::kAutomatic);

  /// Rows around a stripe from which paths come into it.
  static constexpr int kStripeOverlap = 32;
  /// In which the image is matched; one: as a whole.
  const std::vector<Stripe>& stripes() const { return stripes_; }
  /// The rows of all stripes: rows where stripes overlap are matched more than once.
  int matched_rows() const;

  /// Matches `views`. Of the inputs' codes, which Census makes with a padding of `code_padding(range)`, both views' are
  /// read; of penalties and bands, theirs.
  void match(const MatchInputs& image, StereoMaps& measured, Views views);
  /// Matches the left view, and reads the right one's disparities off its sums: half of the work, whole disparities.
  /// REQUIRES: that was prepared.
  void reading_off(const MatchInputs& image, StereoMaps& measured, Views left = Views::kLeft);
  /// Builds and allocates what that needs.
  void prepare_reading_off();

  static int code_padding(shared::DisparityRange range);
  /// Whether it takes a few work-items a path.
  static bool follows_paths(const ocl::Context& context, Scheduling scheduling);

  using ToMiddle =
      ocl::Kernel<const shared::SgmParameters, const cl_int, const cl_int, const ocl::Buffer<cl_uint>,
                  const ocl::Buffer<shared::Band>, const ocl::Buffer<cl_uint>, const ocl::Buffer<shared::RowSum>,
                  const ocl::Buffer<cl_uchar>, ocl::Buffer<cl_uchar>, ocl::Buffer<cl_uchar>>;
  using FromMiddle = ocl::Kernel<const shared::SgmParameters, const cl_int, const cl_int, const ocl::Buffer<cl_uint>,
                                 const ocl::Buffer<shared::Band>, const ocl::Buffer<cl_uint>,
                                 const ocl::Buffer<shared::RowSum>, const ocl::Buffer<cl_uchar>, ocl::Buffer<cl_uchar>,
                                 const ocl::Buffer<cl_uchar>, ocl::Buffer<cl_uint>, Map, Map>;

 private:
  struct Wavefront {
    Wavefront(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
              const BandedSgmOptions& options, Tile tile, int views);

    ocl::Stage stage;
    Tile tile;
    int views;                    // at once
    ocl::Buffer<cl_uchar> slots;  // path costs under way, one row of disparities a path, sweep and view
    ocl::Buffer<cl_uchar> sums;   // of the sweep that comes first, 8 bits a cell
    ToMiddle to_middle;
    FromMiddle from_middle;
  };

  void match_stripes(const MatchInputs& image, StereoMaps& measured, Views views, bool reads_off);
  void match(const MatchInputs& inputs, StereoMaps& measured, Views views, bool reads_off);
  void sweep(const shared::SgmParameters& parameters, const MatchInputs& inputs, StereoMaps& measured, int views);
  ocl::Buffer<cl_uint>& ranks() { return read_off_ ? read_off_->ranks() : no_ranks_; }

  ocl::Context& context_;
  const shared::ImageSize size_;  // of what is matched at once: the image, or a stripe
  const std::vector<Stripe> stripes_;
  const shared::SgmParameters parameters_;
  const Launches launches_;
  std::optional<ReadOff> read_off_;
  ocl::Buffer<cl_uint> no_ranks_;              // in place of ReadOff's
  std::optional<StripeMemory> stripe_memory_;  // where there is more than one
  std::optional<Wavefront> wavefront_;         // one of the two
  std::optional<BandedSgmPaths> paths_;
};

}  // namespace egosgm
