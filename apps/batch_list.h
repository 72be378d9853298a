// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/sequence_arguments.h"

namespace egosgm::app {

/// A line of a batch's list.
struct BatchEntry {
  std::string name;       // the folder of its results
  std::string arguments;  // the rest of the line
  std::string place;      // "FILE, line 7", for messages
};

/// What a line's arguments say.
struct BatchInput {
  SequenceArguments sequence;
  std::string poses_file;  // empty: stereo odometry
};

/// Reads a list: a line a sequence, NAME and then the input as `egosgm run` takes it (a data set's folder alone will
/// do) and --poses FILE where there are some. `#` begins a comment. Relative paths are those of the working directory.
/// Throws InvalidArgument, naming file and line: a name twice or unfit for a folder, no line. The arguments are left to
/// `parse_input`: a shard of a long list needs only its own.
std::vector<BatchEntry> read_batch_list(const std::filesystem::path& file);

/// Throws InvalidArgument, naming file and line.
BatchInput parse_input(const BatchEntry& entry);

}  // namespace egosgm::app
