// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <random>
#include <string>
#include <vector>

namespace egosgm::fuzz {

inline std::size_t below(std::mt19937& random, std::size_t end) { return end == 0 ? 0 : random() % end; }

/// One of: cut, flip a bit, set bytes, insert, erase, repeat a part; some of them several times.
inline std::string mutate(std::string bytes, std::mt19937& random) {
  static const std::vector<std::string> kTokens = {"nan",
                                                   "inf",
                                                   "-1",
                                                   "0",
                                                   "1e309",
                                                   "99999999999999999999",
                                                   "\n",
                                                   " ",
                                                   ":",
                                                   "=",
                                                   "[",
                                                   std::string("\0\0\0\0", 4),
                                                   "\xff\xff\xff\xff",
                                                   "\x7f\xff\xff\xff",
                                                   "Pf",
                                                   "P_rect_00:",
                                                   "cam0="};
  for (std::size_t round = 1 + below(random, 4); round > 0; --round) {
    const std::size_t at = below(random, bytes.size());
    const std::string& token = kTokens[below(random, kTokens.size())];
    switch (below(random, 7)) {
      case 0:
        bytes.resize(at);
        break;
      case 1:
        if (!bytes.empty()) bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(random, 8)));
        break;
      case 2:
        if (!bytes.empty()) bytes[at] = static_cast<char>(random());
        break;
      case 3:
        bytes.insert(at, token);
        break;
      case 4:
        bytes.erase(at, 1 + below(random, 16));
        break;
      case 5:
        bytes.insert(at, bytes.substr(below(random, bytes.size() + 1), 1 + below(random, 40)));
        break;
      default:
        bytes.replace(at, std::min(token.size(), bytes.size() - at), token);
    }
  }
  return bytes;
}

}  // namespace egosgm::fuzz
