// SPDX-License-Identifier: Apache-2.0
#include "bench/turns.h"

#include <cstdio>
#include <map>
#include <stdexcept>

namespace egosgm::bench {
namespace {

/// Keeps Google Benchmark's runs as rows and prints a line each.
class RowReporter : public benchmark::BenchmarkReporter {
 public:
  explicit RowReporter(std::vector<Row>& rows) : rows_(rows) {}

  bool ReportContext(const Context&) override { return true; }

  void ReportRuns(const std::vector<Run>& runs) override {
    if (runs.empty() || runs.front().run_type == Run::RT_Aggregate) return;
    Row row;
    char name[128];
    if (std::sscanf(runs.front().run_name.function_name.c_str(), "%127[^/]/%dx%d/%d", name, &row.size.width,
                    &row.size.height, &row.disparities) != 4) {
      throw std::logic_error("not a name of bench/: " + runs.front().run_name.function_name);
    }
    row.name = name;
    std::vector<double> ms;
    std::map<std::string, std::vector<double>> counters;
    for (const Run& run : runs) {
      ms.push_back(1e3 * run.real_accumulated_time / static_cast<double>(run.iterations));
      for (const auto& [counter, value] : run.counters) counters[counter].push_back(value);
    }
    row.median_ms = median(ms);
    for (auto& [counter, values] : counters) row.more.emplace_back(counter, median(values));
    add_row(std::move(row), rows_);
  }

 private:
  std::vector<Row>& rows_;
};

}  // namespace

Arguments parse_turns(int argc, char** argv, const char* help, int default_rounds, Turns turns) {
  char random_turns[] = "--benchmark_enable_random_interleaving=true";
  std::vector<char*> rest{argv[0]};
  if (turns == Turns::kRandom) rest.push_back(random_turns);
  Arguments arguments = parse_arguments(argc, argv, help, default_rounds, &rest);
  int count = static_cast<int>(rest.size());
  benchmark::Initialize(&count, rest.data());
  if (count > 1) refuse_argument(rest[1]);
  return arguments;
}

std::string benchmark_name(const std::string& name, shared::ImageSize size, int disparities) {
  return name + "/" + std::to_string(size.width) + "x" + std::to_string(size.height) + "/" +
         std::to_string(disparities);
}

void run_registered(std::vector<Row>& rows) {
  RowReporter reporter(rows);
  benchmark::RunSpecifiedBenchmarks(&reporter);
  benchmark::ClearRegisteredBenchmarks();
}

}  // namespace egosgm::bench
