// SPDX-License-Identifier: Apache-2.0
#include "bench/street_frame.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstdio>
#include <numeric>

#include "host/tuning_defaults.h"
#include "kernels/method.h"

namespace egosgm::bench {
namespace {

using Clock = std::chrono::steady_clock;

constexpr const char* kSteps[] = {"predict", "align", "search", "match", "refine_alignment", "fuse", "publish"};

MethodOptions options_of(int disparities, Scheduling scheduling) {
  MethodOptions options;
  options.disparities = disparities;
  options.banded_sgm.scheduling = scheduling;
  return options;
}

}  // namespace

double FrameTimes::device_ms() const {
  return std::accumulate(device.begin(), device.end(), 0.0,
                         [](double total, const auto& stage) { return total + stage.second; });
}

StreetFrame::StreetFrame(ocl::Context& context, const Street& street, int disparities, Scheduling scheduling)
    : context_(context),
      size_(street.size),
      motion_(street.motion),
      options_(options_of(disparities, scheduling)),
      method_(context, size_, street.calibration, options_, with_defaults({}, Device::select().info())),
      images_{ocl::Buffer<cl_uchar>(context, street.images.size()), PixelType::kU8},
      disparity_(context, 2 * pixel_count(size_)),
      variance_(context, 2 * pixel_count(size_)),
      belief_(context, size_),
      after_(context, size_) {
  images_.pixels.write(context, street.images);
  method_.prepare(images_.type);
  method_.observer = [this](Step step) { look(step); };
  full_range();
  belief_ = std::exchange(after_, belief_);
  belief_.maps.disparity.write(context, street.disparity);
  belief_.maps.variance.write(context, street.variance);
  belief_.evidence.fill(context, EGOSGM_EVIDENCE_MOST);
  steady();
}

const FrameTimes& StreetFrame::full_range() {
  Belief nothing = belief_;
  nothing.forget(Unpredicted::kFirstFrame);
  run(after_, nothing);
  full_range_cells_ = cells(/*row_step=*/1);
  return times_;
}

std::string StreetFrame::bits() const {
  const auto pixels = static_cast<std::ptrdiff_t>(pixel_count(size_));
  std::uint64_t hash = 14695981039346656037u;
  const std::vector<float> belief = after_.maps.disparity.read(context_);
  std::vector<float> filters = after_.maps.variance.read(context_);
  for (std::size_t i = 0; i < belief.size(); ++i) {
    if (!(belief[i] > EGOSGM_INVALID_DISPARITY)) filters[i] = 0;  // there it means nothing
  }
  for (const std::vector<float>& values : {disparity_.read(context_), filters, variance_.read(context_)}) {
    std::for_each(values.begin(), values.begin() + pixels, [&](float value) {
      for (const auto byte : std::bit_cast<std::array<unsigned char, sizeof value>>(value))
        hash = (hash ^ byte) * 1099511628211u;
    });
  }
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

const FrameTimes& StreetFrame::run(Belief& after, const Belief& before) {
  times_ = {};
  const Plan plan = plan_of(options_, before.why_not, before.offset.is_known, motion_, {Output::kVariance});
  last_ = Clock::now();
  method_.frame(plan, images_, before, after, {disparity_, variance_});
  return times_;
}

void StreetFrame::look(Step step) {
  const std::vector<ocl::Command> commands = context_.take_commands();
  const std::vector<ocl::Context::Finished> finished = context_.wait(commands);
  for (std::size_t i = 0; i < commands.size(); ++i) {
    times_.device[finished[i].stage] += finished[i].ms;
    times_.commands.push_back({finished[i].stage, commands[i].name, finished[i].is_launch, finished[i].ms});
  }
  const Clock::time_point now = Clock::now();
  times_.wall[kSteps[static_cast<int>(step)]] += std::chrono::duration<double, std::milli>(now - last_).count();
  last_ = now;
}

double StreetFrame::cells(int row_step) const {
  const std::vector<shared::RowSum> rows = method_.workspace().bands.row_sums.read(context_);
  double sum = 0;
  for (int y = 0; y < size_.height; y += row_step) sum += rows[y].cells + rows[size_.height + y].cells;
  return sum;
}

}  // namespace egosgm::bench
