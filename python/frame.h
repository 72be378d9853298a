// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

#include "egosgm/frame.h"

namespace egosgm::python {

/// What a frame gave: arrays by the names of their maps.
struct Frame {
  pybind11::dict maps;
  FrameReport report;

  pybind11::object map(const char* name) const {
    return maps.contains(name) ? pybind11::object(maps[name]) : pybind11::none();
  }
};

}  // namespace egosgm::python
