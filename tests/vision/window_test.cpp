// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/window.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <stdexcept>

#include "tests/support/expect_refused.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

class Window : public ::testing::Test {
 protected:
  void SetUp() override {
    unsetenv("DISPLAY");
    unsetenv("WAYLAND_DISPLAY");
  }
};

TEST_F(Window, ADisplayIsThereWhereAWindowOpens) {
  bool opened = false;
  EXPECT_FALSE(has_display([] { std::abort(); })) << "without a display nothing is tried";
  setenv("DISPLAY", "", 1);
  EXPECT_FALSE(has_display([] { std::abort(); }));
  setenv("WAYLAND_DISPLAY", "wayland-7", 1);
  EXPECT_TRUE(has_display([&] { opened = true; }));
  EXPECT_FALSE(opened) << "in another process";
}

TEST_F(Window, ADisplayThatCannotBeReachedIsNamed) {
  setenv("DISPLAY", ":77", 1);
  const std::vector<std::string> named{"display :77 (DISPLAY)", "correct or unset it"};
  expect_refused([] { has_display([] { std::abort(); }); }, named);  // as Qt does
  expect_refused([] { has_display([] { _exit(1); }); }, named);      // as GTK does
  expect_refused([] { has_display([] { throw std::runtime_error("no window"); }); }, named);
  unsetenv("DISPLAY");
  setenv("WAYLAND_DISPLAY", "wayland-7", 1);
  expect_refused([] { has_display([] { std::abort(); }); }, {"wayland-7 (WAYLAND_DISPLAY)"});
}

}  // namespace
}  // namespace egosgm::vision
