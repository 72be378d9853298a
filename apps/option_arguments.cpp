// SPDX-License-Identifier: Apache-2.0
#include "apps/option_arguments.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <sstream>
#include <utility>

#include "apps/option_group.h"
#include "apps/output_folder.h"
#include "egosgm/error.h"
#include "egosgm/named_options.h"
#include "vision/file_io.h"
#include "vision/text_rows.h"

namespace egosgm::app {
namespace {

constexpr std::size_t kMaxConfigBytes = 1 << 16;
constexpr int kMaxDots = 3;  // in a section's name

/// An option's value as TOML writes it: names are quoted, numbers and truth values are not.
std::string toml_value(const std::string& value) {
  const bool bare =
      value == "true" || value == "false" || value.find_first_not_of("+-.0123456789e") == std::string::npos;
  return bare ? value : '"' + value + '"';
}

/// The line, from 1, that sets `option`; 0: none that is written as usual.
int line_of(const std::string& text, const std::string& option) {
  std::istringstream lines(text);
  std::string section;
  int number = 0;
  for (std::string raw; std::getline(lines, raw);) {
    ++number;
    const std::string line = CLI::detail::trim_copy(raw);
    if (line.starts_with('[')) section = CLI::detail::trim_copy(line.substr(1, line.find(']') - 1)) + '.';
    const std::string name = CLI::detail::trim_copy(line.substr(0, line.find('=')));
    if (section + name == option) return number;
  }
  return 0;
}

/// CLI11 keeps a section of N parts as N names of up to N parts, and takes a name alone for true, or for nothing.
void check_rows(const std::string& text, const std::string& file) {
  for (const vision::TextRow& row : vision::split_rows(text, file)) {
    const std::size_t first = std::min(row.text.find_first_not_of(" \t\r\v\f"), row.text.size());
    const std::string_view rest = row.text.substr(first);
    if (rest.empty() || rest.starts_with('#')) continue;
    if (!rest.starts_with('[') && rest.find('=') == std::string_view::npos) {
      vision::refuse_row(file, row.number, vision::quoted(row.text) + " is not `name = value`");
    }
    if (!rest.starts_with('[') || std::count(rest.begin(), rest.end(), '.') <= kMaxDots) continue;
    vision::refuse_row(file, row.number,
                       vision::quoted(row.text) + " is nested too deep: write one `stage.option = value` a line");
  }
}

/// Options as they are chosen one after the other.
class Choices {
 public:
  void set(const std::string& name, const std::string& value) {
    if (name == "preset" && !is_first_) {
      throw InvalidArgument("option preset: would undo what was chosen before it: put it first");
    }
    is_first_ = is_first_ && name == "preset";
    set_option(options, name, value);
  }

  PipelineOptions options;

 private:
  bool is_first_ = true;  // nothing but presets was chosen
};

void apply_config(Choices& choices, const std::string& file) {
  const std::string bytes = vision::read_file(file, kMaxConfigBytes);
  const std::string read(vision::without_mark(bytes));
  check_rows(read, file);
  std::istringstream text(read);
  std::vector<CLI::ConfigItem> items;
  try {
    items = CLI::ConfigTOML().from_config(text);
  } catch (const CLI::Error& error) {
    throw InvalidArgument(file + ": " + error.what() + ": write one `name = value` a line");
  }
  for (const CLI::ConfigItem& item : items) {
    if (item.name == "++" || item.name == "--") continue;  // CLI11's marks of where a section begins and ends
    if (item.inputs.size() != 1) throw InvalidArgument(file + ": " + item.fullname() + " needs one value");
    try {
      choices.set(item.fullname(), item.inputs.front());
    } catch (const InvalidArgument& error) {
      const int line = line_of(read, item.fullname());
      throw InvalidArgument(fmt::format("{}{}: {}", file, line > 0 ? fmt::format(":{}", line) : "", error.what()));
    }
  }
}

void apply_setting(Choices& choices, const std::string& setting) {
  const auto equals = setting.find('=');
  if (equals == std::string::npos) throw InvalidArgument("--set " + setting + ": write --set NAME=VALUE");
  choices.set(setting.substr(0, equals), setting.substr(equals + 1));
}

void set_preset(Choices& choices, const std::string& name) {
  if (name != "default" && name != "paper") throw InvalidArgument("--preset \"" + name + "\": choose default or paper");
  choices.set("preset", name);
}

std::string options_help() {
  const auto defaults = list_options(PipelineOptions{});
  const auto paper = list_options(PipelineOptions::paper());
  std::string help = "Options, for --set and --config (docs/use/options.md):\n";
  for (std::size_t i = 0; i < defaults.size(); ++i) {
    const OptionText& text = option_texts()[i];
    const bool differs = paper[i].value != defaults[i].value;
    help += fmt::format("  {} = {}{}\n      {}\n      Values: {}{}{}. {}\n", text.name, defaults[i].value,
                        differs ? fmt::format("  (paper: {})", paper[i].value) : "", text.meaning, text.range,
                        *text.unit ? " " : "", text.unit, text.when_to_change);
  }
  return help;
}

}  // namespace

void OptionArguments::add_to(CLI::App& command) {
  OptionGroup method(command, "Method");
  const PipelineOptions defaults;
  method.add("--preset", preset, "default|paper",
             "default: the best known; paper: the choices of Fucek et al. 2017 [default]");
  method.add("--temporal", temporal, "on|off", "off: the plain single-frame matcher, full range [on]");
  method.add("--paths", paths, "4|8", fmt::format("paths of the semi-global aggregation [{}]", defaults.paths));
  method.add("--disparities", disparities, "N",
             fmt::format("number D of disparities; the range is [min, min + D) px [{}]", defaults.disparities));
  method.add("--min-disparity", min_disparity, "N",
             fmt::format("least disparity, of either sign, px [{}]", defaults.min_disparity));
  method.add("--set", settings, "NAME=VALUE", "set an option (list below); may be repeated")->allow_extra_args(false);
  method.add("--config", config, "FILE", "read options from a file, `name = value` a line (TOML)");
  method.add("--save-config", save_config, "FILE", "write the options in use to such a new file");
  command.footer([] { return options_help(); });
}

PipelineOptions OptionArguments::options() const {
  Choices choices;
  if (!preset.empty()) set_preset(choices, preset);
  if (!config.empty()) apply_config(choices, config);
  for (const std::string& setting : settings) apply_setting(choices, setting);
  const std::pair<const char*, const std::string&> named[] = {
      {"temporal", temporal}, {"paths", paths}, {"disparities", disparities}, {"min_disparity", min_disparity}};
  for (const auto& [name, value] : named) {
    if (!value.empty()) choices.set(name, value);
  }
  choices.options.validate();
  return choices.options;
}

void OptionArguments::expect_saves(const std::string& out) const {
  if (!out.empty()) expect_outside("--save-config", save_config, out);
  if (!save_config.empty()) expect_new_file("--save-config", save_config);
}

void OptionArguments::save(const PipelineOptions& options) const {
  const vision::KeepFiles others;
  if (!save_config.empty()) vision::write_file(save_config, config_text(options));
}

std::string config_text(const PipelineOptions& options) {
  std::string text = "# Options of egosgm run: read back with --config.\n";
  for (const auto& [name, value] : list_options(options)) text += name + " = " + toml_value(value) + '\n';
  return text;
}

}  // namespace egosgm::app
