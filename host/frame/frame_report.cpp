// SPDX-License-Identifier: Apache-2.0
#include "host/frame/frame_report.h"

#include <algorithm>
#include <numeric>

#include "host/stages/search_band.h"

namespace egosgm {
namespace {

std::vector<StageTime> stage_times(const std::vector<ocl::Context::Finished>& finished) {
  std::vector<StageTime> stages;
  for (const auto& command : finished) {
    const auto known =
        std::find_if(stages.begin(), stages.end(), [&](const StageTime& s) { return s.stage == command.stage; });
    if (known == stages.end()) {
      stages.push_back({command.stage, command.ms});
    } else {
      known->ms += command.ms;
    }
  }
  return stages;
}

double matched_cells(const MatchedFrame& frame) {
  const int views = static_cast<int>(frame.row_sums.size()) / frame.size.height;
  std::uint64_t cells = frame.parts.coarse_cells;
  for (int view = 0; view < views; ++view) {
    for (const Stripe& stripe : *frame.parts.stripes) {
      const std::size_t first = static_cast<std::size_t>(view) * frame.size.height + stripe.first_row;
      for (int row = 0; row < stripe.rows; row += frame.parts.row_step) cells += frame.row_sums[first + row].cells;
    }
  }
  return static_cast<double>(frame.parts.passes) * static_cast<double>(cells);
}

}  // namespace

void report_matching(const MatchedFrame& frame, FrameReport& report) {
  const double cells = static_cast<double>(frame.row_sums.size()) * frame.size.width * frame.range.count;
  const std::uint32_t whole_row =
      static_cast<std::uint32_t>(frame.size.width * SearchBand::max_chunks(frame.range)) * EGOSGM_LANES;
  std::uint64_t predicted_pixels = 0, pixels = 0;
  report.searched_everything = true;
  for (int y = 0; y < frame.size.height; y += frame.parts.row_step) {
    predicted_pixels += frame.row_sums[y].predicted;
    pixels += static_cast<std::uint64_t>(frame.size.width);
    report.searched_everything = report.searched_everything && frame.row_sums[y].cells == whole_row;
  }
  report.search_fraction = matched_cells(frame) / cells;
  report.predicted_fraction =
      frame.has_prediction ? static_cast<double>(predicted_pixels) / static_cast<double>(pixels) : 0;
}

void report_stages(const std::vector<ocl::Context::Finished>& finished, FrameReport& report) {
  report.launches =
      static_cast<int>(std::count_if(finished.begin(), finished.end(), [](const auto& f) { return f.is_launch; }));
  report.stages = stage_times(finished);
}

void report_commands(ocl::Context& context, const std::vector<ocl::Command>& commands, FrameReport& report) {
  const std::vector<ocl::Context::Times> times = context.times_of(commands);
  for (std::size_t i = 0; i < commands.size(); ++i) {
    report.commands.push_back({commands[i].stage, commands[i].name, commands[i].queue, times[i].queued,
                               times[i].submitted, times[i].started, times[i].ended});
  }
}

}  // namespace egosgm
