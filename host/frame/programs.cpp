// SPDX-License-Identifier: Apache-2.0
#include "egosgm/programs.h"

#include "host/frame/frame_queue.h"
#include "host/ocl/errors.h"

namespace egosgm {

std::vector<ProgramFile> compile_programs(const Device& device, const PipelineOptions& options) {
  options.validate();
  return ocl::translated("compile", [&] {
    // Of the least size: no define depends on it.
    const Calibration any{.fx = 1, .fy = 1, .cx = 0, .cy = 0, .baseline_m = 1};
    const FrameQueue frames(any, shared::ImageSize{1, 1}, options, device);
    return ocl::files_of(device.handle().device, frames.context().programs());
  });
}

}  // namespace egosgm
