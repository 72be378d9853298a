// SPDX-License-Identifier: Apache-2.0
#include "apps/shard.h"

#include <fmt/core.h>

#include <charconv>
#include <cstdlib>

#include "egosgm/error.h"

namespace egosgm::app {
namespace {

int number(const std::string& text, const char* name) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 0) {
    throw InvalidArgument(fmt::format("{} \"{}\": give a whole number from 0", name, text));
  }
  return value;
}

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}

int environment_number(const char* name, int otherwise) {
  const std::string value = environment(name);
  return value.empty() ? otherwise : number(value, name);
}

Shard checked(Shard shard, const std::string& from) {
  if (shard.count >= 1 && shard.index < shard.count) return shard;
  throw InvalidArgument(
      fmt::format("{}: shard {} of {}: shards count from 0, so choose 0/N to N-1/N", from, shard.index, shard.count));
}

Shard shard_of_slurm() {
  const int step = std::max(1, environment_number("SLURM_ARRAY_TASK_STEP", 1));
  const int first = environment_number("SLURM_ARRAY_TASK_MIN", 0);
  const int task = environment_number("SLURM_ARRAY_TASK_ID", 0);
  return checked({(task - first) / step, environment_number("SLURM_ARRAY_TASK_COUNT", 1)}, "SLURM_ARRAY_TASK_ID");
}

}  // namespace

Shard shard_of(const std::string& shard, const std::string& shards) {
  if (!shard.empty()) {
    const auto slash = shard.find('/');
    if (slash == std::string::npos) throw InvalidArgument("--shard " + shard + ": write K/N, for example 0/8");
    return checked({number(shard.substr(0, slash), "--shard"), number(shard.substr(slash + 1), "--shard")}, "--shard");
  }
  if (!environment("SLURM_ARRAY_TASK_ID").empty()) return shard_of_slurm();
  if (environment("JOB_COMPLETION_INDEX").empty()) return {};
  if (shards.empty()) {
    throw InvalidArgument(
        "JOB_COMPLETION_INDEX is set, but not how many there are: give --shards N, the job's "
        "completions, or --shard K/N");
  }
  return checked({environment_number("JOB_COMPLETION_INDEX", 0), number(shards, "--shards")}, "JOB_COMPLETION_INDEX");
}

}  // namespace egosgm::app
