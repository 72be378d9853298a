// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <optional>

namespace egosgm::vision {

/// The real sequences: $EGOSGM_DATA, else ../shared/data beside the project.
inline std::optional<std::filesystem::path> data_folder() {
  const char* variable = std::getenv("EGOSGM_DATA");
  const std::filesystem::path folder =
      variable ? std::filesystem::path(variable) : std::filesystem::path(EGOSGM_SOURCE_DIR) / "../shared/data";
  if (std::filesystem::is_directory(folder)) return folder;
  return std::nullopt;
}

}  // namespace egosgm::vision

#define EGOSGM_REQUIRE_DATA(folder)                                                                           \
  const auto folder##_found = egosgm::vision::data_folder();                                                  \
  if (!folder##_found) GTEST_SKIP() << "no real sequences: neither $EGOSGM_DATA nor ../shared/data is there"; \
  const std::filesystem::path folder = *folder##_found
