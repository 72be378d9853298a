// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "egosgm/device.h"

namespace egosgm::app {

/// $XDG_CONFIG_HOME/egosgm/tuning.json, or ~/.config/egosgm/tuning.json; empty where neither variable is set.
std::filesystem::path user_tuning_file();

/// `device` with the sizes that `file` has for it and its driver; as it is where it has none. Throws InvalidArgument,
/// naming the file, for one that cannot be read or is not what `egosgm tune` writes.
Device tuned(const Device& device, const std::filesystem::path& file);

/// What `--tuning` says: a file, "none", or empty for the user's file where there is one.
Device tuned_by_argument(const Device& device, const std::string& argument);

/// Throws InvalidArgument where the file exists and is no tuning file, and IoError where it cannot be
/// written. Changes no file.
void expect_tuning_file(const std::filesystem::path& file);

/// Puts the sizes of a device and its driver into the file, beside those of others. Throws IoError, or InvalidArgument
/// as `tuned`.
void store_tuning(const std::filesystem::path& file, const DeviceInfo& device, const Tuning& tuning);

}  // namespace egosgm::app
