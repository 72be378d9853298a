// SPDX-License-Identifier: Apache-2.0
#include "host/vision/video_order.h"

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <optional>
#include <system_error>

#include "host/vision/name_numbers.h"

namespace egosgm::vision {
namespace {

/// How much later `name` is than `before`. None where more than the last number tells them apart.
std::optional<std::int64_t> distance(const std::string& before, const std::string& name) {
  const Numbers a = numbers_in(before), b = numbers_in(name);
  if (a.empty() || a.size() != b.size() || !std::equal(a.begin(), a.end() - 1, b.begin())) return std::nullopt;
  std::int64_t first = 0, second = 0;
  for (const auto& [text, value] : {std::pair(&a.back(), &first), std::pair(&b.back(), &second)}) {
    if (std::from_chars(text->data(), text->data() + text->size(), *value).ec != std::errc()) return std::nullopt;
  }
  return second - first;
}

}  // namespace

std::vector<bool> find_successors(const std::vector<std::string>& names) {
  std::vector<bool> follows(names.size(), false);
  std::vector<std::optional<std::int64_t>> distances(names.size());
  std::vector<std::int64_t> sorted;
  for (std::size_t i = 1; i < names.size(); ++i) {
    distances[i] = distance(names[i - 1], names[i]);
    if (distances[i] && *distances[i] > 0) sorted.push_back(*distances[i]);
  }
  if (sorted.empty()) return follows;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>((sorted.size() - 1) / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  for (std::size_t i = 1; i < names.size(); ++i) {
    follows[i] = distances[i] && *distances[i] > 0 && 2 * *distances[i] <= 3 * *middle;
  }
  return follows;
}

}  // namespace egosgm::vision
