// SPDX-License-Identifier: Apache-2.0
#include "host/frame/frame_transfer.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <string>

#include "egosgm/error.h"

namespace egosgm {
namespace {

constexpr int kMaxSide = 16384;

int bytes_per_pixel(PixelType type) { return type == PixelType::kU8 ? 1 : 2; }

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

void validate_image(const char* name, const ImageView& image, shared::ImageSize size) {
  const std::string view = std::string(name) + " image: ";
  if (!image.data) throw InvalidArgument(view + "no data: give a pointer to its pixels");
  if (image.width != size.width || image.height != size.height) {
    throw InvalidArgument(view + size_text(image.width, image.height) + ", the pipeline was built for " +
                          size_text(size.width, size.height) + ": build another pipeline for another size");
  }
  if (image.type != PixelType::kU8 && image.type != PixelType::kU16)
    throw InvalidArgument(view + "unknown pixel type: give kU8 or kU16");
  const std::int64_t row = static_cast<std::int64_t>(image.width) * bytes_per_pixel(image.type);
  if (image.height > 1 && std::abs(static_cast<std::int64_t>(image.stride_bytes)) < row) {
    throw InvalidArgument(view + "a stride of " + std::to_string(image.stride_bytes) +
                          " bytes is shorter than a row of " + std::to_string(row));
  }
}

template <typename T>
void validate_map(const char* name, const MapView<T>& map, shared::ImageSize size) {
  if (!map.data) return;
  if (map.width != size.width || map.height != size.height) {
    throw InvalidArgument(std::string("output ") + name + ": " + size_text(map.width, map.height) +
                          ", the pipeline was built for " + size_text(size.width, size.height) +
                          ": give a map of that size");
  }
  const std::int64_t row = static_cast<std::int64_t>(map.width) * sizeof(T);
  if (map.height > 1 && std::abs(static_cast<std::int64_t>(map.stride_bytes)) < row) {
    throw InvalidArgument(std::string("output ") + name + ": a stride of " + std::to_string(map.stride_bytes) +
                          " bytes is shorter than a row of " + std::to_string(row));
  }
}

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

template <typename T>
void fill_rows(T value, const MapView<T>& map) {
  if (!map.data) return;
  for (int y = 0; y < map.height; ++y) {
    T* row = reinterpret_cast<T*>(reinterpret_cast<char*>(map.data) + y * map.stride_bytes);
    std::fill(row, row + map.width, value);
  }
}

std::vector<StageTime> stage_times(const std::vector<ocl::Context::Finished>& finished) {
  std::vector<StageTime> stages;
  for (const auto& command : finished) {
    const auto known =
        std::find_if(stages.begin(), stages.end(), [&](const StageTime& s) { return s.stage == command.stage; });
    if (known == stages.end()) {
      stages.push_back({command.stage, command.ms});
    } else {
      known->ms += command.ms;
    }
  }
  return stages;
}

}  // namespace

void report_stages(const std::vector<ocl::Context::Finished>& finished, FrameReport& report) {
  report.launches =
      static_cast<int>(std::count_if(finished.begin(), finished.end(), [](const auto& f) { return f.is_launch; }));
  report.stages = stage_times(finished);
}

void report_commands(ocl::Context& context, const std::vector<ocl::Command>& commands, FrameReport& report) {
  const std::vector<ocl::Context::Times> times = context.times_of(commands);
  for (std::size_t i = 0; i < commands.size(); ++i) {
    report.commands.push_back({commands[i].stage, commands[i].name, commands[i].queue, times[i].queued,
                               times[i].submitted, times[i].started, times[i].ended});
  }
}

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

void FrameTransfer::validate_size(int width, int height) {
  if (width >= 1 && height >= 1 && width <= kMaxSide && height <= kMaxSide) return;
  throw InvalidArgument("image size " + size_text(width, height) + ": choose 1x1 to " + size_text(kMaxSide, kMaxSide));
}

void FrameTransfer::validate(const ImageView& left, const ImageView& right, const FrameOutputs& outputs) const {
  validate_image("left", left, size_);
  validate_image("right", right, size_);
  if (left.type != right.type)
    throw InvalidArgument("left and right image differ in type: give both with 8 or both with 16 bits");
  validate_map("disparity", outputs.disparity, size_);
  validate_map("variance", outputs.variance, size_);
  validate_map("right_disparity", outputs.right_disparity, size_);
  validate_map("right_variance", outputs.right_variance, size_);
  validate_map("predicted", outputs.debug.predicted, size_);
  validate_map("predicted_variance", outputs.debug.predicted_variance, size_);
  validate_map("measured", outputs.debug.measured, size_);
  validate_map("measured_variance", outputs.debug.measured_variance, size_);
  validate_map("search_width", outputs.debug.search_width, size_);
  validate_map("dynamic", outputs.debug.dynamic, size_);
  validate_map("reason", outputs.reason, size_);
}

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
    fetch_left(frame.predicted->disparity, outputs.debug.predicted.data, predicted_);
    fetch_left(frame.predicted->variance, outputs.debug.predicted_variance.data, predicted_variance_);
  }
  fetch_left(frame.measured.disparity, outputs.debug.measured.data, measured_);
  fetch_left(frame.measured.variance, outputs.debug.measured_variance.data, measured_variance_);
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

double FrameTransfer::matched_cells() const {
  const std::size_t views = row_sums_.size() / size_.height;
  std::uint64_t cells = parts_.coarse_cells;
  for (std::size_t view = 0; view < views; ++view) {
    for (const Stripe& stripe : *parts_.stripes) {
      const auto first = row_sums_.begin() + static_cast<std::ptrdiff_t>(view * size_.height + stripe.first_row);
      cells = std::accumulate(first, first + stripe.rows, cells,
                              [](std::uint64_t sum, const shared::RowSum& row) { return sum + row.cells; });
    }
  }
  return static_cast<double>(parts_.passes) * static_cast<double>(cells);
}

void FrameTransfer::collect(FrameReport& report) const {
  copy_rows(disparity_.data(), outputs_.disparity);
  copy_rows(variance_.data(), outputs_.variance);
  copy_rows(right_disparity_.data(), outputs_.right_disparity);
  copy_rows(right_variance_.data(), outputs_.right_variance);
  if (has_prediction_) {
    copy_rows(predicted_.data(), outputs_.debug.predicted);
    copy_rows(predicted_variance_.data(), outputs_.debug.predicted_variance);
  } else {
    fill_rows(kInvalidDisparity, outputs_.debug.predicted);
    fill_rows(0.0f, outputs_.debug.predicted_variance);
  }
  copy_rows(measured_.data(), outputs_.debug.measured);
  copy_rows(measured_variance_.data(), outputs_.debug.measured_variance);
  copy_rows(dynamic_.data(), outputs_.debug.dynamic);
  copy_rows(reasons_.data(), outputs_.reason);
  copy_rows(bands_.data(), outputs_.debug.search_width,
            [](const shared::Band& b) { return static_cast<std::uint16_t>(b.last - b.first + 1); });

  const double pixels = static_cast<double>(pixel_count(size_));
  const double cells = static_cast<double>(row_sums_.size()) * size_.width * range_.count;
  std::uint64_t predicted_pixels = 0;
  for (int y = 0; has_prediction_ && y < size_.height; ++y) predicted_pixels += row_sums_[y].predicted;
  const std::uint32_t whole_row =
      static_cast<std::uint32_t>(size_.width * SearchBand::max_chunks(range_)) * EGOSGM_LANES;
  report.searched_everything = std::all_of(row_sums_.begin(), row_sums_.end(),
                                           [&](const shared::RowSum& row) { return row.cells == whole_row; });
  report.search_fraction = matched_cells() / cells;
  report.predicted_fraction = static_cast<double>(predicted_pixels) / pixels;
  report.density = static_cast<double>(std::count_if(disparity_.data(), disparity_.data() + pixel_count(size_),
                                                     [](float d) { return d > kInvalidDisparity; })) /
                   pixels;
  report.vertical_offset_px = vertical_offset_px_[0];
}

void FrameTransfer::release() {
  context_.enter("upload");
  for (MapReadback* readback : {&disparity_, &variance_, &right_disparity_, &right_variance_}) readback->release();
}

}  // namespace egosgm
