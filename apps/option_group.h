// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/App.hpp>
#include <string>

namespace egosgm::app {

/// A command's options under one heading of its help.
class OptionGroup {
 public:
  /// Under the heading that options have which are in no group.
  explicit OptionGroup(CLI::App& command) : OptionGroup(command, command.option_defaults()->get_group()) {}
  OptionGroup(CLI::App& command, std::string heading) : command_(command), heading_(std::move(heading)) {}

  /// `type`: what the help calls a value.
  template <typename Value>
  CLI::Option* add(const char* names, Value& value, const char* type, const std::string& text) {
    return command_.add_option(names, value, text)->type_name(type)->group(heading_);
  }
  CLI::Option* add_flag(const char* names, bool& value, const std::string& text) {
    return command_.add_flag(names, value, text)->group(heading_);
  }

 private:
  CLI::App& command_;
  const std::string heading_;
};

}  // namespace egosgm::app
