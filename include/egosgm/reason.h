// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "egosgm/export.h"

namespace egosgm {

/// Why a pixel has no value, or one that is doubtful: `FrameOutputs::reason`. Where several hold, docs/use/formats.md
/// says which of them a pixel has.
enum class Reason : std::uint8_t {
  kTrusted,       // has a value, and nothing speaks against it
  kUnconfirmed,   // no value: no match that the other view confirms
  kUncovered,     // came into view only now, from behind something nearer
  kContradicted,  // prediction and measurement contradict each other: it moves, or one of them is wrong
  kNearer,        // no value: nearer than the range, or hidden by something that is
  kAmbiguous,     // another place of the row looks as much like it as its match
  kFlat,          // no texture
  kSaturated,     // black or white, beyond what the camera can tell
  kSpeckle,       // no value: what was measured belongs to a small island
  kPredicted,     // the prediction's value; nothing was measured
};
inline constexpr int kReasonCount = 10;

/// "trusted", "unconfirmed", ...: the name without its k.
EGOSGM_EXPORT const char* to_string(Reason reason);

}  // namespace egosgm
