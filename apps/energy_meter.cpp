// SPDX-License-Identifier: Apache-2.0
#include "apps/energy_meter.h"

#include <dlfcn.h>

#include <algorithm>
#include <fstream>
#include <string>

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;

std::optional<std::uint64_t> read_number(const fs::path& file) {
  std::ifstream stream(file);
  std::uint64_t value = 0;
  return stream >> value ? std::optional(value) : std::nullopt;
}

/// "intel-rapl:0" is a package (also on AMD); "intel-rapl:0:1" a part of one, counted with it.
bool is_package(const fs::path& zone) {
  const std::string name = zone.filename();
  return name.starts_with("intel-rapl:") && std::count(name.begin(), name.end(), ':') == 1;
}

}  // namespace

/// The three functions of NVIDIA's management library that tell the energy since the driver was loaded, in millijoules.
class EnergyMeter::Nvml {
 public:
  static std::unique_ptr<Nvml> load() {
    void* library = dlopen("libnvidia-ml.so.1", RTLD_NOW | RTLD_LOCAL);
    if (!library) return nullptr;
    auto nvml = std::unique_ptr<Nvml>(new Nvml(library));
    if (nvml->start_mj_.empty()) return nullptr;
    return nvml;
  }
  ~Nvml() {
    if (const auto shutdown = find<int (*)()>("nvmlShutdown")) shutdown();
    dlclose(library_);
  }

  void sample() {
    sum_mj_ = 0;
    for (unsigned i = 0; i < start_mj_.size(); ++i) sum_mj_ += energy_mj(i).value_or(start_mj_[i]) - start_mj_[i];
  }
  double joules() const { return static_cast<double>(sum_mj_) * 1e-3; }

 private:
  explicit Nvml(void* library) : library_(library) {
    const auto init = find<int (*)()>("nvmlInit_v2");
    const auto count = find<int (*)(unsigned*)>("nvmlDeviceGetCount_v2");
    unsigned devices = 0;
    if (!init || !count || init() != 0 || count(&devices) != 0) return;
    for (unsigned i = 0; i < devices; ++i) {
      const auto energy = energy_mj(i);
      if (!energy) {  // a device that is too old to tell: the others' sum would be a wrong one
        start_mj_.clear();
        return;
      }
      start_mj_.push_back(*energy);
    }
  }

  template <typename Function>
  Function find(const char* name) const {
    return reinterpret_cast<Function>(dlsym(library_, name));
  }

  std::optional<std::uint64_t> energy_mj(unsigned index) const {
    const auto handle = find<int (*)(unsigned, void**)>("nvmlDeviceGetHandleByIndex_v2");
    const auto energy = find<int (*)(void*, unsigned long long*)>("nvmlDeviceGetTotalEnergyConsumption");
    void* device = nullptr;
    unsigned long long value = 0;
    if (!handle || !energy || handle(index, &device) != 0 || energy(device, &value) != 0) return std::nullopt;
    return value;
  }

  void* library_;
  std::vector<std::uint64_t> start_mj_;
  std::uint64_t sum_mj_ = 0;
};

EnergyMeter::EnergyMeter(const fs::path& powercap) : nvml_(Nvml::load()) {
  std::error_code error;
  for (fs::directory_iterator entry(powercap, error), end; !error && entry != end; entry.increment(error)) {
    if (!is_package(entry->path())) continue;
    const auto now = read_number(entry->path() / "energy_uj");
    const auto range = read_number(entry->path() / "max_energy_range_uj");
    if (now && range) zones_.push_back({entry->path() / "energy_uj", *range, *now, 0});
  }
}

EnergyMeter::~EnergyMeter() = default;

void EnergyMeter::sample() {
  const std::lock_guard lock(mutex_);
  for (Zone& zone : zones_) {
    const std::uint64_t now = read_number(zone.file).value_or(zone.last_uj);
    zone.sum_uj += now >= zone.last_uj ? now - zone.last_uj : now + zone.range_uj - zone.last_uj;
    zone.last_uj = now;
  }
  if (nvml_) nvml_->sample();
}

std::optional<double> EnergyMeter::cpu_joules() const {
  const std::lock_guard lock(mutex_);
  if (zones_.empty()) return std::nullopt;
  double sum = 0;
  for (const Zone& zone : zones_) sum += static_cast<double>(zone.sum_uj) * 1e-6;
  return sum;
}

std::optional<double> EnergyMeter::gpu_joules() const {
  const std::lock_guard lock(mutex_);
  return nvml_ ? std::optional(nvml_->joules()) : std::nullopt;
}

}  // namespace egosgm::app
