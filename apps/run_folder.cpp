// SPDX-License-Identifier: Apache-2.0
#include "apps/run_folder.h"

#include <fmt/core.h>

#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>

#include "egosgm/error.h"
#include "host/json_text.h"
#include "vision/file_io.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

fs::path report_of(const fs::path& path) {
  std::error_code error;
  fs::path folder = fs::weakly_canonical(path, error);
  const int levels = fs::is_directory(folder, error) ? 2 : 3;  // OUT/disparity, OUT/disparity/000010.png
  for (int level = 0; level < levels; ++level, folder = folder.parent_path()) {
    if (fs::is_regular_file(folder / "report.json", error)) return folder / "report.json";
  }
  return {};
}

constexpr int kMaxNumber = std::numeric_limits<int>::max();
constexpr int kMaxFrames = 2'000'000;  // as many rows as a text of poses may have

/// From 0 to kMaxNumber, or -1.
int integer(const Json& json, const char* key) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_number_unsigned()) return -1;
  const auto number = found->get<std::uint64_t>();
  return number <= kMaxNumber ? static_cast<int>(number) : -1;
}

/// All numbers of the sequence that the run's were chosen from, where they have no gaps.
std::vector<int> numbers_of(const Json& run) {
  const auto sequence = run.find("sequence");
  if (sequence == run.end() || !sequence->is_object()) return {};
  const int first = integer(*sequence, "first_frame"), frames = integer(*sequence, "frames");
  if (first < 0 || frames < 1 || frames > kMaxFrames || integer(*sequence, "last_frame") - first != frames - 1)
    return {};
  std::vector<int> numbers(static_cast<std::size_t>(frames));
  std::iota(numbers.begin(), numbers.end(), first);
  return numbers;
}

}  // namespace

std::optional<vision::StereoSequence> frames_of_run(const fs::path& path) {
  const fs::path file = report_of(path);
  if (file.empty()) return std::nullopt;
  const Json run = parse_json(vision::read_file(file, kMaxJsonBytes), file);
  if (run.is_discarded()) throw InvalidArgument(file.string() + ": is no JSON: it was cut or edited; run it again");
  if (!run.is_object() || !run.contains("frames")) return std::nullopt;
  vision::StereoSequence sequence;
  for (const Json& entry : run["frames"]) {
    if (!entry.is_object() || integer(entry, "frame") < 0) return std::nullopt;
    vision::StereoFrame& frame = sequence.frames.emplace_back();
    frame.number = integer(entry, "frame");
    frame.name = entry.contains("name") && entry["name"].is_string() ? entry["name"].get<std::string>()
                                                                     : fmt::format("{:06}", frame.number);
    if (entry.contains("left") && entry["left"].is_string()) frame.left = entry["left"].get<std::string>();
  }
  if (sequence.frames.empty()) return std::nullopt;
  sequence.numbers = numbers_of(run);
  return sequence;
}

}  // namespace egosgm::app
