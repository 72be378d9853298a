// SPDX-License-Identifier: Apache-2.0
// The table of outputs: every map that a frame can give, once. Download, Python, `run --write` and the page
// docs/use/formats.md take names, types and meanings from here.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <type_traits>
#include <vector>

#include "egosgm/frame.h"

namespace egosgm {

enum class Output {
  kDisparity,
  kVariance,
  kReason,
  kRightDisparity,
  kRightVariance,
  kPredicted,
  kPredictedVariance,
  kMeasured,
  kMeasuredVariance,
  kSearchWidth,
  kDynamic
};
inline constexpr std::size_t kOutputCount = static_cast<std::size_t>(Output::kDynamic) + 1;

/// A row of the table.
struct OutputText {
  Output output;
  const char* name;     // in Python, in messages and, after `debug` where it is there, in FrameOutputs
  const char* written;  // the folder of `run --write`; "": that writes none
  const char* unit;
  const char* meaning;
  const char* values;  // "float32", "uint16" or "uint8", as its view in FrameOutputs has them
};

/// Calls visit(text, view) for every map that a frame can give.
template <typename Outputs, typename Visit>
void for_each_output(Outputs& outputs, Visit&& visit) {
  const auto row = [&](Output output, const char* name, const char* written, const char* unit, const char* meaning,
                       auto& view) {
    constexpr bool kIsFloat = std::is_same_v<decltype(view.data), float*>;
    const char* values = kIsFloat ? "float32" : sizeof(*view.data) == 2 ? "uint16" : "uint8";
    visit(OutputText{output, name, written, unit, meaning, values}, view);
  };
  auto& debug = outputs.debug;
  row(Output::kDisparity, "disparity", "disparity", "px", "the left view's disparity", outputs.disparity);
  row(Output::kVariance, "variance", "variance", "px^2", "the disparity's variance", outputs.variance);
  row(Output::kReason, "reason", "reason", "", "why a pixel has no value, or a doubtful one: a number each",
      outputs.reason);
  row(Output::kRightDisparity, "right_disparity", "right", "px", "the right view's disparity", outputs.right_disparity);
  row(Output::kRightVariance, "right_variance", "", "px^2", "the right disparity's variance", outputs.right_variance);
  row(Output::kPredicted, "predicted", "predicted", "px", "the left view's disparity before matching", debug.predicted);
  row(Output::kPredictedVariance, "predicted_variance", "", "px^2", "the prediction's variance",
      debug.predicted_variance);
  row(Output::kMeasured, "measured", "measured", "px", "the left view's disparity after matching and its checks",
      debug.measured);
  row(Output::kMeasuredVariance, "measured_variance", "", "px^2", "the measurement's variance",
      debug.measured_variance);
  row(Output::kSearchWidth, "search_width", "search", "", "how many disparities could win at the pixel",
      debug.search_width);
  row(Output::kDynamic, "dynamic", "dynamic", "", "255 where something moves by itself; else 0", debug.dynamic);
}

inline std::vector<OutputText> output_texts() {
  std::vector<OutputText> texts;
  FrameOutputs outputs;
  for_each_output(outputs, [&](const OutputText& text, auto&) { texts.push_back(text); });
  return texts;
}

/// Outputs that a caller asks for. By default: the disparities of both views.
class Wanted {
 public:
  Wanted() : Wanted({Output::kDisparity, Output::kRightDisparity}) {}
  Wanted(std::initializer_list<Output> outputs) {
    for (const Output output : outputs) add(output);
  }

  void add(Output output) { bits_ |= bit(output); }
  bool has(Output output) const { return bits_ & bit(output); }
  /// Whether the right view is asked for; where it is not tracked, no later frame needs it.
  bool has_right() const { return has(Output::kRightDisparity) || has(Output::kRightVariance); }

 private:
  static unsigned bit(Output output) { return 1u << static_cast<unsigned>(output); }

  unsigned bits_ = 0;
};

/// What the views ask for that are not empty.
inline Wanted wanted_of(const FrameOutputs& outputs) {
  Wanted wanted({});
  for_each_output(outputs, [&](const OutputText& text, const auto& view) {
    if (view.data) wanted.add(text.output);
  });
  return wanted;
}

}  // namespace egosgm
