// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "egosgm/device.h"
#include "egosgm/export.h"
#include "egosgm/image.h"
#include "egosgm/reason.h"

namespace egosgm {

/// Maps that show how a frame's result came about, of the left view: what was predicted, measured and searched, and
/// what moves by itself.
struct DebugMaps {
  MapView<float> predicted, predicted_variance;  // before matching
  MapView<float> measured, measured_variance;    // after matching and its checks
  MapView<std::uint16_t> search_width;  // disparities that can win at each pixel; 0 in rows that are not matched
  // 255 where something moves by itself: the last image and the last map, moved by the camera's motion, contradict the
  // new ones. Else 0, also where that cannot be asked: everywhere without a prediction, or where the frame before was
  // not asked for this map.
  MapView<std::uint8_t> dynamic;
};

/// The destinations of a frame's maps: views of the caller's memory, width x height of the pipeline each. Empty views
/// are not filled and cost nothing. Disparities in pixels, variances in px^2; kInvalidDisparity (and variance 0) where
/// there is no value.
struct FrameOutputs {
  MapView<float> disparity, variance;              // the left view's result
  MapView<std::uint8_t> reason;                    // of each of its pixels, a Reason
  MapView<float> right_disparity, right_variance;  // the right view's
  DebugMaps debug;
};

/// Why a frame has no prediction.
enum class Unpredicted { kFirstFrame, kReset, kNoMotion, kNotTemporal };
/// "first frame", "reset", "no motion", "not temporal"; "" of a frame that has one.
EGOSGM_EXPORT const char* to_string(std::optional<Unpredicted> why_not);

/// Device time of a stage in one frame.
struct StageTime {
  std::string stage;
  double ms = 0;
};

/// A command of a frame on the device. Times by the driver, as std::chrono::steady_clock would say, or nearly so.
struct DeviceCommand {
  std::string stage;
  std::string name;  // of the kernel, or "map", "unmap", "read", "write", "fill", "wait" (for another queue)
  DeviceQueue queue = DeviceQueue::kKernels;
  std::int64_t queued_ns = 0, submitted_ns = 0, started_ns = 0, ended_ns = 0;
};

/// Figures of a frame.
///
/// `search_fraction`: all cells (a pixel and a disparity) that were matched / (width * height * D) of each view that
/// was searched at full size: the left one alone, or both in a frame of full range or with track_right. All: lanes
/// beside a band that were computed and cannot win, what CoarseMatch matched of both views, the second match of a frame
/// that knows no vertical offset, rows that stripes share. 1: as many as one match of the full range has; a first frame
/// has 2, and a D that fills no whole chunks more.
struct FrameReport {
  std::optional<Unpredicted> unpredicted;  // why nothing was predicted
  bool repeated = false;                   // images of the frame before: the motion counts for the next one
  bool searched_everything = false;        // the whole range at every pixel: without a prediction, or not trusting it
  double search_fraction = 0;              // see above
  double predicted_fraction = 0;           // left pixels with a prediction, of rows that are matched
  double density = 0;                      // left pixels with a disparity
  double vertical_offset_px = 0;           // by which the middle of the right image was resampled
  int launches = 0;                        // kernels enqueued
  int stripes = 1;                         // in which the image was matched; more than 1 where memory is too small
  std::vector<StageTime> stages;           // in the order in which they ran
  std::vector<DeviceCommand> commands;     // each of them, after record_commands(true)
  double total_ms = 0;                     // wall clock, upload to download, from when the frame before was collected
};

}  // namespace egosgm
