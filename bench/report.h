// SPDX-License-Identifier: Apache-2.0
// What the programs share: arguments, rows and their JSON.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "egosgm/device.h"
#include "kernels/shared.h"

namespace egosgm::bench {

struct Arguments {
  std::optional<shared::ImageSize> size;  // --size WxH: only this size
  std::optional<int> disparities;         // --disparities N: only this range
  int rounds = 0;                         // --rounds N: a figure is the median of so many
  int threads = 2;                        // --threads N: compute units of PoCL and threads of OpenCV
  std::string json;                       // --json FILE
  std::string bits;                       // --bits FILE (egosgm_stages)
  bool counts = false;                    // --count (egosgm_kernels)
  std::vector<std::string> settings;      // --set NAME=VALUE, repeated (egosgm_compare)
};

/// Takes its arguments out of argv. Ends the program with `help` for --help, and with one line on stderr for what it
/// does not know, where that does not go to `rest`. Call it before anything touches OpenCL: PoCL reads the number of
/// its threads once, from the environment.
Arguments parse_arguments(int argc, char** argv, const char* help, int default_rounds,
                          std::vector<char*>* rest = nullptr);
[[noreturn]] void refuse_argument(const std::string& argument);

/// What was measured: one row of the tables.
struct Row {
  std::string name;
  shared::ImageSize size;
  int disparities = 0;
  double median_ms = 0;                              // wall clock
  std::vector<std::pair<std::string, double>> more;  // counters of the benchmark, by name; medians
};

/// Prints a row and appends it.
void add_row(Row row, std::vector<Row>& rows);

/// The middle one; the mean of the two in the middle. REQUIRES: not empty.
double median(std::vector<double> values);

/// Where and what was measured.
struct Machine {
  DeviceInfo device;
  double copy_gb_s = 0;  // bytes read and written by a copy on the device, a second; 0: not measured
  std::string input;
  int threads = 0;
  std::vector<std::pair<std::string, double>> more = {};  // figures of the device, by name
};

void print_machine(const Machine& machine);

/// {"device": ..., "driver": ..., "commit": ..., "date": ..., figures of the device, "rows": [{"name": ..., "width":
/// ..., "height": ..., "disparities": ..., "median_ms": ..., counters}]}. Written under another name first, then
/// renamed. Throws std::runtime_error naming the file.
void write_json(const std::string& file, const Machine& machine, const std::vector<Row>& rows);

/// Runs `main_body`; an exception becomes one line on stderr and exit code 1.
int guarded(const char* program, int (*main_body)(int, char**), int argc, char** argv);

}  // namespace egosgm::bench
