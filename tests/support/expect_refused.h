// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "egosgm/error.h"

namespace egosgm::testing {

/// What the `Refusal` says that `call` throws; empty where it throws none.
template <typename Refusal = InvalidArgument, typename Call>
std::string refusal_of(Call&& call) {
  try {
    call();
    return {};
  } catch (const Refusal& error) {
    return error.what();
  }
}

/// `call` must throw a `Refusal`, with one line that holds every one of `parts`.
template <typename Refusal = InvalidArgument, typename Call>
void expect_refused(Call&& call, const std::vector<std::string>& parts) {
  const std::string line = refusal_of<Refusal>(call);
  EXPECT_NE(line, "") << "nothing was thrown; expected " << (parts.empty() ? "a refusal" : parts.front());
  EXPECT_EQ(line.find('\n'), std::string::npos) << line;
  for (const std::string& part : parts) EXPECT_NE(line.find(part), std::string::npos) << line << "\nlacks: " << part;
}

}  // namespace egosgm::testing
