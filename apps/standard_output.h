// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace egosgm::app {

/// To be called before anything is opened: a descriptor of the standard streams that is closed must not become a
/// file's. From here on a reader of the standard output that goes (`| head`) is an error of the write, not the
/// program's end. What is printed at the end is written by `standard_output_error`.
void open_standard_streams();

/// Prints while work is under way, at once. Where that fails, this and all that follows is dropped, and the work goes
/// on.
void print_now(const std::string& text);

/// Says a line on the standard error. Whether anybody can read it changes nothing.
void say(const std::string& line);

/// Writes what is left. Returns 0, or the errno of the first write that failed: EPIPE where the reader has gone.
int standard_output_error();

}  // namespace egosgm::app
