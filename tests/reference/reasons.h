// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "host/method_options.h"
#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// What Reasons reads. Without a prediction `warped` and `hidden` are empty.
struct ReasonInputs {
  std::vector<int> images;
  int white = 255;                   // the largest grey value
  float grey_step = 1;               // of values, a level of 8 bits
  std::vector<std::uint32_t> codes;  // as kernels/stages/census.cl lays them out, with `code_padding`
  int code_padding = 0;
  std::vector<float> warped;
  std::vector<std::uint8_t> hidden;
  int row_step = 1;                         // every so many-th row was predicted, measured and fused
  std::vector<float> consistent, measured;  // before and after speckles were dropped
  testing::HostMaps belief;
  std::vector<std::uint8_t> doubtful;  // of the update; not read without a prediction
  std::vector<std::uint8_t> evidence;  // the same; empty: the method has none
  std::vector<int> block_evidence;     // as block_evidence() has it, of the left view at least
};

std::vector<std::uint8_t> reasons(shared::ImageSize size, const MethodOptions& options, const ReasonInputs& inputs);

}  // namespace egosgm::reference
