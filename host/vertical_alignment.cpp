// SPDX-License-Identifier: Apache-2.0
#include "host/vertical_alignment.h"

#include <algorithm>
#include <vector>

namespace egosgm {
namespace {

// As kernels/vertical_alignment.cl has them.
constexpr int kFirstRow = 4, kRowStride = 4, kSums = 9;
constexpr std::size_t kState = EGOSGM_OFFSET_TERMS + 1;

const cl::Program& build(ocl::Context& context, PixelType type, int row_group) {
  context.enter("VerticalAlignment");
  return context.program("vertical_alignment.cl",
                         ocl::Defines().set("PIXEL_BYTES", type == PixelType::kU8 ? 1 : 2).set("ROW_GROUP", row_group));
}

int sampled_rows(shared::ImageSize size) {
  return std::max(1, (size.height - 2 * kFirstRow + kRowStride - 1) / kRowStride);
}

}  // namespace

VerticalAlignment::VerticalAlignment(ocl::Context& context, shared::ImageSize size,
                                     const VerticalAlignmentOptions& options, int row_group)
    : context_((context.enter("VerticalAlignment"), context)),
      size_(size),
      options_(options),
      row_group_(row_group > 0 ? row_group : ocl::row_group(context)),
      resample_u8_(build(context, PixelType::kU8, row_group_), "resample"),
      resample_u16_(build(context, PixelType::kU16, row_group_), "resample"),
      sum_rows_u8_(build(context, PixelType::kU8, row_group_), "sum_rows"),
      sum_rows_u16_(build(context, PixelType::kU16, row_group_), "sum_rows"),
      update_(build(context, PixelType::kU8, row_group_), "update"),
      aligned_{ocl::Buffer<cl_uchar>(context, options.enabled ? 2 * 2 * pixel_count(size) : 0), PixelType::kU8},
      row_sums_(context, kSums * static_cast<std::size_t>(sampled_rows(size))),
      states_{{context, kState}, {context, kState}, {context, kState}, {context, kState}, {context, kState}} {
  states_[kUnknown].write(context, std::vector<float>(kState));
}

const FrameImages& VerticalAlignment::align(const FrameImages& images) {
  working_ = committed_;
  return realign(images);
}

const FrameImages& VerticalAlignment::realign(const FrameImages& images) {
  applied_ = working_;
  if (working_ == kUnknown) return images;
  context_.enter("VerticalAlignment");
  aligned_.type = images.type;
  ResampleKernel& resample = images.type == PixelType::kU8 ? resample_u8_ : resample_u16_;
  resample(context_, ocl::group_a_row(size_, row_group_), size_, states_[working_], images.pixels, aligned_.pixels);
  return aligned_;
}

void VerticalAlignment::estimate(const FrameImages& aligned, const StereoMaps& measured) {
  if (!options_.enabled) return;
  context_.enter("VerticalAlignment");
  const cl_int rows = sampled_rows(size_);
  SumKernel& sum_rows = aligned.type == PixelType::kU8 ? sum_rows_u8_ : sum_rows_u16_;
  sum_rows(context_, ocl::group_a_row({size_.width, rows}, row_group_, 1), size_, aligned.pixels, measured.disparity,
           row_sums_);
  const int next = free_state();
  update_(context_, ocl::group_a_row({size_.width, 1}, row_group_, 1), size_, rows, options_.gain, row_sums_,
          states_[working_], states_[next]);
  working_ = next;
}

// Neither the committed state nor the kept one, which a frame that fails must leave as they are, nor the applied one,
// which is reported.
int VerticalAlignment::free_state() const {
  State state = kUnknown + 1;
  while (state == committed_ || state == kept_ || state == applied_) ++state;
  return state;
}

}  // namespace egosgm
