// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

#include <string>

#include "egosgm/odometry.h"
#include "egosgm/vision/dataset.h"

namespace egosgm::python {

/// "7:10", "7:", ":10" or "7"; empty: all.
vision::FrameRange range_of(const std::string& frames);

/// Decodes a text that may hold the name of a file: bytes that are no UTF-8 stand in it as they do in Python's paths.
pybind11::str text_of(const std::string& text);
/// The other way round.
std::string text_from(const pybind11::handle& text);

/// Throws InvalidArgument.
StereoOdometryOptions odometry_options_of(const pybind11::kwargs& values);

void bind_errors(pybind11::module_& module);
void bind_values(pybind11::module_& module);
void bind_pipeline(pybind11::module_& module);
void bind_odometry(pybind11::module_& module);
void bind_moving_objects(pybind11::module_& module);
void bind_examination(pybind11::module_& module);
void bind_video(pybind11::module_& module);
void bind_program(pybind11::module_& module);
void bind_files(pybind11::module_& module);
void bind_evaluation(pybind11::module_& module);

}  // namespace egosgm::python
