// SPDX-License-Identifier: Apache-2.0
// Google Benchmark's runs as rows.
#pragma once

#include <benchmark/benchmark.h>

#include "bench/report.h"

namespace egosgm::bench {

/// How the rounds of what is registered together follow one another.
enum class Turns { kOneAfterAnother, kRandom };

/// parse_arguments, which gives the rest to Google Benchmark (--benchmark_filter=..., ...).
Arguments parse_turns(int argc, char** argv, const char* help, int default_rounds, Turns turns);

/// Names "NAME/WxH/D" as Google Benchmark filters them.
std::string benchmark_name(const std::string& name, shared::ImageSize size, int disparities);

/// Runs what is registered under such names, forgets it, and appends a row each.
void run_registered(std::vector<Row>& rows);

}  // namespace egosgm::bench
