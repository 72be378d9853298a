// SPDX-License-Identifier: Apache-2.0
// Values that other processes take, which multiprocessing pickles and copy copies: by their members, one after the
// other.
#pragma once

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "egosgm/frame.h"

namespace egosgm::python {

namespace py = pybind11;

/// The stored form of a member.
template <typename T>
struct Stored {
  static py::object of(const T& value) {
    if constexpr (std::is_enum_v<T>) {
      return py::int_(static_cast<int>(value));
    } else if constexpr (std::is_base_of_v<py::object, T>) {
      return value;
    } else {
      return py::cast(value);
    }
  }
  static T from(const py::handle& stored) {
    if constexpr (std::is_enum_v<T>) {
      return static_cast<T>(stored.cast<int>());
    } else {
      return stored.cast<T>();
    }
  }
};

template <>
struct Stored<std::string> {  // of a file's name, perhaps, which need not be UTF-8
  static py::object of(const std::string& value) { return py::bytes(value); }
  static std::string from(const py::handle& stored) { return stored.cast<std::string>(); }
};

template <typename T>
struct Stored<std::optional<T>> {
  static py::object of(const std::optional<T>& value) { return value ? Stored<T>::of(*value) : py::none(); }
  static std::optional<T> from(const py::handle& stored) {
    return stored.is_none() ? std::nullopt : std::optional(Stored<T>::from(stored));
  }
};

template <>
struct Stored<StageTime> {
  static py::object of(const StageTime& value) { return py::make_tuple(value.stage, value.ms); }
  static StageTime from(const py::handle& stored) {
    auto [stage, ms] = stored.cast<std::pair<std::string, double>>();
    return {std::move(stage), ms};
  }
};

template <typename T>
struct Stored<std::vector<T>> {
  static py::object of(const std::vector<T>& values) {
    py::list stored;
    for (const T& value : values) stored.append(Stored<T>::of(value));
    return stored;
  }
  static std::vector<T> from(const py::handle& stored) {
    std::vector<T> values;
    for (const py::handle& value : stored) values.push_back(Stored<T>::from(value));
    return values;
  }
};

template <auto... kMembers, typename Class>
void pickle_members(Class& bound) {
  using Value = typename Class::type;
  bound.def(py::pickle(
      [](const Value& value) {
        return py::make_tuple(Stored<std::decay_t<decltype(value.*kMembers)>>::of(value.*kMembers)...);
      },
      [](const py::tuple& stored) {
        Value value;
        std::size_t i = 0;
        ((value.*kMembers = Stored<std::decay_t<decltype(value.*kMembers)>>::from(stored[i++])), ...);
        return value;
      }));
}

}  // namespace egosgm::python
