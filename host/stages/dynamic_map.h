// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/motion.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Marks what moves by itself in the left view: where the last image looks elsewhere as the new one does here, and not
/// at the place to which the camera's motion alone leads; or where the last map contradicts the new one all around.
/// A surface that something nearer hid in the last frame counts only where it is found elsewhere.
class DynamicMap {
 public:
  /// A level is a resolution: both images, and its blocks. Levels share what no later one reads.
  struct Level {
    shared::ImageSize image, blocks;
    ocl::Buffer<cl_ushort> last, current;
    ocl::Buffer<cl_uint> last_codes, current_codes;
    Map disparity;
    ocl::Buffer<cl_int> places, found;
    ocl::Buffer<cl_uchar> costs, marks;

    /// `pixels` is the side of a block.
    Level(ocl::Context& context, shared::ImageSize size, int pixels);
  };
  /// The finest is the first one. Small images have none.
  static std::vector<Level> levels(ocl::Context& context, shared::ImageSize size);

  /// `levels` are overwritten. `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  DynamicMap(ocl::Context& context, shared::ImageSize size, const Calibration& calibration, std::vector<Level> levels,
             int pixels = 0);

  /// The size of an image at half of the resolution.
  static shared::ImageSize half(shared::ImageSize size) { return {size.width / 2, size.height / 2}; }

  /// Keeps the left image for `mark`, at half of the resolution.
  void keep(const FrameImages& images, ocl::Buffer<cl_ushort>& halved);

  /// A frame has the left image that was kept, and the left view's disparities.
  struct Frame {
    const ocl::Buffer<cl_ushort>& halved;
    const Map& disparity;
  };
  /// `marks`: 255 where something moves by itself, else 0; a byte a pixel.
  void mark(const Frame& last, const Frame& current, const Motion& current_from_previous, ocl::Buffer<cl_uchar>& marks);

 private:
  using Size = const shared::ImageSize;
  using Greys = ocl::Buffer<cl_ushort>;
  using Codes = ocl::Buffer<cl_uint>;
  using Bytes = ocl::Buffer<cl_uchar>;
  using Ints = ocl::Buffer<cl_int>;

  ocl::Stage stage_;
  const Calibration calibration_;
  std::vector<Level> levels_;
  ocl::Kernel<Size, const cl_int, const Bytes, Greys> halve_;
  ocl::Kernel<Size, const Greys, const Greys, Greys, Greys> shrink_;
  ocl::Kernel<Size, const Greys, const Greys, Codes, Codes> encode_;
  ocl::Kernel<Size, Size, Size, const cl_int, const shared::DisparityMotion, const Codes, const Codes, const Map,
              const Map, Map, Ints, Bytes>
      compare_;
  ocl::Kernel<Size, const cl_int, const Ints, const Bytes, Ints> find_;
  ocl::Kernel<Size, Size, const cl_int, const Ints, const Bytes, Bytes> vote_;
  ocl::Kernel<Size, Size, const Map, const Map, const Bytes, Bytes> mark_;
};

}  // namespace egosgm
