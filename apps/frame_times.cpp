// SPDX-License-Identifier: Apache-2.0
#include "apps/frame_times.h"

#include <fmt/core.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <sstream>

#include "egosgm/error.h"
#include "egosgm/vision/file_io.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxBytes = std::size_t{1} << 28;

fs::path times_file(const fs::path& left) {
  fs::path folder = fs::absolute(left).parent_path();
  for (int level = 0; level < 3; ++level, folder = folder.parent_path()) {
    for (const char* name : {"times.txt", "timestamps.txt"}) {
      if (fs::is_regular_file(folder / name)) return folder / name;
    }
  }
  return {};
}

std::optional<double> seconds_of(const std::string& row) {
  int year = 0, month = 0, day = 0, hour = 0, minute = 0;
  double second = 0;
  if (std::sscanf(row.c_str(), "%d-%d-%d%*[ T]%d:%d:%lf", &year, &month, &day, &hour, &minute, &second) == 6) {
    const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                           std::chrono::day(static_cast<unsigned>(day))};
    if (!date.ok()) return std::nullopt;
    const auto days = static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count());
    return 86400 * days + 3600.0 * hour + 60.0 * minute + second;
  }
  char* end = nullptr;
  const double value = std::strtod(row.c_str(), &end);
  const bool whole = end != row.c_str() && std::string(end).find_first_not_of(" \t\r") == std::string::npos;
  return whole && std::isfinite(value) ? std::optional<double>(value) : std::nullopt;
}

}  // namespace

FrameTimes frame_times(const vision::StereoSequence& sequence) {
  FrameTimes times{times_file(sequence.frames.front().left), {}};
  if (times.file.empty()) return times;
  std::istringstream text(vision::read_file(times.file, kMaxBytes));
  std::vector<double> rows;
  for (std::string row; std::getline(text, row);) {
    if (row.find_first_not_of(" \t\r") == std::string::npos) continue;
    const std::optional<double> seconds = seconds_of(row);
    if (!seconds) {
      throw InvalidArgument(fmt::format("{}: row {}: \"{}\" is no time: seconds, or YYYY-MM-DD HH:MM:SS",
                                        times.file.string(), rows.size() + 1, row));
    }
    rows.push_back(*seconds);
  }
  const auto last = static_cast<std::size_t>(sequence.frames.back().number);
  if (rows.size() > last) {
    for (const vision::StereoFrame& frame : sequence.frames) {
      times.seconds.push_back(rows[static_cast<std::size_t>(frame.number)]);
    }
  } else if (rows.size() == sequence.frames.size()) {
    times.seconds = std::move(rows);
  } else {
    throw InvalidArgument(fmt::format("{}: holds {} times, but there are {} frames up to number {}: is it complete?",
                                      times.file.string(), rows.size(), sequence.frames.size(), last));
  }
  return times;
}

}  // namespace egosgm::app
