// SPDX-License-Identifier: Apache-2.0
#include "host/stages/banded_sgm.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>

#include "egosgm/error.h"
#include "host/stages/census.h"

namespace egosgm {
namespace {

int ceil_div(int a, int b) { return (a + b - 1) / b; }

/// Vectors of two chunks in the larger of kernels/sgm/block.h. One is read, and of a slot one is left, where a vector
/// ends.
constexpr int kBlockVectors = 2;

constexpr int kViews = 2;

std::size_t slot_bytes(shared::ImageSize size, int chunks, int paths, int views) {
  const int vectors = (chunks + 1) / 2;
  const std::size_t slot = static_cast<std::size_t>(vectors + kBlockVectors * 2) * 2 * EGOSGM_LANES;
  const std::size_t slots = (paths / 2 - 1) * (static_cast<std::size_t>(size.width) + size.height);
  return static_cast<std::size_t>(views) * 2 * slots * slot;
}

/// A byte a cell; before them a row that is nobody's (see `sweep_tile`), and behind a chunk, as two are read at once.
std::size_t sum_bytes(shared::ImageSize size, int chunks, int views) {
  const std::size_t pixels = views * pixel_count(size) + size.width;
  return (pixels * chunks + 1) * EGOSGM_LANES;
}

int chunks_of(shared::DisparityRange range, BandedSgm::Tile tile) {
  return std::max(SearchBand::max_chunks(range), tile.max_chunks);
}

int words_of(const BandedSgmOptions& options, BandedSgm::Tile tile) {
  return std::max(Census::words(options.cost), tile.code_words);
}

ocl::Defines defines(const ocl::Context& context, shared::DisparityRange range, const BandedSgmOptions& options,
                     BandedSgm::Tile tile) {
  ocl::Defines defines = sgm_defines(chunks_of(range, tile), words_of(options, tile), options);
  defines.set("PARTIAL_CHUNKS", range.count % (2 * EGOSGM_LANES) != 0)
      .set("TILE_WIDTH", tile.width)
      .set("TILE_HEIGHT", tile.height);
  if (tile.block_lanes > 0) defines.set("BLOCK", tile.block_lanes);
  if (ocl::counts_bits(context)) defines.set("COUNTS_BITS", 1);
  return defines;
}

/// Whether the device has no more compute units than sweeps of `views`, each of a work-item.
bool has_few_units(const ocl::Context& context, int views) {
  return context.device().getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>() <= static_cast<cl_uint>(2 * views);
}

/// Sums of a view that are worth to be kept once in place of twice, for two launches more.
constexpr std::size_t kSparedBytes = std::size_t{16} << 20;

/// The number of views that wavefronts match at once. `bytes`: the sums of one view.
int views_at_once(const ocl::Context& context, BandedSgm::Launches launches, std::size_t bytes) {
  const bool spares = launches == BandedSgm::Launches::kAutomatic ? has_few_units(context, 1) && bytes >= kSparedBytes
                                                                  : launches == BandedSgm::Launches::kSweepsOfAView;
  return spares ? 1 : kViews;
}

/// The device memory of a match.
struct Demand {
  std::uint64_t largest_buffer, total;
};

/// The demand of both views at once, for any number of compute units: stripes, and with them bits, do not depend on
/// that.
Demand demand(const ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
              const BandedSgmOptions& options, int chunks) {
  const bool follows = BandedSgm::follows_paths(context, options.scheduling);
  const std::uint64_t sums = follows ? BandedSgmPaths::most_sum_bytes(size, range) : sum_bytes(size, chunks, kViews);
  const std::uint64_t ranks = ReadOff::bytes(size, BandedSgm::code_padding(range));
  if (follows) return {sums, 4 * sums + ranks};
  const std::uint64_t slots = slot_bytes(size, chunks, options.paths, kViews);
  return {std::max(sums, slots), sums + slots + ranks};
}

std::size_t code_words_a_row(int width, shared::DisparityRange range, MatchingCost cost, BandedSgm::Tile tile) {
  return Census::words(cost, {width, 1}, BandedSgm::code_padding(range), tile.code_words) / 2;
}

/// The number of rows that can be matched at once. A quarter of the memory is left to all else; what stages share can
/// be had again.
int rows_at_once(const ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
                 const BandedSgmOptions& options, BandedSgm::Tile tile) {
  const int chunks = chunks_of(range, tile);
  const std::uint64_t memory = context.device().getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>() / 4 * 3;
  const std::uint64_t allocated = context.allocated_bytes();
  const std::uint64_t device_limit =
      memory - std::min(memory, allocated - std::min(allocated, context.bytes_of_stages()));
  const std::uint64_t chosen = static_cast<std::uint64_t>(options.max_memory_mib) << 20;
  const std::uint64_t total_limit = chosen > 0 ? std::min(chosen, device_limit) : device_limit;
  const auto fits = [&](int rows, std::uint64_t copies) {
    const Demand needs = demand(context, {size.width, rows}, range, options, chunks);
    return needs.largest_buffer <= context.max_allocation_bytes() && needs.total + copies <= total_limit;
  };
  if (fits(size.height, 0)) return size.height;
  const std::size_t words = code_words_a_row(size.width, range, options.cost, tile);
  int rows = size.height;
  while (rows > 0 && !fits(rows, StripeMemory::bytes(size.width, rows, words))) --rows;
  const int least = 3 * BandedSgm::kStripeOverlap;
  if (rows >= least) return fewest_rows(size.height, rows, BandedSgm::kStripeOverlap);
  const auto demand_of = [&](int stripe_rows) {
    Demand needs = demand(context, {size.width, stripe_rows}, range, options, chunks);
    if (stripe_rows < size.height) needs.total += StripeMemory::bytes(size.width, stripe_rows, words);
    return needs;
  };
  int fewest = std::min(size.height, least);
  if (demand_of(size.height).total < demand_of(fewest).total) fewest = size.height;  // it copies nothing
  const Demand needed = demand_of(fewest);
  const bool device_suffices = needed.total <= device_limit && needed.largest_buffer <= context.max_allocation_bytes();
  const std::string mib = std::to_string((needed.total >> 20) + 1);
  const std::string needs = "BandedSgm: a stripe of " + std::to_string(fewest) + " rows needs " + mib + " MiB, ";
  if (device_suffices) {  // so that the option alone is in the way
    throw InvalidArgument(needs + "max_memory_mib allows " + std::to_string(chosen >> 20) + " MiB: raise it to " + mib +
                          " or more, or choose fewer disparities or a smaller image");
  }
  throw DeviceError(CL_MEM_OBJECT_ALLOCATION_FAILURE,
                    needs + "three quarters of the device are " + std::to_string(memory >> 20) +
                        " MiB, of which maps of " + std::to_string(size.width) + "x" + std::to_string(size.height) +
                        " leave " + std::to_string(device_limit >> 20) + " MiB, and buffers of at most " +
                        std::to_string(context.max_allocation_bytes() >> 20) +
                        " MiB: choose fewer disparities, a smaller image or another device");
}

}  // namespace

BandedSgm::Wavefront::Wavefront(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
                                const BandedSgmOptions& options, Tile chosen, int at_once)
    : stage(context, "BandedSgm", "banded_sgm.cl", size, 0, defines(context, range, options, chosen), ocl::Joins::kNo),
      tile(chosen),
      views(at_once),
      slots(context, ocl::Scratch::kOfStage1, slot_bytes(size, chunks_of(range, tile), options.paths, views)),
      sums(context, ocl::Scratch::kOfStage0, sum_bytes(size, chunks_of(range, tile), views)),
      to_middle(stage, "sweep_to_middle"),
      from_middle(stage, "sweep_from_middle") {}

BandedSgm::BandedSgm(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
                     const BandedSgmOptions& options, std::optional<BandedSgmPaths::Group> group)
    : BandedSgm(context, size, range, options, group, Tile()) {}

BandedSgm::BandedSgm(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
                     const BandedSgmOptions& options, std::optional<BandedSgmPaths::Group> group, Tile tile,
                     Launches launches)
    : context_((context.enter("BandedSgm"), context)),
      size_{size.width, rows_at_once(context, size, range, options, tile)},
      stripes_(cut_into_stripes(size.height, size_.height, kStripeOverlap)),
      parameters_{.width = size_.width,
                  .height = size_.height,
                  .min_disparity = range.min,
                  .disparities = range.count,
                  .padding = code_padding(range),
                  .p1 = options.p1,
                  .s_max = options.s_max,
                  .variance_floor = options.variance_floor_px2,
                  .variance_per_step = options.variance_per_step_px2,
                  .variance_per_square = options.variance_per_square_px2,
                  .reads_off = 0,
                  .row_step = 1,
                  .first_view = 0},
      launches_(launches),
      no_ranks_(context, 1) {
  if (follows_paths(context, options.scheduling)) {
    paths_.emplace(context, size_, range, options, group ? *group : BandedSgmPaths::default_group(context, range));
  } else {
    wavefront_.emplace(context, size_, range, options, tile,
                       views_at_once(context, launches, sum_bytes(size_, chunks_of(range, tile), 1)));
  }
  if (stripes_.size() > 1) {
    stripe_memory_.emplace(context, size, range, size_.height, code_words_a_row(size.width, range, options.cost, tile));
  }
}

void BandedSgm::prepare_reading_off() {
  context_.enter("BandedSgm");
  read_off_.emplace(context_, size_, parameters_.padding);
}

void BandedSgm::match(const MatchInputs& image, StereoMaps& measured, Views views) {
  match_stripes(image, measured, views, /*reads_off=*/false);
}

void BandedSgm::reading_off(const MatchInputs& image, StereoMaps& measured, Views left) {
  match_stripes(image, measured, left, /*reads_off=*/true);
}

void BandedSgm::match_stripes(const MatchInputs& image, StereoMaps& measured, Views views, bool reads_off) {
  context_.enter("BandedSgm");
  if (!stripe_memory_) return match(image, measured, views, reads_off);
  for (const Stripe& stripe : stripes_) {
    stripe_memory_->load(image, stripe);
    match(stripe_memory_->inputs(), stripe_memory_->measured(), views, reads_off);
    stripe_memory_->store(stripe, measured);
  }
}

void BandedSgm::match(const MatchInputs& inputs, StereoMaps& measured, Views views, bool reads_off) {
  shared::SgmParameters parameters = parameters_;
  parameters.reads_off = reads_off;
  parameters.row_step = views.row_step;
  if (reads_off) read_off_->clear();
  if (paths_) {
    paths_->match(parameters, inputs, measured, ranks(), views);
  } else {
    const int at_once = std::min(wavefront_->views, views.count);
    for (parameters.first_view = 0; parameters.first_view < views.count; parameters.first_view += at_once) {
      sweep(parameters, inputs, measured, at_once);
    }
  }
  if (reads_off) read_off_->read_off(parameters, measured);
}

void BandedSgm::sweep(const shared::SgmParameters& parameters, const MatchInputs& inputs, StereoMaps& measured,
                      int views) {
  Wavefront& wavefront = *wavefront_;
  const Tile tile = wavefront.tile;
  const int tile_rows = ceil_div(ceil_div(size_.height, 2), tile.height);
  const int tile_columns = ceil_div(size_.width + tile.height, tile.width) + 1;
  const bool is_whole =
      launches_ == Launches::kAutomatic ? has_few_units(context_, views) : launches_ != Launches::kWaves;
  const ocl::Range tiles{cl::NDRange(is_whole ? 1 : tile_rows, views, 2), cl::NDRange(1, 1, 1)};
  const int first_wave = is_whole ? EGOSGM_ALL_TILES : 0;
  const int end_wave = is_whole ? EGOSGM_ALL_TILES + 1 : tile_columns + 2 * (tile_rows - 1);

  wavefront.slots.fill(context_, 255, wavefront.slots.size() / wavefront.views * views);
  for (cl_int wave = first_wave; wave < end_wave; ++wave) {
    wavefront.stage.launch(wavefront.to_middle, tiles, parameters, wave, tile_columns, inputs.codes, inputs.bands.bands,
                           inputs.bands.cell_offsets, inputs.bands.row_sums, inputs.penalties, wavefront.slots,
                           wavefront.sums);
  }
  for (cl_int wave = first_wave; wave < end_wave; ++wave) {
    wavefront.stage.launch(wavefront.from_middle, tiles, parameters, wave, tile_columns, inputs.codes,
                           inputs.bands.bands, inputs.bands.cell_offsets, inputs.bands.row_sums, inputs.penalties,
                           wavefront.slots, wavefront.sums, ranks(), measured.disparity, measured.variance);
  }
}

bool BandedSgm::follows_paths(const ocl::Context& context, Scheduling scheduling) {
  if (scheduling != Scheduling::kAutomatic) return scheduling == Scheduling::kPaths;
  return ocl::is_gpu(context);
}

int BandedSgm::matched_rows() const {
  return std::accumulate(stripes_.begin(), stripes_.end(), 0, [](int sum, const Stripe& s) { return sum + s.rows; });
}

int BandedSgm::code_padding(shared::DisparityRange range) {
  return std::abs(range.min) + (SearchBand::max_chunks(range) + 2 * kBlockVectors) * EGOSGM_LANES;
}

}  // namespace egosgm
