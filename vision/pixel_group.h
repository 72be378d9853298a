// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// A box of pixels, whose right and bottom end lie outside.
struct Box {
  int left = 0, top = 0, right = 0, bottom = 0;

  int width() const { return right - left; }
  int height() const { return bottom - top; }
  std::size_t area() const { return static_cast<std::size_t>(width()) * static_cast<std::size_t>(height()); }
  bool contains(int x, int y) const { return x >= left && x < right && y >= top && y < bottom; }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y - top) * static_cast<std::size_t>(width()) + static_cast<std::size_t>(x - left);
  }
  bool touches(const Box& other) const {
    return left < other.right && other.left < right && top < other.bottom && other.top < bottom;
  }
  Box padded(int by, Size size) const {
    return {std::max(left - by, 0), std::max(top - by, 0), std::min(right + by, size.width),
            std::min(bottom + by, size.height)};
  }
};

struct Pixel {
  int x, y;
};

/// A set of pixels.
struct Group {
  std::vector<Pixel> pixels;
  Box box;

  int size() const { return static_cast<int>(pixels.size()); }
  void add(int x, int y) {
    box = pixels.empty() ? Box{x, y, x + 1, y + 1}
                         : Box{std::min(box.left, x), std::min(box.top, y), std::max(box.right, x + 1),
                               std::max(box.bottom, y + 1)};
    pixels.push_back({x, y});
  }
};

/// By how much two disparities of one surface may differ [px].
inline double alike_px(double disparity) { return 1 + 0.05 * std::max(disparity, 0.0); }

/// The groups of pixels in a box for which `is_in` holds and that are neighbours with alike disparities, largest first.
template <typename IsIn, typename Disparity>
std::vector<Group> connected_groups(const Box& box, const IsIn& is_in, const Disparity& disparity) {
  std::vector<Group> groups;
  std::vector<char> is_seen(box.area(), 0);
  std::vector<Pixel> open;
  for (int y = box.top; y < box.bottom; ++y) {
    for (int x = box.left; x < box.right; ++x) {
      if (is_seen[box.index(x, y)] || !is_in(x, y)) continue;
      Group group;
      is_seen[box.index(x, y)] = 1;
      open.push_back({x, y});
      while (!open.empty()) {
        const Pixel p = open.back();
        open.pop_back();
        group.add(p.x, p.y);
        const double d = disparity(p.x, p.y);
        for (const Pixel& next : {Pixel{p.x - 1, p.y}, {p.x + 1, p.y}, {p.x, p.y - 1}, {p.x, p.y + 1}}) {
          if (!box.contains(next.x, next.y) || is_seen[box.index(next.x, next.y)] || !is_in(next.x, next.y)) continue;
          if (std::abs(disparity(next.x, next.y) - d) > alike_px(d)) continue;
          is_seen[box.index(next.x, next.y)] = 1;
          open.push_back(next);
        }
      }
      groups.push_back(std::move(group));
    }
  }
  std::stable_sort(groups.begin(), groups.end(), [](const Group& a, const Group& b) { return a.size() > b.size(); });
  return groups;
}

}  // namespace egosgm::vision
