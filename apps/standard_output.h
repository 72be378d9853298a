// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace egosgm::app {

/// From here on a reader of the standard output that goes (`| head`) is an error of the write, not the program's end.
/// What is printed at the end is written by `standard_output_error`.
void open_standard_output();

/// Prints while work is under way, at once. Where that fails, this and all that follows is dropped, and the work goes
/// on.
void print_now(const std::string& text);

/// Writes what is left. Returns 0, or the errno of the first write that failed: EPIPE where the reader has gone.
int standard_output_error();

}  // namespace egosgm::app
