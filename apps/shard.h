// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace egosgm::app {

/// The part of a list that one of `count` processes does: its lines whose index is `index` modulo `count`.
struct Shard {
  int index = 0, count = 1;
  bool contains(std::size_t line) const { return line % count == static_cast<std::size_t>(index); }
};

/// "K/N" with K from 0 to N - 1; empty: the task's number in a Slurm job array (SLURM_ARRAY_TASK_ID, _MIN, _STEP, of
/// SLURM_ARRAY_TASK_COUNT), or in an Indexed Job of Kubernetes (JOB_COMPLETION_INDEX), which does not tell how many
/// there are: `shards`, "N". Without any of them, all. Throws InvalidArgument.
Shard shard_of(const std::string& shard, const std::string& shards);

}  // namespace egosgm::app
