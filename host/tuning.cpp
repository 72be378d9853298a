// SPDX-License-Identifier: Apache-2.0
#include "egosgm/tuning.h"

#include <bit>
#include <charconv>
#include <nlohmann/json.hpp>

#include "egosgm/error.h"
#include "host/embedded_files.h"
#include "host/option_text.h"
#include "host/tuning_defaults.h"

namespace egosgm {
namespace {

struct Size {
  const char* name;
  int Tuning::*value;
  int least, most;
};

constexpr Size kSizes[] = {{"tile_width", &Tuning::tile_width, 16, 1024},
                           {"tile_height", &Tuning::tile_height, 1, 1024},
                           {"block_lanes", &Tuning::block_lanes, 16, 32},
                           {"path_lanes", &Tuning::path_lanes, 1, 256},
                           {"path_lines", &Tuning::path_lines, 1, 256},
                           {"warp_band_rows", &Tuning::warp_band_rows, 1, 4096},
                           {"speckle_strip_rows", &Tuning::speckle_strip_rows, 1, 4096},
                           {"row_group", &Tuning::row_group, 1, 256}};

void expect(bool allowed, const std::string& what, int value, const std::string& remedy) {
  if (!allowed) throw InvalidArgument("tuning " + what + " is " + std::to_string(value) + ": choose " + remedy);
}

}  // namespace

void Tuning::validate() const {
  for (const Size& size : kSizes) {
    const int value = this->*size.value;
    expect(value == 0 || (value >= size.least && value <= size.most), size.name, value,
           "0 (the device's default) or " + std::to_string(size.least) + " to " + std::to_string(size.most));
  }
  expect((tile_width == 0) == (tile_height == 0), "tile_height", tile_height, "tile_width and tile_height together");
  expect(tile_height <= tile_width, "tile_height", tile_height, "at most tile_width");
  expect(block_lanes == 0 || std::has_single_bit(static_cast<unsigned>(block_lanes)), "block_lanes", block_lanes,
         "16 or 32");
  expect((path_lanes == 0) == (path_lines == 0), "path_lines", path_lines, "path_lanes and path_lines together");
  expect(path_lanes == 0 || std::has_single_bit(static_cast<unsigned>(path_lanes)), "path_lanes", path_lanes,
         "a power of two");
  expect(path_lanes * path_lines <= 256, "path_lines", path_lines, "path_lanes * path_lines up to 256");
}

std::vector<NamedOption> list_tuning(const Tuning& tuning) {
  std::vector<NamedOption> list{{"scheduling", option_text::text_of(tuning.scheduling)}};
  for (const Size& size : kSizes) list.push_back({size.name, std::to_string(tuning.*size.value)});
  return list;
}

void set_tuning(Tuning& tuning, std::string_view name, std::string_view value) {
  if (name == "scheduling") return option_text::parse(name, value, tuning.scheduling);
  for (const Size& size : kSizes) {
    if (name != size.name) continue;
    int parsed = 0;
    const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), parsed);
    if (error != std::errc() || end != value.data() + value.size())
      throw InvalidArgument("tuning " + std::string(name) + ": \"" + std::string(value) + "\" is not a whole number");
    tuning.*size.value = parsed;
    return;
  }
  std::string all = "scheduling";
  for (const Size& size : kSizes) all += ", " + std::string(size.name);
  throw InvalidArgument("no tuning named \"" + std::string(name) + "\": choose from " + all);
}

const TuningDefaults& tuning_defaults() {
  static const TuningDefaults table = [] {
    const auto json = nlohmann::json::parse(embedded_files().at("tuning_defaults.json"));
    TuningDefaults read;
    for (const auto& [key, sizes] : json.items()) {
      for (const auto& [name, value] : sizes.items()) {
        set_tuning(read[key], name, value.is_string() ? value.get<std::string>() : value.dump());
      }
    }
    return read;
  }();
  return table;
}

Tuning with_defaults(Tuning tuning, const DeviceInfo& device, const TuningDefaults& defaults) {
  const char* const of_class = device.type == DeviceType::kGpu            ? "GPU"
                               : device.compute_units <= kFewComputeUnits ? "CPU of few units"
                                                                          : "CPU";
  for (const std::string& key : {tuning_key(device), device.name, std::string(of_class)}) {
    const auto found = defaults.find(key);
    if (found == defaults.end()) continue;
    const Tuning& given = found->second;
    if (tuning.scheduling == Scheduling::kAutomatic) tuning.scheduling = given.scheduling;
    for (const Size& size : kSizes) {
      if (tuning.*size.value == 0) tuning.*size.value = given.*size.value;
    }
  }
  return tuning;
}

}  // namespace egosgm
