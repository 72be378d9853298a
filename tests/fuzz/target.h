// SPDX-License-Identifier: Apache-2.0
// A fuzz target is a `seeds` and a `run`, and links with one of two mains: seeded.cpp (some inputs, the same in every
// run) or libFuzzer's, through libfuzzer.cpp.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace egosgm::fuzz {

/// Inputs to begin with.
std::vector<std::string> seeds();

/// Gives a result, or throws InvalidArgument. Anything else is a finding.
void run(std::string_view input);

/// The longest input that makes sense.
inline constexpr std::size_t kMaxInputBytes = 4096;

}  // namespace egosgm::fuzz
