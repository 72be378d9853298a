// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <type_traits>

namespace egosgm::ocl {

/// The -D options of a program. Equal defines give equal text, so the text is also the cache key.
class Defines {
 public:
  template <typename T>
  Defines& set(std::string name, T value) {
    static_assert(std::is_arithmetic_v<T>, "a define is a number; pass types as alternatives of one");
    values_.insert_or_assign(std::move(name), literal(value));
    return *this;
  }

  std::string text() const;

  /// Whether no name has another value there.
  bool agrees_with(const Defines& other) const;
  void add(const Defines& other) { values_.insert(other.values_.begin(), other.values_.end()); }

 private:
  static std::string literal(bool value) { return value ? "1" : "0"; }
  static std::string literal(int value) { return std::to_string(value); }
  static std::string literal(float value);  // hexadecimal: what the kernel reads is what was set

  std::map<std::string, std::string> values_;
};

}  // namespace egosgm::ocl
