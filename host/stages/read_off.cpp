// SPDX-License-Identifier: Apache-2.0
#include "host/stages/read_off.h"

namespace egosgm {
namespace {

std::size_t rank_count(shared::ImageSize size, int code_padding) {
  return static_cast<std::size_t>(size.height) * (size.width + 2 * code_padding);
}

}  // namespace

ReadOff::ReadOff(ocl::Context& context, shared::ImageSize size, int code_padding)
    : stage_(context, "BandedSgm", "read_off.cl", size),
      ranks_(context, rank_count(size, code_padding)),
      read_off_(stage_, "read_off") {}

std::size_t ReadOff::bytes(shared::ImageSize size, int code_padding) {
  return rank_count(size, code_padding) * sizeof(cl_uint);
}

void ReadOff::read_off(const shared::SgmParameters& parameters, StereoMaps& measured) {
  const ocl::Range right = ocl::every_pixels(stage_.enter(), stage_.size(), stage_.pixels(), /*views=*/1);
  stage_.launch(read_off_, right, parameters, ranks_, measured.disparity, measured.variance);
}

}  // namespace egosgm
