// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <map>
#include <string>
#include <vector>

#include "bench/street.h"
#include "host/method/method.h"

namespace egosgm::bench {

/// A launch, or another command, of a frame.
struct CommandTime {
  const char* stage;
  const char* name;  // of the kernel, or "fill", ...
  bool is_launch;
  double ms;  // on the device
};

/// What a frame took [ms].
struct FrameTimes {
  std::map<std::string, double> device, wall;  // by stage, by step
  std::vector<CommandTime> commands;

  double device_ms() const;
};

/// A frame of the street, as a pipeline with default options runs it, that can be run again and again.
class StreetFrame {
 public:
  /// Runs one of each kind.
  StreetFrame(ocl::Context& context, const Street& street, int disparities,
              Scheduling scheduling = Scheduling::kAutomatic);

  const FrameTimes& steady() { return run(after_, belief_); }
  const FrameTimes& full_range();
  /// Of the last frame that searched everything, and of the last steady one, both views.
  double full_range_cells() const { return full_range_cells_; }
  double steady_cells() const { return cells(options_.banded_sgm.row_step); }

  /// A checksum (FNV-1a) of what the last steady frame found in the left view.
  std::string bits() const;

 private:
  const FrameTimes& run(Belief& after, const Belief& before);
  void look(Step step);
  double cells(int row_step) const;

  ocl::Context& context_;
  const shared::ImageSize size_;
  const Motion motion_;
  const MethodOptions options_;
  Method method_;
  FrameImages images_;
  Map disparity_, variance_;
  Belief belief_, after_;
  FrameTimes times_;
  double full_range_cells_ = 0;
  std::chrono::steady_clock::time_point last_;
};

}  // namespace egosgm::bench
