// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

#include <deque>

#include "egosgm/pipeline.h"

namespace egosgm::python {

/// The maps of a frame: arrays by their names.
struct Frame {
  pybind11::dict maps;
  FrameReport report;

  pybind11::object map(const char* name) const {
    return maps.contains(name) ? pybind11::object(maps[name]) : pybind11::none();
  }
};

/// `wanted`: a dict of arrays to fill, or names of arrays to make.
pybind11::dict arrays_to_fill(const pybind11::object& wanted, int width, int height);
/// Throws InvalidArgument.
FrameOutputs views_of(const pybind11::dict& arrays);
/// Throws InvalidArgument where a map to fill shares memory with another one of its frame or of one under way.
void expect_apart(const pybind11::dict& arrays, const std::deque<Frame>& under_way);

/// That of a Pipeline of Python, which is for the caller alone.
Pipeline& pipeline_of(const pybind11::object& pipeline);

}  // namespace egosgm::python
