// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/shared.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// The right view, of which every `right_row_step`-th row is there, as both views of an image of these rows.
inline shared::ImageSize present_size(shared::ImageSize size, int right_row_step) {
  return {size.width, (size.height + right_row_step - 1) / right_row_step};
}

template <typename T>
std::vector<T> present_rows(shared::ImageSize size, int right_row_step, const std::vector<T>& maps) {
  std::vector<T> present;
  for (int view = 0; view < 2 && !maps.empty(); ++view) {
    for (int y = 0; y < size.height; y += right_row_step) {
      const auto row = maps.begin() + static_cast<std::ptrdiff_t>(size.height + y) * size.width;
      present.insert(present.end(), row, row + size.width);
    }
  }
  return present;
}

/// Writes the right view's rows that are there, and `none` to the others.
template <typename T>
void place_rows(shared::ImageSize size, int right_row_step, const std::vector<T>& present, T none,
                std::vector<T>& maps) {
  for (int y = 0; y < size.height && !present.empty(); ++y) {
    for (int x = 0; x < size.width; ++x) {
      T& value = maps[static_cast<std::size_t>(size.height + y) * size.width + x];
      value = y % right_row_step == 0 ? present[static_cast<std::size_t>(y / right_row_step) * size.width + x] : none;
    }
  }
}

/// With `none` in the right view's rows that are not there.
template <typename T>
std::vector<T> without_absent_rows(shared::ImageSize size, int right_row_step, std::vector<T> map, T none) {
  place_rows(size, right_row_step, present_rows(size, right_row_step, map), none, map);
  return map;
}
inline testing::HostMaps without_absent_rows(shared::ImageSize size, int right_row_step,
                                             const testing::HostMaps& maps) {
  const auto flags = [&](const std::vector<std::uint8_t>& map) {
    return without_absent_rows(size, right_row_step, map, std::uint8_t{0});
  };
  return {without_absent_rows(size, right_row_step, maps.disparity, EGOSGM_INVALID_DISPARITY),
          without_absent_rows(size, right_row_step, maps.variance, 0.0f), flags(maps.hidden), flags(maps.doubtful),
          flags(maps.evidence)};
}

/// `stage(size, maps)`, to which the next row is the next one that is there.
template <typename Stage>
testing::HostMaps of_present_rows(shared::ImageSize size, int right_row_step, const testing::HostMaps& in,
                                  const Stage& stage) {
  testing::HostMaps out = stage(size, in);
  if (right_row_step == 1) return out;
  const auto rows_of = [&](const auto& map) { return present_rows(size, right_row_step, map); };
  const testing::HostMaps right = stage(
      present_size(size, right_row_step),
      {rows_of(in.disparity), rows_of(in.variance), rows_of(in.hidden), rows_of(in.doubtful), rows_of(in.evidence)});
  place_rows(size, right_row_step, right.disparity, EGOSGM_INVALID_DISPARITY, out.disparity);
  place_rows(size, right_row_step, right.variance, 0.0f, out.variance);
  place_rows(size, right_row_step, right.hidden, std::uint8_t{0}, out.hidden);
  return out;
}

}  // namespace egosgm::reference
