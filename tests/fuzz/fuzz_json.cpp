// SPDX-License-Identifier: Apache-2.0
// JSON as reports, tuning files and manifests have it, and what walks through it.
#include "host/json_text.h"
#include "tests/fuzz/target.h"

namespace egosgm::fuzz {

std::vector<std::string> seeds() {
  std::string keys;
  for (int i = 0; i < 300; ++i) keys += "\"k" + std::to_string(i) + "\": 0, ";
  return {
      R"({"version": "0.1.0", "frames": [{"frame": 0, "density": 0.9, "odometry": {"motion": null}}], "finished": true})",
      std::string(1500, '[') + std::string(1500, ']'), std::string(60, '[') + std::string(60, ']'),
      "{" + keys + "\"last\": {\"a\": [1, 2.5, \"x\"]}}"};
}

void run(std::string_view input) {
  const auto json = parse_json(input, "fuzz.json");
  if (json.is_discarded()) throw InvalidArgument("fuzz.json: no JSON");
  json.flatten();
  json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace egosgm::fuzz
