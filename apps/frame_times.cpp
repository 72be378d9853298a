// SPDX-License-Identifier: Apache-2.0
#include "apps/frame_times.h"

#include <fmt/core.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>

#include "egosgm/error.h"
#include "host/vision/file_io.h"
#include "host/vision/text_rows.h"

namespace egosgm::app {
namespace {

constexpr std::size_t kMaxBytes = std::size_t{1} << 28;

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
  FrameTimes times{sequence.times_file, {}};
  if (times.file.empty()) return times;
  const std::string text = vision::read_file(times.file, kMaxBytes);
  std::vector<double> rows;
  for (const vision::TextRow& row : vision::split_rows(text, times.file)) {
    if (vision::trim(row.text).empty()) continue;
    const std::optional<double> seconds = seconds_of(std::string(row.text));
    if (!seconds) {
      vision::refuse_row(times.file, row.number,
                         vision::quoted(row.text) + " is no time: give seconds, or YYYY-MM-DD HH:MM:SS");
    }
    rows.push_back(*seconds);
  }
  for (const std::size_t row : vision::rows_of_frames(sequence, rows.size(), times.file, "times")) {
    times.seconds.push_back(rows[row]);
  }
  return times;
}

}  // namespace egosgm::app
