// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace egosgm::app {

/// From here on SIGINT, SIGTERM and SIGHUP only raise a flag, so that a frame is finished and the report is written. A
/// second one ends the program at once.
void catch_interrupts();

/// Whether one came.
bool interrupted();

}  // namespace egosgm::app
