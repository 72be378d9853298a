// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/coarse_match.h"

#include <algorithm>
#include <cmath>

#include "tests/reference/banded_sgm.h"
#include "tests/reference/census.h"
#include "tests/reference/consistency_check.h"
#include "tests/reference/search_band.h"

namespace egosgm::reference {
namespace {

int shrunk(int pixels) { return static_cast<int>(std::ceil(pixels / 4.0)); }

}  // namespace

std::vector<std::uint16_t> shrink(shared::ImageSize size, const std::vector<int>& images, int bits) {
  std::vector<std::uint16_t> coarse;
  for (int view = 0; view < 2; ++view) {
    for (int y = 0; y < shrunk(size.height); ++y) {
      for (int x = 0; x < shrunk(size.width); ++x) {
        double mean = 0;
        for (int i = 0; i < 16; ++i) {
          const int row = std::min(4 * y + i / 4, size.height - 1), column = std::min(4 * x + i % 4, size.width - 1);
          mean += images[(static_cast<std::size_t>(view) * size.height + row) * size.width + column] / 16.0;
        }
        coarse.push_back(static_cast<std::uint16_t>(bits == 8 ? 256 * mean : std::floor(mean)));
      }
    }
  }
  return coarse;
}

std::vector<float> coarse_match(shared::ImageSize size, const MethodOptions& options, const std::vector<int>& images,
                                int bits) {
  const shared::ImageSize coarse{shrunk(size.width), shrunk(size.height)};
  const int first = static_cast<int>(std::floor(options.min_disparity / 4.0));
  const int last = static_cast<int>(std::floor((options.min_disparity + options.disparities - 1) / 4.0));
  BandedSgmOptions sgm = options.banded_sgm;
  sgm.cost = MatchingCost::kCensus5x5;
  sgm.p1 = options.coarse_match.p1;
  sgm.p2 = options.coarse_match.p2;
  sgm.p2_at_edges = options.coarse_match.p2_at_edges;

  const std::vector<std::uint16_t> shrunken = shrink(size, images, bits);
  const auto middle = shrunken.begin() + static_cast<std::ptrdiff_t>(shrunken.size() / 2);
  const std::vector<std::uint64_t> both[2] = {codes(coarse, {shrunken.begin(), middle}, 16, sgm.cost),
                                              codes(coarse, {middle, shrunken.end()}, 16, sgm.cost)};
  std::vector<std::uint16_t> grey = shrunken;
  for (std::uint16_t& value : grey) value /= 256;
  const shared::DisparityRange range{first, last - first + 1};
  const testing::HostMaps matched =
      banded_sgm(coarse, range, sgm, both, grey, full_range(coarse, range).bands, /*reads_off=*/true);
  return consistency_check(coarse, options.coarse_match.max_difference_px, false, matched).disparity;
}

}  // namespace egosgm::reference
