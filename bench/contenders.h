// SPDX-License-Identifier: Apache-2.0
// The contenders of egosgm_compare, which takes turns with them.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "bench/inputs.h"
#include "egosgm/device.h"

namespace egosgm::bench {

/// What one turn of a contender gave.
struct Turn {
  double seconds = 0;
  std::map<std::string, double> more;
};

using TurnFunction = std::function<Turn()>;

struct Contender {
  std::string name;
  TurnFunction turn;
};

/// Where a contender runs: ours on a device, OpenCV on `threads`.
struct Place {
  Device device;
  int threads;
  std::string suffix;  // of its name
};

/// OpenCV's modes and this library's ways, on a clip that has to outlive them. `settings`: NAME=VALUE, each of which
/// makes a banded frame of its own.
std::vector<Contender> contenders(const Clip& clip, int disparities, const std::vector<std::string>& settings,
                                  const Place& place);

}  // namespace egosgm::bench
