// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "egosgm/error.h"

namespace egosgm::testing {

/// `call` must throw a `Refusal`, with one line that holds every one of `parts`.
template <typename Refusal = InvalidArgument, typename Call>
void expect_refused(Call&& call, const std::vector<std::string>& parts) {
  try {
    call();
    ADD_FAILURE() << "nothing was thrown; expected " << (parts.empty() ? "a refusal" : parts.front());
  } catch (const Refusal& error) {
    const std::string line = error.what();
    EXPECT_EQ(line.find('\n'), std::string::npos) << line;
    for (const std::string& part : parts) EXPECT_NE(line.find(part), std::string::npos) << line << "\nlacks: " << part;
  }
}

}  // namespace egosgm::testing
