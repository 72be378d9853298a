// SPDX-License-Identifier: Apache-2.0
// What the tests of stages share: memory on the device made of values, images made of grey values, comparisons with the
// reference, names of cases.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/reference/present_rows.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/device_maps.h"

namespace egosgm::testing {

inline constexpr float kNone = EGOSGM_INVALID_DISPARITY;

template <typename T>
ocl::Buffer<T> on_device(ocl::Context& context, const std::vector<T>& values) {
  ocl::Buffer<T> buffer(context, values.size());
  buffer.write(context, values);
  return buffer;
}

/// `count` times the value that must not shine through.
template <typename T>
ocl::Buffer<T> on_device(ocl::Context& context, std::size_t count, T earlier) {
  return on_device(context, std::vector<T>(count, earlier));
}

template <typename Greys>
std::vector<cl_uchar> bytes_of(const Greys& greys, PixelType type) {
  std::vector<cl_uchar> bytes;
  for (const int grey : greys) {
    bytes.push_back(static_cast<cl_uchar>(grey));
    if (type == PixelType::kU16) bytes.push_back(static_cast<cl_uchar>(grey >> 8));
  }
  return bytes;
}

template <typename Greys>
FrameImages images_of(ocl::Context& context, const Greys& greys, PixelType type) {
  return {on_device(context, bytes_of(greys, type)), type};
}

/// A value for each block of 4x4 pixels, in the device's padded rows.
template <typename T>
std::vector<T> in_padded_rows(shared::ImageSize size, const std::vector<T>& values) {
  const int columns = (size.width + 3) / 4, stride = (size.width + 15) / 16 * 4;
  std::vector<T> padded(values.size() / columns * stride);
  for (std::size_t i = 0; i < values.size(); ++i) padded[i / columns * stride + i % columns] = values[i];
  return padded;
}

/// Runs a stage on single pixels and on vectors of them: of both views and of the left one alone, of all rows and of
/// every second one. What `run(pixels, views)` gives must be what `twin(row_step)` does, and
/// `before` in a right view that was left alone.
template <typename Run, typename Twin>
void expect_reference(shared::ImageSize size, const HostMaps& before, const Run& run, const Twin& twin) {
  for (const int pixels : {1, 16}) {
    for (const Views& views : {Views::kBoth, Views{2, 2}, Views::kLeft, Views{1, 2}}) {
      SCOPED_TRACE("by " + std::to_string(pixels) + ", " + std::to_string(views.count) + " views, row step " +
                   std::to_string(views.row_step));
      const HostMaps found = run(pixels, views);
      HostMaps expected = twin(views.row_step);
      if (found.variance.empty()) expected.variance.clear();
      if (views.count == 1) expected = left_and_right(expected, before);
      const auto present = [&](const HostMaps& maps) {
        return reference::without_absent_rows(size, views.row_step, maps);
      };
      EXPECT_TRUE(same_maps(present(found), present(expected), size));
    }
  }
}

inline std::string name_of(shared::ImageSize size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}
inline std::string name_of(shared::ImageSize size, PixelType type) {
  return name_of(size) + (type == PixelType::kU8 ? "_8bit" : "_16bit");
}

}  // namespace egosgm::testing
