// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// An image of every `step`-th row.
inline shared::ImageSize present_size(shared::ImageSize size, int step) {
  return {size.width, (size.height + step - 1) / step};
}

/// These rows of a view, twice: as both views of such an image.
template <typename T>
std::vector<T> present_rows(shared::ImageSize size, int view, int step, const std::vector<T>& maps) {
  std::vector<T> present;
  for (int time = 0; time < 2 && !maps.empty(); ++time) {
    for (int y = 0; y < size.height; y += step) {
      const auto row = maps.begin() + (static_cast<std::ptrdiff_t>(view) * size.height + y) * size.width;
      present.insert(present.end(), row, row + size.width);
    }
  }
  return present;
}

/// Writes the rows of a view that are there, and `none` to its others.
template <typename T>
void place_rows(shared::ImageSize size, int view, int step, const std::vector<T>& present, T none,
                std::vector<T>& maps) {
  for (int y = 0; y < size.height && !present.empty(); ++y) {
    for (int x = 0; x < size.width; ++x) {
      T& value = maps[(static_cast<std::size_t>(view) * size.height + y) * size.width + x];
      value = y % step == 0 ? present[static_cast<std::size_t>(y / step) * size.width + x] : none;
    }
  }
}

/// With `none` in the rows that are not there.
template <typename T>
std::vector<T> without_absent_rows(shared::ImageSize size, int step, std::vector<T> map, T none) {
  for (const int view : {EGOSGM_LEFT, EGOSGM_RIGHT}) {
    place_rows(size, view, step, present_rows(size, view, step, map), none, map);
  }
  return map;
}
inline testing::HostMaps without_absent_rows(shared::ImageSize size, int step, const testing::HostMaps& maps) {
  const auto flags = [&](const std::vector<std::uint8_t>& map) {
    return without_absent_rows(size, step, map, std::uint8_t{0});
  };
  return {without_absent_rows(size, step, maps.disparity, EGOSGM_INVALID_DISPARITY),
          without_absent_rows(size, step, maps.variance, 0.0f), flags(maps.hidden), flags(maps.doubtful),
          flags(maps.evidence)};
}

/// `stage(size, maps)`, to which the next row is the next one that is there.
template <typename Stage>
testing::HostMaps of_present_rows(shared::ImageSize size, int step, const testing::HostMaps& in, const Stage& stage) {
  testing::HostMaps out = stage(size, in);
  for (const int view : {EGOSGM_LEFT, EGOSGM_RIGHT}) {
    if (step == 1) continue;
    const auto rows_of = [&](const auto& map) { return present_rows(size, view, step, map); };
    const testing::HostMaps present = stage(
        present_size(size, step),
        {rows_of(in.disparity), rows_of(in.variance), rows_of(in.hidden), rows_of(in.doubtful), rows_of(in.evidence)});
    place_rows(size, view, step, present.disparity, EGOSGM_INVALID_DISPARITY, out.disparity);
    place_rows(size, view, step, present.variance, 0.0f, out.variance);
    place_rows(size, view, step, present.hidden, std::uint8_t{0}, out.hidden);
  }
  return out;
}

}  // namespace egosgm::reference
