// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace egosgm::ocl {

/// FIPS 180-4's digest of bytes.
std::array<std::uint8_t, 32> sha256(std::string_view bytes);

/// Its 64 hexadecimal digits.
std::string hex(const std::array<std::uint8_t, 32>& digest);

}  // namespace egosgm::ocl
