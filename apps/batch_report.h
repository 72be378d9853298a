// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/batch_list.h"
#include "apps/file_record.h"
#include "apps/run.h"

namespace egosgm::app {

/// What a batch writes into its folder OUT beside each sequence's results in OUT/NAME:
///   settings.json     version and options: all shards of a batch must share them
///   NAME/done.json    what the sequence gave; written last, so a sequence that has it is complete
///   NAME/failed.json  or why it gave nothing
///   batch.json        all of it, in the order of the list, and metrics pooled over all pixels with truth. The same
///                     bytes whoever ran which sequence where.
/// None of it names a device or a time. Thread-safe for different sequences.
class BatchFolder {
 public:
  /// Looks at the folder, and changes nothing. `overwrite`: what was done there is done again. Throws InvalidArgument
  /// where it was made with other settings, and is not to be overwritten, or holds files of others in a batch's names.
  BatchFolder(const std::string& folder, nlohmann::ordered_json settings, bool overwrite);
  /// Makes the folder and settings.json, and has the folder from then on: no other batch gets it, but other shards do
  /// where this is one. Throws IoError, and FolderInUse where another batch has it.
  void begin(bool is_shard);

  std::filesystem::path folder_of(const BatchEntry& entry) const { return folder_ / entry.name; }

  /// Whether its results are complete, and of this batch's settings. Throws InvalidArgument where they are those of
  /// another input of the same name.
  bool is_done(const BatchEntry& entry) const;
  bool is_to_do(const BatchEntry& entry) const { return overwrite_ || !is_done(entry); }
  /// What becomes of a run in its folder: what this batch began, it does again; another one is in the way, unless it is
  /// to be overwritten.
  EarlierRun treatment_of(const BatchEntry& entry) const;
  /// Forgets what came of it, before it is tried (again). REQUIRES: `treatment_of` looked at it.
  void begin(const BatchEntry& entry) const;
  /// REQUIRES: `run_sequence` finished. Compares the disparities with the truth that the sequence has. Returns what
  /// done.json holds. Throws IoError.
  nlohmann::ordered_json finish(const BatchEntry& entry, const SequenceJob& job) const;
  void fail(const BatchEntry& entry, const std::string& reason) const;

  /// Writes batch.json, and returns it. Throws IoError.
  nlohmann::ordered_json write_report(const std::vector<BatchEntry>& entries) const;

 private:
  nlohmann::ordered_json result_of(const BatchEntry& entry) const;

  const std::filesystem::path folder_;
  const nlohmann::ordered_json settings_;
  const bool overwrite_;
  std::unique_ptr<LockedFile> lock_;
};

/// What all sequences of a batch share.
nlohmann::ordered_json batch_settings(const PipelineOptions& options, const StereoOdometryOptions& odometry,
                                      const std::set<std::string>& kinds);

}  // namespace egosgm::app
