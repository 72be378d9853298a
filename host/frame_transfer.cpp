// SPDX-License-Identifier: Apache-2.0
#include "host/frame_transfer.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
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
void copy_rows(const std::vector<Source>& staged, const MapView<T>& map, Convert&& convert) {
  if (!map.data) return;
  for (int y = 0; y < map.height; ++y) {
    T* row = reinterpret_cast<T*>(reinterpret_cast<char*>(map.data) + y * map.stride_bytes);
    const Source* from = staged.data() + static_cast<std::size_t>(y) * map.width;
    std::transform(from, from + map.width, row, convert);
  }
}

void copy_rows(const std::vector<float>& staged, const MapView<float>& map) {
  copy_rows(staged, map, [](float value) { return value; });
}

void fill_rows(float value, const MapView<float>& map) {
  if (!map.data) return;
  for (int y = 0; y < map.height; ++y) {
    float* row = reinterpret_cast<float*>(reinterpret_cast<char*>(map.data) + y * map.stride_bytes);
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

FrameTransfer::FrameTransfer(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range)
    : context_((context.enter("FrameTransfer"), context)),
      size_(size),
      range_(range),
      images_{ocl::Buffer<cl_uchar>(context, 2 * 2 * pixel_count(size)), PixelType::kU8},
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
  validate_map("predicted", outputs.predicted, size_);
  validate_map("predicted_variance", outputs.predicted_variance, size_);
  validate_map("measured", outputs.measured, size_);
  validate_map("measured_variance", outputs.measured_variance, size_);
  validate_map("search_width", outputs.search_width, size_);
}

const FrameImages& FrameTransfer::upload(const ImageView& left, const ImageView& right) {
  context_.enter("upload");
  images_.type = left.type;
  const std::size_t row_bytes = static_cast<std::size_t>(size_.width) * bytes_per_pixel(left.type);
  staged_images_.resize(2 * row_bytes * size_.height);
  cl_uchar* to = staged_images_.data();
  for (const ImageView* image : {&left, &right}) {
    for (int y = 0; y < size_.height; ++y, to += row_bytes) {
      std::memcpy(to, static_cast<const char*>(image->data) + y * image->stride_bytes, row_bytes);
    }
  }
  cl::Event done;
  context_.queue().enqueueWriteBuffer(images_.pixels.get(), CL_FALSE, 0, staged_images_.size(), staged_images_.data(),
                                      nullptr, &done);
  context_.record(done);
  return images_;
}

template <typename T>
void FrameTransfer::fetch(const ocl::Buffer<T>& buffer, std::size_t first, std::size_t count, std::vector<T>& staged) {
  staged.resize(count);
  cl::Event done;
  context_.queue().enqueueReadBuffer(buffer.get(), CL_FALSE, first * sizeof(T), count * sizeof(T), staged.data(),
                                     nullptr, &done);
  context_.record(done);
}

void FrameTransfer::fetch_view(const ocl::Buffer<float>& maps, int view, const MapView<float>& wanted,
                               std::vector<float>& staged) {
  if (wanted.data) fetch(maps, view * pixel_count(size_), pixel_count(size_), staged);
}

FrameReport FrameTransfer::download(const StereoMaps& result, const StereoMaps* predicted, const StereoMaps& measured,
                                    const SearchBand& band, const ocl::Buffer<float>& vertical_offset_px,
                                    const FrameOutputs& outputs) {
  context_.enter("download");
  fetch(result.disparity, 0, pixel_count(size_), staged_maps_[0]);  // always: the report counts its valid pixels
  fetch_view(result.variance, EGOSGM_LEFT, outputs.variance, staged_maps_[1]);
  fetch_view(result.disparity, EGOSGM_RIGHT, outputs.right_disparity, staged_maps_[2]);
  fetch_view(result.variance, EGOSGM_RIGHT, outputs.right_variance, staged_maps_[3]);
  if (predicted) {
    fetch_view(predicted->disparity, EGOSGM_LEFT, outputs.predicted, staged_maps_[4]);
    fetch_view(predicted->variance, EGOSGM_LEFT, outputs.predicted_variance, staged_maps_[5]);
  }
  fetch_view(measured.disparity, EGOSGM_LEFT, outputs.measured, staged_maps_[6]);
  fetch_view(measured.variance, EGOSGM_LEFT, outputs.measured_variance, staged_maps_[7]);
  if (outputs.search_width.data) fetch(band.bands(), 0, pixel_count(size_), staged_bands_);
  fetch(band.row_sums(), 0, row_sums_.size(), row_sums_);

  fetch(vertical_offset_px, 0, 1, staged_offset_);

  const auto finished = context_.wait();

  copy_rows(staged_maps_[0], outputs.disparity);
  copy_rows(staged_maps_[1], outputs.variance);
  copy_rows(staged_maps_[2], outputs.right_disparity);
  copy_rows(staged_maps_[3], outputs.right_variance);
  if (predicted) {
    copy_rows(staged_maps_[4], outputs.predicted);
    copy_rows(staged_maps_[5], outputs.predicted_variance);
  } else {
    fill_rows(kInvalidDisparity, outputs.predicted);
    fill_rows(0, outputs.predicted_variance);
  }
  copy_rows(staged_maps_[6], outputs.measured);
  copy_rows(staged_maps_[7], outputs.measured_variance);
  copy_rows(staged_bands_, outputs.search_width,
            [](const shared::Band& b) { return static_cast<std::uint16_t>(b.last - b.first + 1); });

  FrameReport report;
  const double pixels = static_cast<double>(pixel_count(size_)), cells = 2 * pixels * range_.count;
  std::uint64_t searched = 0, computed = 0, predicted_pixels = 0;
  for (std::size_t row = 0; row < row_sums_.size(); ++row) {
    searched += row_sums_[row].searched;
    computed += row_sums_[row].computed;
    if (predicted && row < row_sums_.size() / 2) predicted_pixels += row_sums_[row].predicted;
  }
  report.search_fraction = static_cast<double>(searched) / cells;
  report.computed_fraction = static_cast<double>(computed) / cells;
  report.predicted_fraction = static_cast<double>(predicted_pixels) / pixels;
  report.density = static_cast<double>(std::count_if(staged_maps_[0].begin(), staged_maps_[0].end(),
                                                     [](float d) { return d > kInvalidDisparity; })) /
                   pixels;
  report.vertical_offset_px = staged_offset_[0];
  report.launches =
      static_cast<int>(std::count_if(finished.begin(), finished.end(), [](const auto& f) { return f.is_launch; }));
  report.stages = stage_times(finished);
  return report;
}

}  // namespace egosgm
