// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/core.h>

#include <string>

#include "host/vision/doubt.h"

namespace egosgm::app {

using vision::Doubt;

/// The line that names `egosgm doctor` with `input`, the arguments that name the sequence; empty without a doubt.
inline std::string advice_of(const std::string& doubt, const std::string& input) {
  return doubt.empty() ? "" : fmt::format("{}: `egosgm doctor {}` tells why", doubt, input);
}

}  // namespace egosgm::app
