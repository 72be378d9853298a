// SPDX-License-Identifier: Apache-2.0
// Options by name, as files and command lines give them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/options.h"

namespace egosgm {

/// An option by its name, `stage.option` (for example `banded_sgm.p2`), with its value as text.
struct NamedOption {
  std::string name;
  std::string value;
};

/// All options of `options`, in the order of options.h.
EGOSGM_EXPORT std::vector<NamedOption> list_options(const PipelineOptions& options);

/// Sets one. Throws InvalidArgument for a name that does not exist (with the nearest that does) or a value that does
/// not parse.
EGOSGM_EXPORT void set_option(PipelineOptions& options, std::string_view name, std::string_view value);

}  // namespace egosgm
