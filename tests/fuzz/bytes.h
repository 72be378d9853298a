// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace egosgm::fuzz {

/// Reads values off an input; zeros after its end.
class Bytes {
 public:
  explicit Bytes(std::string_view input) : left_(input) {}

  template <typename T>
  T take() {
    static_assert(std::is_trivially_copyable_v<T>);
    T value{};
    const std::size_t count = std::min(sizeof value, left_.size());
    std::memcpy(&value, left_.data(), count);
    left_.remove_prefix(count);
    return value;
  }
  /// 0 to `end` - 1.
  int below(int end) { return take<std::uint16_t>() % end; }
  bool coin() { return take<std::uint8_t>() & 1; }

  /// Mostly a small number, sometimes a wild one.
  double number() {
    switch (below(64)) {
      case 0:
        return take<double>();
      case 1:
        return std::numeric_limits<double>::quiet_NaN();
      case 2:
        return coin() ? std::numeric_limits<double>::infinity() : -std::numeric_limits<double>::infinity();
      case 3:
        return std::numeric_limits<double>::denorm_min();
      case 4:
        return coin() ? 1e30 : -1e30;
      case 5:
        return 0;
      default:
        return take<std::int16_t>() / 8192.0;
    }
  }

 private:
  std::string_view left_;
};

/// Strings of random bytes, for targets that read values off them.
inline std::vector<std::string> random_seeds(unsigned seed, std::size_t bytes) {
  std::mt19937 random(seed);
  std::vector<std::string> strings(64, std::string(bytes, '\0'));
  for (std::string& string : strings) {
    for (char& c : string) c = static_cast<char>(random());
  }
  return strings;
}

}  // namespace egosgm::fuzz
