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

template <typename T>
void FrameTransfer::fetch(const ocl::Buffer<T>& buffer, std::size_t count, std::vector<T>& staged) {
  staged.resize(count);
  context_.queue(ocl::Queue::kDownload)
      .enqueueReadBuffer(buffer.get(), CL_FALSE, 0, count * sizeof(T), staged.data(), nullptr, &scratch_fetched_);
  context_.record(scratch_fetched_, "read", ocl::Queue::kDownload);
}

void FrameTransfer::fetch_left(const ocl::Buffer<float>& maps, bool wanted, Scratch& staged) {
  if (wanted) fetch(maps, pixel_count(size_), staged);
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
  if (frame.predicted) {
    const bool wants_variance = outputs.debug.predicted_variance.data;
    fetch_left(frame.predicted->disparity, outputs.debug.predicted.data || wants_variance, predicted_);
    fetch_left(frame.predicted->variance, wants_variance, predicted_variance_);
  }
  const bool wants_variance = outputs.debug.measured_variance.data;
  fetch_left(frame.measured.disparity, outputs.debug.measured.data || wants_variance, measured_);
  fetch_left(frame.measured.variance, wants_variance, measured_variance_);
  if (frame.dynamic) fetch(*frame.dynamic, pixel_count(size_), dynamic_);
  if (frame.reasons) fetch(*frame.reasons, pixel_count(size_), reasons_);
  if (outputs.debug.search_width.data) fetch(frame.bands.bands, pixel_count(size_), bands_);
  fetch(frame.bands.row_sums, static_cast<std::size_t>(count(frame.matched)) * size_.height, row_sums_);
  fetch(frame.offset.terms, 1, vertical_offset_px_);

  disparity_.fetch(frame.result.disparity, 0, pixel_count(size_));  // always: the report counts its valid pixels
  fetch_view(frame.result.variance, EGOSGM_LEFT, outputs.variance, variance_);
  fetch_view(frame.result.disparity, EGOSGM_RIGHT, outputs.right_disparity, right_disparity_);
  fetch_view(frame.result.variance, EGOSGM_RIGHT, outputs.right_variance, right_variance_);
}

void FrameTransfer::collect(FrameReport& report) const {
  copy_rows(disparity_.data(), outputs_.disparity);
  copy_rows(variance_.data(), outputs_.variance);
  copy_rows(right_disparity_.data(), outputs_.right_disparity);
  copy_rows(right_variance_.data(), outputs_.right_variance);
  if (has_prediction_) {
    copy_rows(predicted_.data(), outputs_.debug.predicted);
    copy_variances(predicted_variance_.data(), predicted_.data(), outputs_.debug.predicted_variance);
  } else {
    fill_rows(kInvalidDisparity, outputs_.debug.predicted);
    fill_rows(0.0f, outputs_.debug.predicted_variance);
  }
  copy_rows(measured_.data(), outputs_.debug.measured);
  copy_variances(measured_variance_.data(), measured_.data(), outputs_.debug.measured_variance);
  copy_rows(dynamic_.data(), outputs_.debug.dynamic);
  copy_rows(reasons_.data(), outputs_.reason);
  copy_rows(bands_.data(), outputs_.debug.search_width,
            [](const shared::Band& b) { return static_cast<std::uint16_t>(b.last - b.first + 1); });

  report_matching({size_, range_, row_sums_, parts_, has_prediction_}, report);
  report.density = static_cast<double>(std::count_if(disparity_.data(), disparity_.data() + pixel_count(size_),
                                                     [](float d) { return d > kInvalidDisparity; })) /
                   static_cast<double>(pixel_count(size_));
  report.vertical_offset_px = vertical_offset_px_[0];
}

void FrameTransfer::release() {
  context_.enter("upload");
  for (MapReadback* readback : {&disparity_, &variance_, &right_disparity_, &right_variance_}) readback->release();
}

}  // namespace egosgm
