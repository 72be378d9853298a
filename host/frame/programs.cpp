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

/// Asks for all that a pipeline with these options may need: of images of the least size, as no define depends on it,
/// and of both types.
std::vector<ocl::ProgramSource> sources_of(ocl::Context& context, const Device& device,
                                           const PipelineOptions& options) {
  const Calibration any{.fx = 1, .fy = 1, .cx = 0, .cy = 0, .baseline_m = 1};
  const Tuning tuning = with_defaults(device.handle().tuning, device.info());
  for (const bool track_right : {true, false}) {
    MethodOptions all = all_stages(method_of(options, tuning));
    all.track_right = track_right;
    Method method(context, {1, 1}, any, all, tuning);
    for (const PixelType type : {PixelType::kU8, PixelType::kU16})
      method.prepare(type, {Output::kReason, Output::kDynamic});
  }
  return context.sources();
}

}  // namespace

std::vector<ProgramFile> compile_programs(const Device& device, const PipelineOptions& options) {
  options.validate();
  return ocl::translated("compile", [&] {
    ocl::Context context = context_on(device.handle());
    std::vector<std::pair<ocl::ProgramSource, cl::Program>> programs;
    for (const ocl::ProgramSource& source : sources_of(context, device, options)) {
      programs.emplace_back(source, context.built(source));
    }
    return ocl::files_of(device.handle().device, programs);
  });
}

std::vector<ProgramText> list_programs(const Device& device, const PipelineOptions& options) {
  options.validate();
  return ocl::translated("compile", [&] {
    // With the sizes of devices with fewer and with more compute units, too.
    std::vector<Device> devices{device};
    if (device.info().type != DeviceType::kGpu) {
      for (const char* key : {"CPU", "CPU of few units"}) {
        devices.push_back(device.with_tuning(tuning_defaults().at(key)));
      }
    }
    std::map<std::pair<std::string, std::string>, std::string> texts;
    for (const Device& each : devices) {
      ocl::Context context = context_on(each.handle());
      for (const ocl::ProgramSource& source : sources_of(context, each, options)) {
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
