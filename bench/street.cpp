// SPDX-License-Identifier: Apache-2.0
#include "bench/street.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace egosgm::bench {
namespace {

struct Box {
  float left, right, top, disparity;  // parts of width, width, height and the largest disparity
};

std::vector<Box> make_boxes() {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(0.0f, 1.0f);
  std::vector<Box> boxes;
  for (int i = 0; i < 16; ++i) {
    const float left = unit(random);
    boxes.push_back({left, left + 0.01f + 0.1f * unit(random), 0.2f + 0.3f * unit(random), 0.2f + 0.6f * unit(random)});
  }
  return boxes;
}

/// As part of the largest disparity; x and y as parts of width and height. The nearest surface is seen.
float disparity_at(const std::vector<Box>& boxes, float x, float y) {
  constexpr float kHorizon = 0.42f;
  const float road = (y - kHorizon) / (1 - kHorizon);
  float d = std::max(road, 0.08f + 0.3f * std::abs(2 * x - 1));
  for (const Box& box : boxes) {
    if (x >= box.left && x < box.right && y >= box.top) d = std::max(d, box.disparity);
  }
  return d;
}

std::uint32_t hash(std::uint32_t x, std::uint32_t y) {
  std::uint32_t h = x * 0x9E3779B1u ^ y * 0x85EBCA77u;
  h = (h ^ h >> 15) * 0x2C1B3C6Du;
  return h ^ h >> 13;
}

std::uint8_t texture(std::uint32_t x, std::uint32_t y) {
  return static_cast<std::uint8_t>(40 + hash(x, y) % 64 + hash(x / 4 + 7919, y / 4) % 110);
}

}  // namespace

Street make_street(shared::ImageSize size, int disparities) {
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
  const float largest_px =
      std::min(0.055f * static_cast<float>(size.width), 0.9f * static_cast<float>(disparities - 1));
  Street street{size,
                {},
                {},
                std::vector<std::uint8_t>(2 * pixels),
                std::vector<float>(2 * pixels, EGOSGM_INVALID_DISPARITY),
                std::vector<float>(2 * pixels, 0.0f)};
  street.calibration = {0.58 * size.width, 0.58 * size.width, 0.5 * size.width, 0.5 * size.height, 0.54, 0};
  street.motion.current_from_previous.translation().z() = -0.8;
  const std::vector<Box> boxes = make_boxes();
  for (int y = 0; y < size.height; ++y) {
    const std::size_t left = static_cast<std::size_t>(y) * size.width, right = left + pixels;
    for (int x = 0; x < size.width; ++x)
      street.images[right + x] = texture(x + 100000, y);  // what the left camera does not see
    for (int x = 0; x < size.width; ++x) {
      const float part = disparity_at(boxes, static_cast<float>(x) / size.width, static_cast<float>(y) / size.height);
      const float d = std::floor(part * largest_px);
      const int seen_at = x - static_cast<int>(d);
      const std::uint8_t grey = texture(x, y);
      street.images[left + x] = grey;
      if (hash(x / 8 + 31, y / 8) % 100 >= 8) street.disparity[left + x] = d;
      if (seen_at >= 0 && d >= street.disparity[right + seen_at]) {
        street.images[right + seen_at] = grey;
        street.disparity[right + seen_at] = d;
      }
    }
  }
  for (std::size_t i = 0; i < 2 * pixels; ++i) {
    if (street.disparity[i] != EGOSGM_INVALID_DISPARITY) street.variance[i] = 0.3f;
  }
  return street;
}

}  // namespace egosgm::bench
