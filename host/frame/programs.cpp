// SPDX-License-Identifier: Apache-2.0
#include "egosgm/programs.h"

#include <map>
#include <utility>

#include "host/frame/frame_queue.h"
#include "host/ocl/errors.h"
#include "host/tuning_defaults.h"

namespace egosgm {
namespace {

/// With every stage that can be on.
MethodOptions all_stages(MethodOptions options) {
  options.temporal = true;
  options.search = SearchMode::kBand;
  options.coarse_match.enabled = true;
  options.vertical_alignment.enabled = true;
  options.median_filter.enabled = true;
  options.sad_check.max_difference = 1;
  options.output_variance.enabled = true;
  return options;
}

// Of images of the least size, as no define depends on it, and of both types.
std::vector<std::pair<ocl::ProgramSource, cl::Program>> programs_of(const Device& device,
                                                                    const PipelineOptions& options) {
  const Calibration any{.fx = 1, .fy = 1, .cx = 0, .cy = 0, .baseline_m = 1};
  FrameQueue frames(any, shared::ImageSize{1, 1}, all_stages(options), device, PixelType::kU8);
  for (const PixelType type : {PixelType::kU8, PixelType::kU16}) frames.method().prepare(type, {.reasons = true});
  return frames.context().programs();
}

}  // namespace

std::vector<ProgramFile> compile_programs(const Device& device, const PipelineOptions& options) {
  options.validate();
  return ocl::translated("compile",
                         [&] { return ocl::files_of(device.handle().device, programs_of(device, options)); });
}

std::vector<ProgramText> list_programs(const Device& device, const PipelineOptions& options) {
  options.validate();
  return ocl::translated("compile", [&] {
    // With the sizes of devices with fewer and with more compute units, too.
    std::vector<Device> devices{device};
    if (device.info().type != DeviceType::kGpu) {
      for (const Tuning& tuning : {kCpuTuning, kSmallCpuTuning}) devices.push_back(device.with_tuning(tuning));
    }
    std::map<std::pair<std::string, std::string>, std::string> texts;
    for (const Device& each : devices) {
      for (const auto& [source, program] : programs_of(each, options)) {
        const ProgramText text = ocl::portable(source);
        texts[{text.kernel_file, text.options}] = text.text;
      }
    }
    std::vector<ProgramText> list;
    for (const auto& [key, text] : texts) list.push_back({key.first, text, key.second});
    return list;
  });
}

}  // namespace egosgm
