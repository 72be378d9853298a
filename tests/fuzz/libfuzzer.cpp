// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdint>

#include "egosgm/error.h"
#include "tests/fuzz/target.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > egosgm::fuzz::kMaxInputBytes) return -1;
  try {
    egosgm::fuzz::run(std::string_view(reinterpret_cast<const char*>(data), size));
  } catch (const egosgm::InvalidArgument&) {
  }
  return 0;
}
