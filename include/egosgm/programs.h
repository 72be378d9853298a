// SPDX-License-Identifier: Apache-2.0
// Kernels compiled ahead, for machines that have no compiler at run time. `Device::with_programs` loads them.
#pragma once

#include <string>
#include <vector>

#include "egosgm/device.h"
#include "egosgm/export.h"
#include "egosgm/options.h"

namespace egosgm {

/// A file of a folder of programs.
struct ProgramFile {
  std::string name;
  std::string bytes;
};

/// Builds for `device` every program of a pipeline with `options`, for images of any size and of 8 and 16 bits. Returns
/// the binaries, as the driver gives them, and last `manifest.json`: device, platform and driver with their versions,
/// and for each program its kernel file, build options with all defines, and hashes of source and binary. Write them
/// into one folder in this order. Of the options the preset, its constants, the disparity range, `cost` and `paths`
/// matter, and so does the device's tuning. Throws InvalidArgument (option), DeviceError or BuildError. Thread-safe.
EGOSGM_EXPORT std::vector<ProgramFile> compile_programs(const Device& device, const PipelineOptions& options = {});

/// A program as a compiler gets it: OpenCL C 1.2, with options like -DNAME=VALUE.
struct ProgramText {
  std::string kernel_file, text, options;
};

/// Lists what `compile_programs` would build, for a compiler to SPIR-V. It is equal for all devices of a type.
EGOSGM_EXPORT std::vector<ProgramText> list_programs(const Device& device, const PipelineOptions& options = {});

/// The files of a folder of programs that any device of that type loads if it takes SPIR-V. `modules`: of each of
/// `programs`, in their order.
EGOSGM_EXPORT std::vector<ProgramFile> spirv_programs(const std::vector<ProgramText>& programs,
                                                      const std::vector<std::string>& modules);

}  // namespace egosgm
