// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include "egosgm/device.h"
#include "egosgm/tuning.h"

namespace egosgm {

/// Up to so many compute units are busy with fewer tiles, too, and wait less often (docs/understand/decisions.md).
inline constexpr int kFewComputeUnits = 4;

/// Sizes by what they are for: a device and its driver, as `tuning_key` names them, a device's name alone for all
/// drivers, or a class ("CPU", "CPU of few units", "GPU"). 0: the next of these; at last the stage decides by the
/// disparity range and the device's limits.
using TuningDefaults = std::map<std::string, Tuning>;

/// "NAME, driver VERSION": as the file of `egosgm tune` names a device.
inline std::string tuning_key(const DeviceInfo& device) { return device.name + ", driver " + device.driver; }

/// Those of host/tuning_defaults.json.
const TuningDefaults& tuning_defaults();
inline const Tuning& cpu_tuning() { return tuning_defaults().at("CPU"); }

/// `tuning` with the defaults of the device and of its class where it says nothing.
Tuning with_defaults(Tuning tuning, const DeviceInfo& device, const TuningDefaults& defaults = tuning_defaults());

}  // namespace egosgm
