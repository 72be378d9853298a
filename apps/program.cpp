// SPDX-License-Identifier: Apache-2.0
// The program: arguments in, files out. One file a subcommand.
#include "apps/program.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <new>
#include <optional>
#include <set>
#include <string_view>

#include "apps/interrupt.h"
#include "apps/python_tools.h"
#include "apps/standard_output.h"
#include "egosgm/error.h"
#include "vision/text_rows.h"

namespace egosgm::app {
namespace {

/// On one line, whatever a name in it holds.
int fail(int code, std::string message) {
  std::replace_if(
      message.begin(), message.end(), [](unsigned char c) { return c < ' ' || c == 0x7f; }, ' ');
  say("egosgm: error: " + message);
  return code;
}

const CLI::App& chosen_command(const CLI::App& program) {
  const auto chosen = program.get_subcommands();
  return chosen.empty() ? program : *chosen.front();
}

std::string help_hint(const CLI::App& command) {
  return command.get_parent() ? "egosgm " + command.get_name() + " --help" : "egosgm --help";
}

int refuse_arguments(const CLI::App& program, const CLI::ParseError& error) {
  const CLI::App& command = chosen_command(program);
  std::vector<std::string> unknown = program.remaining(true);
  std::erase(unknown, "--");
  if (unknown.empty()) {
    std::string what = error.what();
    if (const std::string prefix = "Could not convert: "; what.starts_with(prefix))
      what = what.substr(prefix.size()) + " is no value for it";
    return fail(kBadInput, fmt::format("{}: see `{}`", what, help_hint(command)));
  }
  if (std::error_code error; is_regular_file(std::filesystem::path(unknown.front()), error)) {
    return fail(kBadInput, fmt::format("unexpected argument \"{}\", a file: did the shell expand a pattern? quote it: "
                                       "'*{}'",
                                       unknown.front(), std::filesystem::path(unknown.front()).extension().string()));
  }
  const std::string typed = unknown.front().substr(0, unknown.front().find('='));
  if (typed == "view") {
    return fail(kBadInput,
                "view: `egosgm run --show` of the Python package shows a run in the browser, its egosgm.viewer in "
                "Rerun; `egosgm "
                "run --write overview` draws it into files");
  }
  const char* const what = typed.starts_with("-") ? "unknown option"
                           : command.get_parent() ? "unexpected argument"
                                                  : "no command";
  return fail(kBadInput, fmt::format("{} \"{}\": see `{}`", what, typed, help_hint(command)));
}

/// Whether what --help calls the value is a number.
bool takes_number(const CLI::Option& option) {
  static const std::set<std::string> numbers{"N", "W", "H", "S", "M", "DEG", "G", "PX", "PERCENT", "A", "D", "STEPS"};
  const std::string type = option.get_type_name();
  return numbers.contains(type.substr(0, type.find(':')));
}

/// CLI11 also takes hexadecimal numbers, and 010 for eight.
bool is_decimal(const std::string& text) {
  const std::optional<double> number = vision::parse_number(text);
  const std::string_view digits = std::string_view(text).substr(text.starts_with('-'));
  const bool has_leading_zero = digits.size() > 1 && digits[0] == '0' && digits[1] >= '0' && digits[1] <= '9';
  return number && std::isfinite(*number) && !has_leading_zero && text[0] != '+';
}

/// An empty value is a variable of the shell that was not set; the name of an option is where a value was forgotten.
void refuse_odd_values(const CLI::App& command) {
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& value : option->results()) {
      if (value.empty()) throw InvalidArgument(option->get_name() + " \"\": is empty: give a value, or leave it out");
      if (value.starts_with('-') && command.get_option_no_throw(value)) {
        throw InvalidArgument(fmt::format("{0}: its value is missing, as {1} is an option; write ./{1} if it is a name",
                                          option->get_name(), value));
      }
      if (!takes_number(*option) || is_decimal(value)) continue;
      throw InvalidArgument(fmt::format("{} \"{}\": write a decimal number without blanks, plus or leading zeros",
                                        option->get_name(), value));
    }
  }
}

/// A result that the standard output did not take, for example for a full disk, is no result.
int flushed(int code) {
  const int error = standard_output_error();
  if (error == 0 || error == EPIPE) return code;  // a reader that goes has read enough
  return fail(kFailed, fmt::format("the standard output cannot be written: {}", std::strerror(error)));
}

int parse_and_run(int argc, const char* const* argv, const Package* package) {
  if (!package && is_for_python(argc, argv)) become_python(argc, argv);
  CLI::App program(
      "Dense disparity from stereo video: predicts each frame's disparity from the last one and the camera's motion,\n"
      "searches only where the prediction says, and runs on any OpenCL device.",
      "egosgm");
  program.set_version_flag("--version", "egosgm " EGOSGM_VERSION);
  program.require_subcommand(1);
  program.get_formatter()->column_width(38);
  program.footer(
      "Try it:\n"
      "  egosgm synth --out street\n"
      "  egosgm run --odometry street --out result --write color\n"
      "  egosgm eval --estimate result --truth street/truth/left_disp_noc\n"
      "Exit codes: 0 done, 1 the device, the disk or the program failed, 2 wrong arguments or input, 130 interrupted.\n"
      "Who stops reading the output (`| head`) ends the printing, not the work.");
  const auto take_over = [&](const std::string& why) { become_python(argc, argv, why); };
  const auto read_calibration = [&](const auto&, const auto&,
                                    const std::string& why_not) -> std::optional<Calibration> {
    become_python(argc, argv, why_not);
  };
  const Package hooks = package ? *package : Package{take_over, {}, {}, read_calibration, {}};
  const Command commands[] = {
      add_run(program, hooks),      add_eval(program),    add_devices(program), add_synth(program),
      add_odometry(program, hooks), add_compile(program), add_tune(program)};
  for (const auto& [name, help] : python_tools()) program.add_subcommand(name, help);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const bool is_no_command = program.get_subcommands().empty() && argc > 1 && argv[1][0] != '-';
    if (error.get_exit_code() == 0 && !is_no_command) return flushed(program.exit(error));  // --help, --version
    return refuse_arguments(program, error);
  }
  const auto chosen =
      std::find_if(std::begin(commands), std::end(commands), [](const Command& c) { return c.arguments->parsed(); });
  refuse_odd_values(*chosen->arguments);
  return flushed(chosen->run());
}

/// A call that an interrupt came into has not failed: PoCL's compiler takes one for itself, too, and a pipe that is
/// waited for ends.
int failed_or_interrupted(int code, const std::string& what) {
  if (interrupted()) return say("egosgm: interrupted"), kInterrupted;
  return fail(code, what);
}

}  // namespace

int run_program(int argc, const char* const* argv, const Package* package) {
  std::signal(SIGXFSZ, SIG_IGN);  // a file beyond `ulimit -f` is to be an error of its write, as a full disk is
  open_standard_streams();
  const std::shared_ptr<void> at_end(nullptr, [](void*) { release_interrupts(); });
  try {
    return parse_and_run(argc, argv, package);
  } catch (const InvalidArgument& error) {
    return failed_or_interrupted(kBadInput, error.what());
  } catch (const Error& error) {  // of a file or of the device
    return failed_or_interrupted(kFailed, error.what());
  } catch (
      const std::filesystem::filesystem_error& error) {  // a loop of links, a name too long, a folder without rights
    return fail(kBadInput, error.what() + std::string(": give another path"));
  } catch (const std::bad_alloc&) {
    return fail(kFailed, "out of memory: choose smaller images or fewer --disparities");
  } catch (const std::system_error& error) {  // more was printed than the output's buffer holds
    return error.code().value() == EPIPE && std::ferror(stdout) ? kOk : fail(kFailed, error.what());
  } catch (const std::exception& error) {
    return fail(kFailed, fmt::format("{} (this is a defect of the program: please report it)", error.what()));
  }
}

}  // namespace egosgm::app
