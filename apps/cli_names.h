// SPDX-License-Identifier: Apache-2.0
#pragma once

// CLI11 takes ten seconds to compile: headers that only name its classes include this.
namespace CLI {
class App;
class Option;
}  // namespace CLI
