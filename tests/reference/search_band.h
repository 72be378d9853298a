// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "host/method_options.h"
#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

struct SearchBands {
  std::vector<shared::Band> bands;
  std::vector<cl_uint> cell_offsets;
  std::vector<shared::RowSum> row_sums;
};

/// `coarse`: what reference::coarse_match gives.
SearchBands search_band(shared::ImageSize size, shared::DisparityRange range, const SearchBandOptions& options,
                        const testing::HostMaps& predicted, const std::vector<float>& coarse = {}, cl_int row_step = 1);
SearchBands full_range(shared::ImageSize size, shared::DisparityRange range, const std::vector<float>& predicted = {});

}  // namespace egosgm::reference
