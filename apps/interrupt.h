// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace egosgm::app {

/// From here on SIGINT, SIGTERM and SIGHUP only raise a flag, so that a frame is finished and the report is written. A
/// second one ends the program at once, unless the leader of the program's process group sent it, as `timeout` does.
/// Those that are ignored stay so: SIGHUP under nohup, SIGINT in a script's background job.
void catch_interrupts();

/// What was before catch_interrupts(), without a flag: the process may run another command.
void release_interrupts();

/// Whether one came.
bool interrupted();

}  // namespace egosgm::app
