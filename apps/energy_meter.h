// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

namespace egosgm::app {

/// Energy that the whole machine took since construction, where it tells: CPU packages by RAPL (Linux' powercap; most
/// systems let only root read it), NVIDIA GPUs by NVML (loaded at run time where it is there). Other processes' share
/// is in it. Thread-safe.
class EnergyMeter {
 public:
  explicit EnergyMeter(const std::filesystem::path& powercap = "/sys/class/powercap");
  ~EnergyMeter();

  /// Reads the counters; at least once in their turn (a quarter of an hour at the least), or a turn is lost.
  void sample();

  // Joules up to the last sample; none where nothing tells.
  std::optional<double> cpu_joules() const;
  std::optional<double> gpu_joules() const;

 private:
  struct Zone {
    std::filesystem::path file;
    std::uint64_t range_uj, last_uj, sum_uj;
  };
  class Nvml;

  mutable std::mutex mutex_;
  std::vector<Zone> zones_;
  std::unique_ptr<Nvml> nvml_;
};

}  // namespace egosgm::app
