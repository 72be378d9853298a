// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "egosgm/device.h"

namespace egosgm::app {

/// $XDG_CONFIG_HOME/egosgm/tuning.json, or ~/.config/egosgm/tuning.json; empty where neither variable is set.
std::filesystem::path user_tuning_file();

/// The sizes that `file` has for a device and its driver, if it has any. Throws InvalidArgument, naming the file, for
/// one that cannot be read or is not what `egosgm tune` writes.
std::optional<Tuning> kept_tuning(const std::filesystem::path& file, const DeviceInfo& device);

/// `device` with what `--tuning` says: the sizes of a file, "none", or empty for the user's file where there is one.
/// Throws as kept_tuning.
Device tuned_by_argument(const Device& device, const std::string& argument);

/// Throws InvalidArgument where the file exists and is no tuning file, and IoError where it cannot be
/// written. Changes no file.
void expect_tuning_file(const std::filesystem::path& file);

/// Puts the sizes of a device and its driver into the file, beside those of others. Throws IoError, or InvalidArgument
/// as kept_tuning.
void store_tuning(const std::filesystem::path& file, const DeviceInfo& device, const Tuning& tuning);

}  // namespace egosgm::app
