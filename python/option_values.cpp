// SPDX-License-Identifier: Apache-2.0
#include "python/option_values.h"

#include "egosgm/named_options.h"

namespace egosgm::python {
namespace {

std::string text_of(const py::handle& value) {
  const auto text = py::str(whole(value)).cast<std::string>();
  return text == "True" ? "true" : text == "False" ? "false" : text;
}

bool takes(const NamedOption& option, const char* value) {
  PipelineOptions options;
  try {
    set_option(options, option.name, value);
    return true;
  } catch (const InvalidArgument&) {
    return false;
  }
}

py::object typed(const NamedOption& option) {
  if (option.value == "true" || option.value == "false") return py::bool_(option.value == "true");
  if (takes(option, "0.5")) return py::float_(py::str(option.value));
  if (takes(option, "5")) return py::int_(py::str(option.value));
  return py::str(option.value);
}

}  // namespace

py::object whole(const py::handle& value) {
  const bool is_number = !py::isinstance<py::bool_>(value) && py::hasattr(value, "is_integer");
  if (is_number && value.attr("is_integer")().cast<bool>()) return py::int_(py::reinterpret_borrow<py::object>(value));
  return py::reinterpret_borrow<py::object>(value);
}

void set_options(PipelineOptions& options, const py::dict& values) {
  for (const auto& [key, value] : values) {
    const auto name = key.cast<std::string>();
    if (!py::isinstance<py::dict>(value)) {
      set_option(options, name, text_of(value));
      continue;
    }
    for (const auto& [field, inner] : py::reinterpret_borrow<py::dict>(value)) {
      set_option(options, name + "." + field.cast<std::string>(), text_of(inner));
    }
  }
}

py::dict dict_of(const PipelineOptions& options) {
  py::dict values;
  for (const NamedOption& option : list_options(options)) values[py::str(option.name)] = typed(option);
  return values;
}

PipelineOptions options_of_preset(const std::string& name) {
  PipelineOptions options;
  set_option(options, "preset", name);
  return options;
}

}  // namespace egosgm::python
