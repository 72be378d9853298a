// SPDX-License-Identifier: Apache-2.0
// Many frames through one pipeline: egosgm_soak FRAMES WIDTH HEIGHT DISPARITIES [SCHEDULING]. Prints a line with the
// checksum of all that came out and with what grew. Fails where memory or handles grow. scripts/soak runs it in several
// ways.
#include <fmt/core.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "host/method_options.h"
#include "tests/support/frame_memory.h"
#include "tests/support/scene.h"

namespace egosgm {
namespace {

constexpr int kImages = 5;
// What an allocator may keep in addition after a tenth of the frames.
constexpr long kMaxGrowthKib = 4096;
// With fewer, a tenth of them has not used every kernel yet: nothing is said of memory.
constexpr int kLeastFramesForGrowth = 100;

long resident_kib() {
  std::ifstream status("/proc/self/statm");
  long total = 0, resident = 0;
  status >> total >> resident;
  return resident * 4;
}

long open_files() {
  const std::filesystem::directory_iterator files("/proc/self/fd");
  return std::distance(begin(files), end(files));
}

/// FNV-1a.
struct Checksum {
  std::uint64_t value = 0xcbf29ce484222325u;

  template <typename T>
  void add(const std::vector<T>& values) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(values.data());
    for (std::size_t i = 0; i < values.size() * sizeof(T); ++i) value = (value ^ bytes[i]) * 0x100000001b3u;
  }
};

/// The scene forth and back; now and then a frame without motion, and a reset.
class Stream {
 public:
  explicit Stream(shared::ImageSize size) : scene_(size) {
    for (int i = 0; i < kImages; ++i) {
      const auto greys = scene_.frame(i).greys;
      for (const int view : {EGOSGM_LEFT, EGOSGM_RIGHT}) images_.emplace_back(size, greys, view, PixelType::kU8);
    }
  }
  const Calibration& calibration() const { return scene_.calibration(); }

  void process(Pipeline& pipeline, int frame, testing::OutputMemory& outputs) const {
    const int now = index(frame), before = index(frame - 1);
    std::optional<Motion> motion = scene_.motion(std::max(now, before));
    if (now < before) motion->current_from_previous = motion->current_from_previous.inverse();
    if (frame % 97 == 50) motion.reset();
    if (frame % 251 == 0) pipeline.reset();
    pipeline.process(images_[2 * now].view(), images_[2 * now + 1].view(), motion, outputs.views());
  }

 private:
  static int index(int frame) {
    const int turn = (frame + 2 * (kImages - 1)) % (2 * (kImages - 1));
    return turn < kImages ? turn : 2 * (kImages - 1) - turn;
  }

  testing::Scene scene_;
  std::vector<testing::ImageMemory> images_;
};

int soak(int frames, shared::ImageSize size, int disparities, const std::string& scheduling) {
  const Stream stream(size);
  MethodOptions options;
  options.disparities = disparities;
  set_parameter(options, "banded_sgm.scheduling", scheduling);
  Pipeline pipeline(stream.calibration(), size.width, size.height, options);
  const std::uint64_t device_bytes = pipeline.device_memory_bytes();
  testing::OutputMemory outputs(size);
  Checksum checksum;
  long early_kib = 0, early_files = 0;
  for (int frame = 0; frame < frames; ++frame) {
    stream.process(pipeline, frame, outputs);
    outputs.for_each_map([&](const char*, auto map) { checksum.add((outputs.*map).values()); });
    if (frame == frames / 10) early_kib = resident_kib(), early_files = open_files();
  }
  const long grown_kib = resident_kib() - early_kib, grown_files = open_files() - early_files;
  const bool resident_is_flat = frames < kLeastFramesForGrowth || grown_kib <= kMaxGrowthKib;
  const bool flat = resident_is_flat && grown_files == 0 && pipeline.device_memory_bytes() == device_bytes;
  fmt::print(
      "{} frames of {}x{}, D = {}: checksum {:016x}; resident {:.1f} MiB after a tenth of them, {:+} KiB at the "
      "end; open files {:+}; device memory {:.1f} MiB, {}\n",
      frames, size.width, size.height, disparities, checksum.value, static_cast<double>(early_kib) / 1024, grown_kib,
      grown_files, static_cast<double>(device_bytes) / (1 << 20), flat ? "flat" : "GREW");
  return flat ? 0 : 1;
}

}  // namespace
}  // namespace egosgm

int main(int argc, char** argv) {
  if (argc != 5 && argc != 6) {
    fmt::print(stderr, "usage: egosgm_soak FRAMES WIDTH HEIGHT DISPARITIES [SCHEDULING]\n");
    return 2;
  }
  return egosgm::soak(std::atoi(argv[1]), {std::atoi(argv[2]), std::atoi(argv[3])}, std::atoi(argv[4]),
                      argc == 6 ? argv[5] : "automatic");
}
