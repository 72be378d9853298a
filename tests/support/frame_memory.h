// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

#include "egosgm/pipeline.h"
#include "kernels/shared.h"
#include "tests/support/compare.h"

namespace egosgm::testing {

/// How rows lie in the caller's memory.
struct Layout {
  int padding = 0;  // after every row: bytes of an image, elements of a map
  bool bottom_up = false;
};

/// A view's image in memory of its own.
class ImageMemory {
 public:
  /// `greys`: of 16 bits; the upper 8 of them are taken for kU8.
  ImageMemory(shared::ImageSize size, const std::vector<int>& greys, int view, PixelType type, Layout layout = {})
      : size_(size), type_(type), bytes_(type == PixelType::kU8 ? 1 : 2), layout_(layout) {
    row_bytes_ = static_cast<std::ptrdiff_t>(size.width) * bytes_ + layout.padding;
    memory_.assign(static_cast<std::size_t>(row_bytes_) * size.height, 0xa5);
    const std::size_t first = static_cast<std::size_t>(view) * size.width * size.height;
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const int value = greys[first + static_cast<std::size_t>(y) * size.width + x];
        const std::uint16_t grey = static_cast<std::uint16_t>(type == PixelType::kU8 ? value >> 8 : value);
        std::memcpy(row(y) + x * bytes_, &grey, bytes_);  // little-endian, as OpenCL devices here are
      }
    }
  }

  ImageView view() const {
    return {const_cast<ImageMemory*>(this)->row(0), size_.width, size_.height,
            layout_.bottom_up ? -row_bytes_ : row_bytes_, type_};
  }

 private:
  std::uint8_t* row(int y) { return memory_.data() + row_bytes_ * (layout_.bottom_up ? size_.height - 1 - y : y); }

  shared::ImageSize size_;
  PixelType type_;
  int bytes_;
  Layout layout_;
  std::ptrdiff_t row_bytes_ = 0;
  std::vector<std::uint8_t> memory_;
};

/// A map in memory of its own, every element of which is `kUntouched` at first.
template <typename T>
class MapMemory {
 public:
  static constexpr T kUntouched = static_cast<T>(12345);

  explicit MapMemory(shared::ImageSize size, Layout layout = {})
      : size_(size), layout_(layout), row_(size.width + layout.padding) {
    memory_.assign(static_cast<std::size_t>(row_) * size.height, kUntouched);
  }

  MapView<T> view() {
    const std::ptrdiff_t stride = static_cast<std::ptrdiff_t>(row_ * sizeof(T));
    return {memory_.data() + index(0, 0), size_.width, size_.height, layout_.bottom_up ? -stride : stride};
  }
  /// Row by row, from top to bottom, without padding.
  std::vector<T> values() const {
    std::vector<T> values;
    for (int y = 0; y < size_.height; ++y) {
      for (int x = 0; x < size_.width; ++x) values.push_back(memory_[index(x, y)]);
    }
    return values;
  }
  bool operator==(const MapMemory& other) const { return memory_ == other.memory_; }
  bool padding_is_untouched() const {
    for (int y = 0; y < size_.height; ++y) {
      for (int x = size_.width; x < row_; ++x) {
        if (memory_[index(x, y)] != kUntouched) return false;
      }
    }
    return true;
  }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(layout_.bottom_up ? size_.height - 1 - y : y) * row_ + x;
  }

  shared::ImageSize size_;
  Layout layout_;
  int row_;
  std::vector<T> memory_;
};

/// Memory for all that a frame can give.
struct OutputMemory {
  MapMemory<float> disparity, variance = disparity, right_disparity = disparity, right_variance = disparity,
                              predicted = disparity, predicted_variance = disparity, measured = disparity,
                              measured_variance = disparity;
  MapMemory<std::uint16_t> search_width;
  MapMemory<std::uint8_t> dynamic, reason = dynamic;

  explicit OutputMemory(shared::ImageSize size, Layout layout = {})
      : disparity(size, layout), search_width(size, layout), dynamic(size, layout) {}

  bool operator==(const OutputMemory&) const = default;

  FrameOutputs views() {
    return {disparity.view(),
            variance.view(),
            reason.view(),
            right_disparity.view(),
            right_variance.view(),
            {predicted.view(), predicted_variance.view(), measured.view(), measured_variance.view(),
             search_width.view(), dynamic.view()}};
  }
  /// Calls `each` with the name of every map and the member that holds it.
  template <typename Each>
  static void for_each_map(const Each& each) {
    each("disparity", &OutputMemory::disparity);
    each("variance", &OutputMemory::variance);
    each("right_disparity", &OutputMemory::right_disparity);
    each("right_variance", &OutputMemory::right_variance);
    each("predicted", &OutputMemory::predicted);
    each("predicted_variance", &OutputMemory::predicted_variance);
    each("measured", &OutputMemory::measured);
    each("measured_variance", &OutputMemory::measured_variance);
    each("search_width", &OutputMemory::search_width);
    each("dynamic", &OutputMemory::dynamic);
    each("reason", &OutputMemory::reason);
  }
  bool padding_is_untouched() const {
    bool untouched = true;
    for_each_map([&](const char*, auto map) { untouched = untouched && (this->*map).padding_is_untouched(); });
    return untouched;
  }
};

/// Of two frames, bit by bit.
inline ::testing::AssertionResult same_outputs(const OutputMemory& actual, const OutputMemory& expected,
                                               shared::ImageSize size) {
  ::testing::AssertionResult result = ::testing::AssertionSuccess();
  OutputMemory::for_each_map([&](const char* name, auto map) {
    const auto same = same_bits((actual.*map).values(), (expected.*map).values(), size);
    if (result && !same) result = ::testing::AssertionFailure() << name << ": " << same.message();
  });
  return result;
}

/// Of all frames of two runs.
inline ::testing::AssertionResult same_outputs(const std::vector<OutputMemory>& actual,
                                               const std::vector<OutputMemory>& expected, shared::ImageSize size) {
  if (actual.size() != expected.size()) return ::testing::AssertionFailure() << actual.size() << " frames";
  for (std::size_t frame = 0; frame < actual.size(); ++frame) {
    const auto same = same_outputs(actual[frame], expected[frame], size);
    if (!same) return ::testing::AssertionFailure() << "frame " << frame << ", " << same.message();
  }
  return ::testing::AssertionSuccess();
}

}  // namespace egosgm::testing
