// SPDX-License-Identifier: Apache-2.0
#include "host/banded_sgm.h"

#include <cstdlib>

#include "host/census.h"

namespace egosgm {
namespace {

// Tiles of a wavefront; measured best on two cores (bench/NOTES.md).
constexpr int kTileWidth = 128;
constexpr int kTileHeight = 24;

int ceil_div(int a, int b) { return (a + b - 1) / b; }

std::size_t slot_bytes(shared::ImageSize size, shared::DisparityRange range) {
  const std::size_t slot = static_cast<std::size_t>(SearchBand::max_chunks(range) + 2) * EGOSGM_LANES;
  return 2 * 3 * (static_cast<std::size_t>(size.width) + size.height) * slot;
}

std::size_t cell_bytes(shared::ImageSize size, shared::DisparityRange range) {
  return 2 * pixel_count(size) * SearchBand::max_chunks(range) * EGOSGM_LANES;
}

const cl::Program& build(ocl::Context& context, shared::DisparityRange range, const BandedSgmOptions& options) {
  return context.program("banded_sgm.cl", ocl::Defines()
                                              .set("MAX_CHUNKS", SearchBand::max_chunks(range))
                                              .set("PATHS", options.paths)
                                              .set("CODE_BYTES", 4 * Census::words(options.cost))
                                              .set("COST_SAD", options.cost == MatchingCost::kSad3x3 ? 1 : 0)
                                              .set("COST_SCALE", options.cost == MatchingCost::kCensus9x7 ? 1 : 2)
                                              .set("PARTIAL_CHUNKS", range.count % EGOSGM_LANES != 0)
                                              .set("TILE_WIDTH", kTileWidth)
                                              .set("TILE_HEIGHT", kTileHeight));
}

bool follows_paths(const ocl::Context& context, Scheduling scheduling) {
  if (scheduling != Scheduling::kAutomatic) return scheduling == Scheduling::kPaths;
  return context.device().getInfo<CL_DEVICE_TYPE>() & CL_DEVICE_TYPE_GPU;
}

}  // namespace

BandedSgm::Wavefront::Wavefront(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
                                const BandedSgmOptions& options)
    : slots(context, slot_bytes(size, range)),
      sums(context, cell_bytes(size, range)),
      winners(context, 2 * pixel_count(size)),
      forward(build(context, range, options), "sweep_forward"),
      backward(build(context, range, options), "sweep_backward"),
      refine(build(context, range, options), "refine") {}

BandedSgm::BandedSgm(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
                     const BandedSgmOptions& options, std::optional<BandedSgmPaths::Group> group)
    : context_((context.enter("BandedSgm"), context)),
      size_(size),
      parameters_{size.width,
                  size.height,
                  range.min,
                  range.count,
                  code_padding(range),
                  options.p1,
                  options.s_max,
                  options.variance_floor_px2,
                  options.variance_per_step_px2,
                  options.variance_per_square_px2} {
  if (follows_paths(context, options.scheduling)) {
    paths_.emplace(context, size, range, options, group ? *group : BandedSgmPaths::default_group(context, range));
  } else {
    wavefront_.emplace(context, size, range, options);
  }
}

void BandedSgm::operator()(const ocl::Buffer<cl_uint>& codes, const ocl::Buffer<cl_uchar>& penalties,
                           const SearchBand& band, StereoMaps& measured, int views) {
  context_.enter("BandedSgm");
  if (paths_) {
    (*paths_)(parameters_, codes, penalties, band, measured, views);
  } else {
    sweep(*wavefront_, codes, penalties, band, measured, views);
  }
}

void BandedSgm::sweep(Wavefront& wavefront, const ocl::Buffer<cl_uint>& codes, const ocl::Buffer<cl_uchar>& penalties,
                      const SearchBand& band, StereoMaps& measured, int views) {
  const int tile_rows = ceil_div(size_.height, kTileHeight);
  const int tile_columns = ceil_div(size_.width + kTileHeight, kTileWidth) + 1;
  const int waves = tile_columns + 2 * (tile_rows - 1);
  const ocl::Range tiles{cl::NDRange(tile_rows, views), cl::NDRange(1, 1)};

  wavefront.slots.fill(context_, 255);
  for (cl_int wave = 0; wave < waves; ++wave) {
    wavefront.forward(context_, tiles, parameters_, wave, tile_columns, codes, band.bands(), band.cell_offsets(),
                      penalties, wavefront.slots, wavefront.sums);
  }
  wavefront.slots.fill(context_, 255);
  for (cl_int wave = 0; wave < waves; ++wave) {
    wavefront.backward(context_, tiles, parameters_, wave, tile_columns, codes, band.bands(), band.cell_offsets(),
                       penalties, wavefront.slots, wavefront.sums, wavefront.winners);
  }
  wavefront.refine(context_, ocl::every_pixel(context_, size_, views), parameters_, wavefront.winners,
                   measured.disparity, measured.variance);
}

int BandedSgm::code_padding(shared::DisparityRange range) {
  return std::abs(range.min) + (SearchBand::max_chunks(range) + 1) * EGOSGM_LANES;
}

}  // namespace egosgm
