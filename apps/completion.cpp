// SPDX-License-Identifier: Apache-2.0
// Completion for the shell, made from the arguments that the program itself parses.
#include <fmt/core.h>

#include <sstream>

#include "apps/command.h"
#include "apps/run_outputs.h"
#include "egosgm/error.h"
#include "egosgm/named_options.h"

namespace egosgm::app {
namespace {

std::vector<const CLI::App*> commands_of(const CLI::App& program) {
  return program.get_subcommands([](const CLI::App*) { return true; });
}

std::string joined(const std::vector<std::string>& words, const char* between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, at);) parts.push_back(part);
  return parts;
}

/// What completes the option's value, as a line of bash; empty where nothing does.
std::string value_completion(const CLI::Option& option) {
  const std::string type = option.get_type_name(), name = option.get_name();
  if (type == "DIR") return "COMPREPLY=($(compgen -d -- \"$word\"))";
  if (type.starts_with("FILE") || type == "PATTERN") return "COMPREPLY=($(compgen -f -- \"$word\"))";
  std::vector<std::string> words;
  if (name == "--set") {
    for (const NamedOption& stage : list_options({})) words.push_back(stage.name + "=");
    return fmt::format("compopt -o nospace; COMPREPLY=($(compgen -W '{}' -- \"$word\"))", joined(words, " "));
  }
  if (name == "--write") {
    return fmt::format(
        "compopt -o nospace; local done=; [[ $word == *,* ]] && done=${{word%,*}},\n"
        "          COMPREPLY=($(compgen -P \"$done\" -W '{}' -- \"${{word##*,}}\"))",
        joined(write_kinds(), " "));
  }
  if (type.find('|') == std::string::npos) return {};
  return fmt::format("COMPREPLY=($(compgen -W '{}' -- \"$word\"))", joined(split(type, '|'), " "));
}

/// The cases of one subcommand: what follows an option that takes a value, else its options (and folders, for those
/// with a positional).
std::string case_of(const CLI::App& command) {
  std::vector<std::string> names;
  std::string values;
  bool positional = false;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_positional()) positional = true;
    std::vector<std::string> own;
    for (const std::string& name : option->get_lnames()) own.push_back("--" + name);
    names.insert(names.end(), own.begin(), own.end());
    if (own.empty() || option->get_items_expected_max() == 0) continue;  // a flag
    const std::string completion = value_completion(*option);
    values += fmt::format("        {})\n          {}\n          return ;;\n", joined(own, "|"),
                          completion.empty() ? ":" : completion);
  }
  const char* folders = positional ? " $(compgen -d -- \"$word\")" : "";
  return fmt::format(
      "    {})\n      case $previous in\n{}      esac\n"
      "      COMPREPLY=($(compgen -W '{}' -- \"$word\"){}) || : ;;\n",
      command.get_name(), values, joined(names, " "), folders);
}

std::string bash_script(const CLI::App& program) {
  std::vector<std::string> names{"--help", "--version"};
  std::string cases;
  for (const CLI::App* command : commands_of(program)) {
    names.push_back(command->get_name());
    cases += case_of(*command);
  }
  return fmt::format(
      "# egosgm completion bash\n"
      "_egosgm() {{\n"
      "  local word=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD-1]}}\n"
      "  COMPREPLY=()\n"
      "  if ((COMP_CWORD == 1)); then\n"
      "    COMPREPLY=($(compgen -W '{}' -- \"$word\"))\n"
      "    return\n"
      "  fi\n"
      "  case ${{COMP_WORDS[1]}} in\n{}  esac\n"
      "}}\n"
      "complete -o filenames -F _egosgm egosgm\n",
      joined(names, " "), cases);
}

/// Text within single quotes, and within the brackets or before the colon of what zsh's _arguments takes.
std::string zsh_text(const std::string& text) {
  std::string escaped;
  for (const char c : text.substr(0, text.find('\n'))) {
    if (c == '\'') {
      escaped += "'\\''";
      continue;
    }
    if (c == '[' || c == ']' || c == ':' || c == '\\') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

/// What completes the option's value, as an action of _arguments; a blank where nothing does.
std::string zsh_action(const CLI::Option& option) {
  const std::string type = option.get_type_name(), name = option.get_name();
  if (type == "DIR") return "_files -/";
  if (type.starts_with("FILE") || type == "PATTERN") return "_files";
  if (name == "--write") return fmt::format("_values -s , kind {}", joined(write_kinds(), " "));
  if (name == "--set") {
    std::string stages;
    for (const NamedOption& stage : list_options({})) stages += stage.name + "= ";
    return fmt::format("compadd -S \"\" -- {}", stages);
  }
  return type.find('|') == std::string::npos ? " " : fmt::format("({})", joined(split(type, '|'), " "));
}

std::string zsh_case(const CLI::App& command) {
  std::string specs;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_positional() && specs.find("'*:folder:") == std::string::npos)
      specs += " \\\n        '*:folder:_files'";
    for (const std::string& name : option->get_lnames()) {
      const bool flag = option->get_items_expected_max() == 0;
      specs += fmt::format(" \\\n        '*--{}[{}]{}'", name, zsh_text(option->get_description()),
                           flag ? "" : fmt::format(":{}:{}", zsh_text(option->get_type_name()), zsh_action(*option)));
    }
  }
  return fmt::format("    {})\n      _arguments{} ;;\n", command.get_name(), specs);
}

std::string zsh_script(const CLI::App& program) {
  std::string commands, cases;
  for (const CLI::App* command : commands_of(program)) {
    commands += fmt::format("    '{}:{}'\n", command->get_name(), zsh_text(command->get_description()));
    cases += zsh_case(*command);
  }
  return fmt::format(
      "#compdef egosgm\n"
      "# egosgm completion zsh\n"
      "_egosgm() {{\n"
      "  local -a commands=(\n{}  )\n"
      "  if ((CURRENT == 2)); then\n"
      "    _describe command commands\n"
      "    _arguments '--help[how it is used]' '--version[its version]'\n"
      "    return\n"
      "  fi\n"
      "  shift words\n"
      "  ((CURRENT--))\n"
      "  case $words[1] in\n{}  esac\n"
      "}}\n"
      "# A file named _egosgm in $fpath is run where it is needed; else this is sourced.\n"
      "if [[ ${{funcstack[1]-}} == _egosgm ]]; then\n"
      "  _egosgm \"$@\"\n"
      "else\n"
      "  (($+functions[compdef])) || {{ autoload -Uz compinit && compinit; }}\n"
      "  compdef _egosgm egosgm\n"
      "fi\n",
      commands, cases);
}

int print_completion(const CLI::App& program, const std::string& shell) {
  if (shell == "bash") {
    fmt::print("{}", bash_script(program));
  } else if (shell == "zsh") {
    fmt::print("{}", zsh_script(program));
  } else {
    throw InvalidArgument("completion \"" + shell + "\": choose bash or zsh");
  }
  return kOk;
}

}  // namespace

Command add_completion(CLI::App& program) {
  CLI::App* command = program.add_subcommand("completion", "Print a script that completes arguments in the shell");
  auto shell = std::make_shared<std::string>();
  command->add_option("SHELL", *shell, "bash or zsh")->type_name("")->required();
  command->footer("For example, in ~/.bashrc or ~/.zshrc:  source <(egosgm completion bash)   (or zsh)");
  return {command, [&program, shell] { return print_completion(program, *shell); }};
}

}  // namespace egosgm::app
