// SPDX-License-Identifier: Apache-2.0
// Runs a fuzz target over mutated seeds, the same ones every time: NAME [COUNT [SEED]], or writes its seeds:
// NAME --seeds FOLDER. Its last line says how many inputs gave a result; the tests expect that line and no other.
#include <sys/resource.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "egosgm/error.h"
#include "tests/fuzz/mutate.h"
#include "tests/fuzz/target.h"

namespace egosgm::fuzz {
namespace {

// A short input must not take gigabytes. What stays is measured, at its peak, against the peak after the seeds.
constexpr long kMaxGrowthKib = 64 * 1024;

long peak_kib() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

bool gives_result(const std::string& input) {
  try {
    run(input);
    return true;
  } catch (const InvalidArgument& error) {
    const std::string line = error.what();
    if (line.empty() || line.find('\n') != std::string::npos) throw std::runtime_error("not one line: " + line);
    return false;
  }
}

int run_mutated(int count, unsigned seed) {
  const std::vector<std::string> valid = seeds();
  std::mt19937 random(seed);
  int results = 0;
  long before_kib = 0;
  std::string input;
  try {
    for (const std::string& one : valid) gives_result(input = one);
    before_kib = peak_kib();
    for (int i = 0; i < count; ++i) {
      input = mutate(valid[below(random, valid.size())], random);
      if (input.size() > kMaxInputBytes) input.resize(kMaxInputBytes);
      results += gives_result(input);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\nfor the input in finding.bin\n", error.what());
    std::ofstream("finding.bin", std::ios::binary) << input;
    return 1;
  }
  const long growth_kib = peak_kib() - before_kib;
  if (growth_kib > kMaxGrowthKib && !std::getenv("EGOSGM_FUZZ_ANY_MEMORY")) {
    std::fprintf(stderr, "memory grew by %ld KiB\n", growth_kib);
    return 1;
  }
  std::printf("%d inputs: %d results, %d refused\n", count, results, count - results);
  return 0;
}

int write_seeds(const std::string& folder) {
  int number = 0;
  for (const std::string& input : seeds()) {
    std::ofstream(folder + "/seed" + std::to_string(number++), std::ios::binary) << input;
  }
  return 0;
}

}  // namespace
}  // namespace egosgm::fuzz

int main(int argc, char** argv) {
  if (argc == 3 && std::string(argv[1]) == "--seeds") return egosgm::fuzz::write_seeds(argv[2]);
  const int count = argc > 1 ? std::atoi(argv[1]) : 1000;
  const unsigned seed = argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 1;
  return egosgm::fuzz::run_mutated(count, seed);
}
