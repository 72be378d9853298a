// SPDX-License-Identifier: Apache-2.0
#include "bench/report.h"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "commit.h"  // written by the build
#include "vision/file_io.h"

namespace egosgm::bench {
namespace {

using Json = nlohmann::ordered_json;

[[noreturn]] void refuse(const std::string& message) {
  std::fprintf(stderr, "%s\n", message.c_str());
  std::exit(2);
}

int positive(const std::string& name, const std::string& text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 1) {
    refuse(name + " " + text + ": give a whole number, 1 or more");
  }
  return value;
}

shared::ImageSize parse_size(const std::string& text) {
  shared::ImageSize size{};
  int read = 0;
  if (std::sscanf(text.c_str(), "%dx%d%n", &size.width, &size.height, &read) != 2 ||
      static_cast<std::size_t>(read) != text.size() || size.width < 1 || size.height < 1) {
    refuse("--size " + text + ": write WIDTHxHEIGHT, for example 1242x375");
  }
  return size;
}

/// "--name=value", or "--name" and the next argument.
std::optional<std::string> value_of(const char* name, int argc, char** argv, int& i) {
  const std::size_t length = std::strlen(name);
  if (std::strncmp(argv[i], name, length) != 0) return std::nullopt;
  if (argv[i][length] == '=') return argv[i] + length + 1;
  if (argv[i][length] != '\0') return std::nullopt;
  if (i + 1 == argc) refuse(std::string(name) + ": its value is missing");
  return argv[++i];
}

Json json_of(const Row& row) {
  Json json{{"name", row.name},
            {"width", row.size.width},
            {"height", row.size.height},
            {"disparities", row.disparities},
            {"median_ms", row.median_ms}};
  for (const auto& [counter, value] : row.more) {
    const auto whole = static_cast<std::int64_t>(value);
    static_cast<double>(whole) == value ? json[counter] = whole : json[counter] = value;
  }
  return json;
}

std::string now() {
  const std::time_t time = std::time(nullptr);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", std::gmtime(&time));
  return text;
}

}  // namespace

void refuse_argument(const std::string& argument) { refuse(argument + ": no such argument: see --help"); }

Arguments parse_arguments(int argc, char** argv, const char* help, int default_rounds, std::vector<char*>* rest) {
  Arguments arguments;
  arguments.rounds = default_rounds;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--help") == 0) {
      std::fputs(help, stdout);
      std::exit(0);
    }
    if (std::strcmp(argv[i], "--count") == 0) {
      arguments.counts = true;
    } else if (const auto text = value_of("--size", argc, argv, i)) {
      arguments.size = parse_size(*text);
    } else if (const auto count = value_of("--disparities", argc, argv, i)) {
      arguments.disparities = positive("--disparities", *count);
    } else if (const auto rounds = value_of("--rounds", argc, argv, i)) {
      arguments.rounds = positive("--rounds", *rounds);
    } else if (const auto threads = value_of("--threads", argc, argv, i)) {
      arguments.threads = positive("--threads", *threads);
    } else if (const auto json = value_of("--json", argc, argv, i)) {
      arguments.json = *json;
    } else if (const auto bits = value_of("--bits", argc, argv, i)) {
      arguments.bits = *bits;
    } else if (const auto setting = value_of("--set", argc, argv, i)) {
      arguments.settings.push_back(*setting);
    } else if (rest) {
      rest->push_back(argv[i]);
    } else {
      refuse_argument(argv[i]);
    }
  }
  // PoCL 3 reads the first, later ones the second. What the caller has set stays.
  const std::string threads = std::to_string(arguments.threads);
  setenv("POCL_MAX_PTHREAD_COUNT", threads.c_str(), 0);
  setenv("POCL_CPU_MAX_CU_COUNT", threads.c_str(), 0);
  return arguments;
}

void add_row(Row row, std::vector<Row>& rows) {
  std::printf("%-20s %5dx%-5d D %4d %10.3f ms", row.name.c_str(), row.size.width, row.size.height, row.disparities,
              row.median_ms);
  for (const auto& [counter, value] : row.more) std::printf("  %s %.4g", counter.c_str(), value);
  std::printf("\n");
  std::fflush(stdout);
  rows.push_back(std::move(row));
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

void print_machine(const Machine& machine) {
  std::printf("%s (%s), driver %s, %d compute units, commit %s\n", machine.device.name.c_str(),
              machine.device.version.c_str(), machine.device.driver.c_str(), machine.device.compute_units,
              EGOSGM_COMMIT);
  if (!machine.input.empty()) std::printf("input: %s\n", machine.input.c_str());
  if (machine.copy_gb_s > 0) std::printf("device copy: %.1f GB/s, read and written\n", machine.copy_gb_s);
}

void write_json(const std::string& file, const Machine& machine, const std::vector<Row>& rows) {
  Json json{{"device", machine.device.name},
            {"driver", machine.device.driver},
            {"version", machine.device.version},
            {"compute_units", machine.device.compute_units},
            {"threads", machine.threads},
            {"commit", EGOSGM_COMMIT},
            {"date", now()},
            {"input", machine.input},
            {"copy_gb_s", machine.copy_gb_s}};
  for (const auto& [name, value] : machine.more) json[name] = value;
  json["rows"] = Json::array();
  for (const Row& row : rows) json["rows"].push_back(json_of(row));
  vision::write_file(file, json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

int guarded(const char* program, int (*main_body)(int, char**), int argc, char** argv) {
  try {
    return main_body(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", program, error.what());
    return 1;
  }
}

}  // namespace egosgm::bench
