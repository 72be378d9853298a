// SPDX-License-Identifier: Apache-2.0
// Options by name and value, a line each: NAME VALUE.
#include "egosgm/named_options.h"
#include "tests/fuzz/target.h"

namespace egosgm::fuzz {

std::vector<std::string> seeds() {
  std::vector<std::string> lines;
  for (const NamedOption& option : list_options({})) lines.push_back(option.name + ' ' + option.value + '\n');
  for (const NamedOption& option : list_options(PipelineOptions::paper())) {
    lines.push_back(lines.front() + option.name + ' ' + option.value + '\n');
  }
  return lines;
}

void run(std::string_view input) {
  PipelineOptions options;
  while (!input.empty()) {
    const std::string_view line = input.substr(0, input.find('\n'));
    const std::size_t space = std::min(line.find(' '), line.size());
    set_option(options, line.substr(0, space), line.substr(std::min(space + 1, line.size())));
    input.remove_prefix(std::min(line.size() + 1, input.size()));
  }
  options.validate();
  for (const NamedOption& option : list_options(options)) {
    PipelineOptions again;
    set_option(again, option.name, option.value);
  }
}

}  // namespace egosgm::fuzz
