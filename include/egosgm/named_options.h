// SPDX-License-Identifier: Apache-2.0
// Options by name, as files and command lines give them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/options.h"

namespace egosgm {

/// An option by its name, for example `p2`, with its value as text.
struct NamedOption {
  std::string name;
  std::string value;
};

/// The description of an option, in a sentence each. The strings live as long as the program.
struct OptionText {
  const char* name;
  const char* meaning;
  const char* unit;            // "" where it has none
  const char* range;           // the values that it takes
  const char* when_to_change;  // for whom the default does not fit, and what then
};

/// All options of `options`: the preset first, then in the order of docs/use/options.md; then its constants, if any, as
/// `constants.NAME`.
EGOSGM_EXPORT std::vector<NamedOption> list_options(const PipelineOptions& options);

/// The descriptions, in the same order, without constants.
EGOSGM_EXPORT const std::vector<OptionText>& option_texts();

/// Sets one. `preset` sets all others, too. `constants.NAME` sets a constant of the method, for experiments. Throws
/// InvalidArgument for a value that does not parse, and for a name that does not exist: with the nearest that does.
EGOSGM_EXPORT void set_option(PipelineOptions& options, std::string_view name, std::string_view value);

}  // namespace egosgm
