// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

#include <string>

#include "egosgm/error.h"
#include "egosgm/options.h"

namespace egosgm::python {

namespace py = pybind11;

/// 150.0 as 150: a number that is whole may be given for a count, whatever its type. Others as they are.
py::object whole(const py::handle& value);

/// Throws InvalidArgument for an unknown name.
PipelineOptions options_of_preset(const std::string& name);

/// Options by name with Python's values: `p2=150`; constants of the method as `constants={"coarse_match.p1": 7}`.
/// Throws InvalidArgument, as set_option does.
void set_options(PipelineOptions& options, const py::dict& values);

/// All options by name, typed as the library has them.
py::dict dict_of(const PipelineOptions& options);

/// Sets the fields of an aggregate that `for_each_field(options, visit(name, member))` names. Throws InvalidArgument,
/// naming the value, for an unknown name or a value of another type.
template <typename Options>
void set_fields(Options& options, const py::kwargs& values) {
  for (const auto& [key, value] : values) {
    const auto wanted = py::cast<std::string>(key);
    bool found = false;
    std::string known;
    for_each_field(options, [&, &value = value](const char* name, auto& member) {
      known += (known.empty() ? "" : ", ") + std::string(name);
      if (wanted != name) return;
      found = true;
      try {
        member = py::cast<std::decay_t<decltype(member)>>(whole(value));
      } catch (const py::cast_error&) {
        throw InvalidArgument("option " + wanted + ": " + py::cast<std::string>(py::repr(value)) +
                              " has the wrong type");
      }
    });
    if (!found) throw InvalidArgument("no option named \"" + wanted + "\": choose from " + known);
  }
  options.validate();
}

/// A property for each of the fields.
template <typename Options>
py::dict dict_of_fields(Options options) {
  py::dict values;
  for_each_field(options, [&](const char* name, auto& member) { values[name] = member; });
  return values;
}

}  // namespace egosgm::python
