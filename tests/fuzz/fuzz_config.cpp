// SPDX-License-Identifier: Apache-2.0
// Configuration files of egosgm run.
#include "apps/option_arguments.h"
#include "egosgm/named_options.h"
#include "tests/fuzz/memory_file.h"
#include "tests/fuzz/target.h"

namespace egosgm::fuzz {

std::vector<std::string> seeds() {
  std::string deep = "a";
  for (int i = 0; i < 1500; ++i) deep += ".a";
  std::string all = "# every option\n";
  for (const NamedOption& option : list_options({})) {
    const bool bare = option.value.find_first_not_of("+-.0123456789e") == std::string::npos;
    all += option.name + " = " + (bare ? option.value : '"' + option.value + '"') + '\n';
  }
  return {all,
          "disparities = 40\np1 = 7\np2 = 77\ncost = \"census5x5\"\n[constants.search_band]\nfrom_neighbours = false\n",
          "[a.b.c.d]\np1 = 7\n[" + deep + "]\n", "[[x.y]]\n[[x.y]]\na.b.c.d.e.f = [1, 2]\n"};
}

void run(std::string_view input) {
  const MemoryFile file(input);
  app::OptionArguments arguments;
  arguments.config = file.path().string();
  arguments.options();
}

}  // namespace egosgm::fuzz
