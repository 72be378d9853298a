// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "egosgm/pipeline.h"
#include "host/maps.h"
#include "host/search_band.h"

namespace egosgm {

/// Checks what the caller gave, brings the images to the device and the results back.
class FrameTransfer {
 public:
  FrameTransfer(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range);

  /// Throws InvalidArgument for a size that no pipeline can have.
  static void validate_size(int width, int height);
  /// Throws InvalidArgument, naming the view and the value.
  void validate(const ImageView& left, const ImageView& right, const FrameOutputs& outputs) const;

  /// REQUIRES: what `validate` asks.
  const FrameImages& upload(const ImageView& left, const ImageView& right);

  /// Waits for the frame and fills the outputs, all of them or, if it throws, none. `predicted`: null where there is no
  /// prediction.
  FrameReport download(const StereoMaps& result, const StereoMaps* predicted, const StereoMaps& measured,
                       const SearchBand& band, const ocl::Buffer<float>& vertical_offset_px,
                       const FrameOutputs& outputs);

 private:
  template <typename T>
  void fetch(const ocl::Buffer<T>& buffer, std::size_t first, std::size_t count, std::vector<T>& staged);
  void fetch_view(const ocl::Buffer<float>& maps, int view, const MapView<float>& wanted, std::vector<float>& staged);

  ocl::Context& context_;
  const shared::ImageSize size_;
  const shared::DisparityRange range_;
  FrameImages images_;
  std::vector<cl_uchar> staged_images_;
  std::vector<float> staged_maps_[8];
  std::vector<float> staged_offset_;
  std::vector<shared::Band> staged_bands_;
  std::vector<shared::RowSum> row_sums_;
};

}  // namespace egosgm
