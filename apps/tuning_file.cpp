// SPDX-License-Identifier: Apache-2.0
#include "apps/tuning_file.h"

#include <fmt/core.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <system_error>

#include "egosgm/error.h"
#include "host/json_text.h"
#include "host/tuning_defaults.h"
#include "vision/file_io.h"

namespace egosgm::app {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxBytes = 1 << 20;

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& what) {
  throw InvalidArgument(
      fmt::format("{}: {}: move it away and run egosgm tune again, or give --tuning none", file.string(), what));
}

/// Of one device among others.
[[noreturn]] void refuse_entry(const std::filesystem::path& file, const std::string& device, const std::string& what) {
  throw InvalidArgument(fmt::format("{}: of \"{}\": {}: take that entry out of the file and run egosgm tune again",
                                    file.string(), device, what));
}

Json read(const std::filesystem::path& file) {
  Json json = parse_json(vision::read_file(file, kMaxBytes), file);
  if (!json.is_object()) refuse(file, "not a tuning file");
  json.erase("digest");  // of earlier versions
  return json;
}

Tuning tuning_of(const std::string& device, const Json& sizes, const std::filesystem::path& file) {
  if (!sizes.is_object()) refuse(file, "not a tuning file");
  Tuning tuning;
  try {
    for (const auto& [name, value] : sizes.items()) {
      set_tuning(tuning, name, value.is_string() ? value.get<std::string>() : value.dump());
    }
    tuning.validate();
  } catch (const InvalidArgument& error) {
    refuse_entry(file, device, error.what());
  }
  return tuning;
}

}  // namespace

std::filesystem::path user_tuning_file() {
  const char* config = std::getenv("XDG_CONFIG_HOME");
  const char* home = std::getenv("HOME");
  if (config && *config) return std::filesystem::path(config) / "egosgm/tuning.json";
  return home && *home ? std::filesystem::path(home) / ".config/egosgm/tuning.json" : std::filesystem::path();
}

std::optional<Tuning> kept_tuning(const std::filesystem::path& file, const DeviceInfo& device) {
  const Json json = read(file);
  const auto sizes = json.find(tuning_key(device));
  return sizes == json.end() ? std::nullopt : std::optional(tuning_of(sizes.key(), *sizes, file));
}

Device tuned_by_argument(const Device& device, const std::string& argument) {
  if (argument == "none") return device;
  const std::filesystem::path file = argument.empty() ? user_tuning_file() : std::filesystem::path(argument);
  std::error_code none;  // the home folder may be one that this user cannot read
  if (argument.empty() && !std::filesystem::exists(file, none)) return device;
  const std::optional<Tuning> sizes = kept_tuning(file, device.info());
  return sizes ? device.with_tuning(*sizes) : device;
}

void expect_tuning_file(const std::filesystem::path& file) {
  if (file.has_parent_path()) vision::make_folder(file.parent_path());
  vision::expect_writable(file);
  if (!std::filesystem::is_regular_file(file)) return;
  const Json all = read(file);
  for (const auto& [device, sizes] : all.items()) tuning_of(device, sizes, file);
}

void store_tuning(const std::filesystem::path& file, const DeviceInfo& device, const Tuning& tuning) {
  expect_tuning_file(file);
  Json json = std::filesystem::is_regular_file(file) ? read(file) : Json::object();
  Json sizes = Json::object();
  for (const auto& [name, value] : list_tuning(tuning)) {
    const Json number = Json::parse(value, nullptr, /*allow_exceptions=*/false);
    sizes[name] = number.is_discarded() ? Json(value) : number;
  }
  json[tuning_key(device)] = sizes;
  vision::write_file(file, dumped(json, 2) + "\n");
}

}  // namespace egosgm::app
