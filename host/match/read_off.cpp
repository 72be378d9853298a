// SPDX-License-Identifier: Apache-2.0
#include "host/match/read_off.h"

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context) {
  return context.program("read_off.cl", ocl::Defines().set("PIXELS", ocl::pixels_a_work_item(context)));
}

std::size_t rank_count(shared::ImageSize size, int code_padding) {
  return static_cast<std::size_t>(size.height) * (size.width + 2 * code_padding);
}

}  // namespace

ReadOff::ReadOff(ocl::Context& context, shared::ImageSize size, int code_padding)
    : context_(context),
      size_(size),
      ranks_(context, rank_count(size, code_padding)),
      read_off_(build(context), "read_off") {}

std::size_t ReadOff::bytes(shared::ImageSize size, int code_padding) {
  return rank_count(size, code_padding) * sizeof(cl_uint);
}

void ReadOff::read_off(const shared::SgmParameters& parameters, Measurement& measured) {
  read_off_(context_, ocl::every_pixels(context_, size_, ocl::pixels_a_work_item(context_), /*views=*/1), parameters,
            ranks_, measured.disparity, measured.variance, measured.doubtful);
}

}  // namespace egosgm
