// SPDX-License-Identifier: Apache-2.0
#include "egosgm/tuning.h"

#include <bit>
#include <charconv>

#include "egosgm/error.h"
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

Tuning with_defaults(Tuning tuning, const DeviceInfo& device) {
  const bool is_small = device.compute_units <= kFewComputeUnits;
  const Tuning& defaults = device.type == DeviceType::kGpu ? kGpuTuning : is_small ? kSmallCpuTuning : kCpuTuning;
  for (const Size& size : kSizes) {
    if (tuning.*size.value == 0) tuning.*size.value = defaults.*size.value;
  }
  return tuning;
}

}  // namespace egosgm
