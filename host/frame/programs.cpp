// SPDX-License-Identifier: Apache-2.0
#include "egosgm/programs.h"

#include "host/frame/frame_queue.h"
#include "host/ocl/errors.h"

namespace egosgm {
namespace {

/// With every stage that can be on.
PipelineOptions all_stages(PipelineOptions options) {
  options.temporal = true;
  options.search = SearchMode::kBand;
  options.coarse_match.enabled = true;
  options.vertical_alignment.enabled = true;
  options.median_filter.enabled = true;
  options.sad_check.max_difference = 1;
  options.output_variance.enabled = true;
  return options;
}

}  // namespace

std::vector<ProgramFile> compile_programs(const Device& device, const PipelineOptions& options) {
  options.validate();
  return ocl::translated("compile", [&] {
    // Of the least size: no define depends on it.
    const Calibration any{.fx = 1, .fy = 1, .cx = 0, .cy = 0, .baseline_m = 1};
    FrameQueue frames(any, shared::ImageSize{1, 1}, all_stages(options), device, PixelType::kU8);
    frames.method().prepare(PixelType::kU16);
    return ocl::files_of(device.handle().device, frames.context().programs());
  });
}

}  // namespace egosgm
