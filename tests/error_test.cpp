// SPDX-License-Identifier: Apache-2.0
#include "egosgm/error.h"

#include <gtest/gtest.h>

#include <functional>

namespace egosgm {
namespace {

/// What `raise` throws, caught as `Caught`.
template <typename Caught>
std::string text_as(const std::function<void()>& raise) {
  try {
    raise();
  } catch (const Caught& error) {
    return error.what();
  }
  return "nothing";
}

TEST(Error, IsCaughtAsErrorAndAsTheStandardOne) {
  const std::pair<std::function<void()>, const char*> errors[] = {{[] { throw InvalidArgument("text"); }, "text"},
                                                                  {[] { throw MissingPath("a", "b"); }, "a: b"},
                                                                  {[] { throw IoError("text"); }, "text"},
                                                                  {[] { throw DeviceError(-5, "text"); }, "text"},
                                                                  {[] { throw BuildError(-11, "text"); }, "text"}};
  for (const auto& [raise, text] : errors) {
    EXPECT_EQ(text_as<Error>(raise), text);
    EXPECT_EQ(text_as<std::exception>(raise), text);
  }
  EXPECT_EQ(text_as<std::invalid_argument>(errors[1].first), "a: b");
  EXPECT_EQ(text_as<std::runtime_error>(errors[2].first), "text");
  EXPECT_EQ(text_as<std::runtime_error>(errors[4].first), "text");
}

}  // namespace
}  // namespace egosgm
