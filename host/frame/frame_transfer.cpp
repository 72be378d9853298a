// SPDX-License-Identifier: Apache-2.0
#include "host/frame/frame_transfer.h"

#include <algorithm>
#include <cstdint>
#include <cstring>

namespace egosgm {
namespace {

int bytes_per_pixel(PixelType type) { return type == PixelType::kU8 ? 1 : 2; }

template <typename T, typename Source, typename Convert>
void copy_rows(const Source* fetched, const MapView<T>& map, Convert&& convert) {
  if (!map.data) return;
  for (int y = 0; y < map.height; ++y) {
    T* row = reinterpret_cast<T*>(reinterpret_cast<char*>(map.data) + y * map.stride_bytes);
    const Source* from = fetched + static_cast<std::size_t>(y) * map.width;
    std::transform(from, from + map.width, row, convert);
  }
}

template <typename T>
void copy_rows(const T* fetched, const MapView<T>& map) {
  copy_rows(fetched, map, [](T value) { return value; });
}

/// A variance without a disparity means nothing.
void copy_variances(const float* variances, const float* disparities, const MapView<float>& map) {
  for (int y = 0; map.data && y < map.height; ++y) {
    float* row = reinterpret_cast<float*>(reinterpret_cast<char*>(map.data) + y * map.stride_bytes);
    const std::size_t first = static_cast<std::size_t>(y) * map.width;
    std::transform(variances + first, variances + first + map.width, disparities + first, row,
                   [](float p, float d) { return d > kInvalidDisparity ? p : 0.0f; });
  }
}

template <typename T>
void fill_rows(T value, const MapView<T>& map) {
  if (!map.data) return;
  for (int y = 0; y < map.height; ++y) {
    T* row = reinterpret_cast<T*>(reinterpret_cast<char*>(map.data) + y * map.stride_bytes);
    std::fill(row, row + map.width, value);
  }
}

}  // namespace

FrameTransfer::FrameTransfer(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range)
    : context_((context.enter("FrameTransfer"), context)),
      size_(size),
      range_(range),
      images_{ocl::Buffer<cl_uchar>(context, 2 * 2 * pixel_count(size)), PixelType::kU8},
      output_disparity_(context, 2 * pixel_count(size)),
      output_variance_(context, 2 * pixel_count(size)),
      upload_(context, images_.pixels),
      disparity_(context, pixel_count(size)),
      variance_(context, pixel_count(size)),
      right_disparity_(context, pixel_count(size)),
      right_variance_(context, pixel_count(size)),
      row_sums_(2 * static_cast<std::size_t>(size.height)) {}

const FrameImages& FrameTransfer::upload(const ImageView& left, const ImageView& right) {
  context_.enter("upload");
  images_.type = left.type;
  const std::size_t row_bytes = static_cast<std::size_t>(size_.width) * bytes_per_pixel(left.type);
  upload_(2 * row_bytes * size_.height, [&](cl_uchar* to) {
    for (const ImageView* image : {&left, &right}) {
      for (int y = 0; y < size_.height; ++y, to += row_bytes) {
        std::memcpy(to, static_cast<const char*>(image->data) + y * image->stride_bytes, row_bytes);
      }
    }
  });
  context_.let_wait(ocl::Queue::kKernels, upload_.done());
  return images_;
}

void FrameTransfer::fetch(const cl::Buffer& buffer, std::size_t bytes, void* to) {
  context_.queue(ocl::Queue::kDownload).enqueueReadBuffer(buffer, CL_FALSE, 0, bytes, to, nullptr, &scratch_fetched_);
  context_.record(scratch_fetched_, "read", ocl::Queue::kDownload);
}

void FrameTransfer::fetch(const cl::Buffer& buffer, std::size_t bytes, Output output) {
  std::vector<char>& staged = fetched_[static_cast<std::size_t>(output)];
  staged.resize(bytes);
  fetch(buffer, bytes, staged.data());
}

void FrameTransfer::fetch_left(const StereoMaps& maps, Output disparity, Output variance, const Wanted& wanted) {
  const std::size_t bytes = pixel_count(size_) * sizeof(float);
  if (wanted.has(disparity) || wanted.has(variance)) fetch(maps.disparity.get(), bytes, disparity);
  if (wanted.has(variance)) fetch(maps.variance.get(), bytes, variance);
}

void FrameTransfer::fetch_view(const ocl::Buffer<float>& maps, int view, const MapView<float>& wanted,
                               MapReadback& readback) {
  if (wanted.data) readback.fetch(maps, view * pixel_count(size_), pixel_count(size_));
}

void FrameTransfer::download(const FrameOnDevice& frame, const FrameOutputs& outputs) {
  context_.enter("download");
  outputs_ = outputs;
  has_prediction_ = frame.predicted;
  parts_ = frame.parts;
  context_.let_wait(ocl::Queue::kDownload, context_.last_kernel());
  const Wanted wanted = wanted_of(outputs);
  if (frame.predicted) fetch_left(*frame.predicted, Output::kPredicted, Output::kPredictedVariance, wanted);
  fetch_left(frame.measured, Output::kMeasured, Output::kMeasuredVariance, wanted);
  for (const PublishedMap& map : frame.published) fetch(map.values, map.bytes, map.output);
  if (wanted.has(Output::kSearchWidth)) {
    fetch(frame.bands.bands.get(), pixel_count(size_) * sizeof(shared::Band), Output::kSearchWidth);
  }
  row_sums_.resize(static_cast<std::size_t>(frame.matched.count) * size_.height);
  fetch(frame.bands.row_sums.get(), row_sums_.size() * sizeof(shared::RowSum), row_sums_.data());
  fetch(frame.offset.terms.get(), sizeof(float), &vertical_offset_px_);

  disparity_.fetch(frame.result.disparity, 0, pixel_count(size_));  // always: the report counts its valid pixels
  fetch_view(frame.result.variance, EGOSGM_LEFT, outputs.variance, variance_);
  fetch_view(frame.result.disparity, EGOSGM_RIGHT, outputs.right_disparity, right_disparity_);
  fetch_view(frame.result.variance, EGOSGM_RIGHT, outputs.right_variance, right_variance_);
}

void FrameTransfer::give(const OutputText& text, const MapView<float>& view) const {
  const bool is_predicted = text.output == Output::kPredicted || text.output == Output::kPredictedVariance;
  const bool is_variance = text.output == Output::kPredictedVariance || text.output == Output::kMeasuredVariance;
  if (is_predicted && !has_prediction_) return fill_rows(is_variance ? 0.0f : kInvalidDisparity, view);
  switch (text.output) {
    case Output::kDisparity:
      return copy_rows(disparity_.data(), view);
    case Output::kVariance:
      return copy_rows(variance_.data(), view);
    case Output::kRightDisparity:
      return copy_rows(right_disparity_.data(), view);
    case Output::kRightVariance:
      return copy_rows(right_variance_.data(), view);
    case Output::kPredictedVariance:
      return copy_variances(fetched<float>(text.output), fetched<float>(Output::kPredicted), view);
    case Output::kMeasuredVariance:
      return copy_variances(fetched<float>(text.output), fetched<float>(Output::kMeasured), view);
    default:
      copy_rows(fetched<float>(text.output), view);
  }
}

void FrameTransfer::give(const OutputText& text, const MapView<std::uint16_t>& view) const {
  copy_rows(fetched<shared::Band>(text.output), view,
            [](const shared::Band& b) { return static_cast<std::uint16_t>(b.last - b.first + 1); });
  for (int y = 0; y < view.height; ++y) {
    if (y % parts_.row_step == 0) continue;
    auto* row = reinterpret_cast<std::uint16_t*>(reinterpret_cast<char*>(view.data) + y * view.stride_bytes);
    std::fill_n(row, view.width, std::uint16_t{0});
  }
}

void FrameTransfer::give(const OutputText& text, const MapView<std::uint8_t>& view) const {
  copy_rows(fetched<std::uint8_t>(text.output), view);
}

void FrameTransfer::collect(FrameReport& report) const {
  for_each_output(outputs_, [&](const OutputText& text, const auto& view) {
    if (view.data) give(text, view);
  });

  report_matching({size_, range_, row_sums_, parts_, has_prediction_}, report);
  report.density = static_cast<double>(std::count_if(disparity_.data(), disparity_.data() + pixel_count(size_),
                                                     [](float d) { return d > kInvalidDisparity; })) /
                   static_cast<double>(pixel_count(size_));
  report.vertical_offset_px = vertical_offset_px_;
}

void FrameTransfer::release() {
  context_.enter("upload");
  for (MapReadback* readback : {&disparity_, &variance_, &right_disparity_, &right_variance_}) readback->release();
}

}  // namespace egosgm
