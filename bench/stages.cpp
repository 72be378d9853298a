// SPDX-License-Identifier: Apache-2.0
// Every stage alone: wall and device time, bytes moved, and their share of what a copy reaches on this device.
#include <functional>
#include <memory>
#include <utility>

#include "bench/device_copy.h"
#include "bench/report.h"
#include "bench/street.h"
#include "host/banded_sgm.h"
#include "host/census.h"
#include "host/coarse_match.h"
#include "host/consistency_check.h"
#include "host/dynamic_map.h"
#include "host/edge_rejection.h"
#include "host/forward_warp.h"
#include "host/frame_transfer.h"
#include "host/hole_fill.h"
#include "host/kalman_update.h"
#include "host/median_filter.h"
#include "host/ocl/device_handle.h"
#include "host/ocl/errors.h"
#include "host/output_variance.h"
#include "host/prediction_check.h"
#include "host/right_map.h"
#include "host/sad_check.h"
#include "host/search_band.h"
#include "host/speckle_removal.h"
#include "host/step_penalties.h"
#include "host/vertical_alignment.h"

namespace egosgm::bench {
namespace {

constexpr const char* kHelp =
    "egosgm_stages: every stage alone, both views, on a synthetic street.\n"
    "  --size WxH        only this size (else 640x480, 1242x375, 1920x1080)\n"
    "  --disparities N   only this range (else 64, 128, 256)\n"
    "  --rounds N        median of N measurements of at least 0.1 s each (3)\n"
    "  --threads N       compute units of PoCL (2)\n"
    "  --json FILE       write the rows\n"
    "  --benchmark_filter=REGEX and what else Google Benchmark knows\n"
    "Columns: ms wall clock; device_ms sum of the device's own times; GB_s: every map, image and band that a stage "
    "takes or gives\n"
    "counted once (no re-reads, no memory of its own but the path sums of BandedSgm: a byte a computed cell written "
    "and read), by wall\n"
    "clock; of_copy: the same as part of a copy's GB/s; Gcells_s: cells that are matched, both views.\n";

const MatchingCost kCost = BandedSgmOptions().cost;

struct Stage {
  const char* name;
  std::function<void()> enqueue;
  double bytes;      // what it must move
  double cells = 0;  // cells that can win (BandedSgm)
};

/// All stages in the order of a frame, each with what the one before made.
class Chain {
 public:
  Chain(ocl::Context& context, const Street& street, int disparities)
      : context_(context),
        size_(street.size),
        range_{0, disparities},
        motion_(street.motion),
        images_{ocl::Buffer<cl_uchar>(context, street.images.size()), PixelType::kU8},
        codes_(context, Census::words(kCost, size_, padding())),
        penalties_(context, StepPenalties::count(size_)),
        belief_(context, size_),
        warped_(context, size_),
        rejected_(context, size_),
        filled_(context, size_),
        predicted_(context, size_),
        matched_(context, size_),
        measured_(context, size_),
        updated_(context, size_),
        checked_(context, size_),
        forward_warp_(context, size_, street.calibration, {}, range_),
        edge_rejection_(context, size_, {}),
        hole_fill_(context, size_, {}),
        consistency_(context, size_),
        coarse_match_(context, size_, options(range_)),
        search_band_(context, size_, range_, {}),
        full_band_(context, size_, range_, {}),
        vertical_alignment_(context, size_, {}),
        census_(context, size_, PixelType::kU8, kCost, padding()),
        step_penalties_(context, size_, PixelType::kU8, {}),
        banded_sgm_(context, size_, range_, {.cost = kCost}),
        median_filter_(context, size_, {}),
        speckle_removal_(context, size_, {}),
        sad_check_(context, size_, PixelType::kU8, {.max_difference = 20.0f}),
        kalman_update_(context, size_, {}),
        prediction_check_(context, size_, {}),
        before_(context, 1),
        after_(context, 1),
        output_variance_(context, size_, {}),
        variance_(context, 2 * pixel_count(size_)),
        dynamic_map_(context, size_, {}),
        right_map_(context, size_, range_) {
    images_.pixels.write(context, street.images);
    belief_.disparity.write(context, street.disparity);
    belief_.variance.write(context, street.variance);
    full_band_.full_range();
    prediction_check_(nullptr, predicted_, predicted_, matched_, before_);
    predicted_.variance = filled_.variance = rejected_.variance = warped_.variance;  // taken over, run after run
    for (int pass = 0; pass < 2; ++pass) {  // fills the maps, and pays for what only a first launch costs
      for (const Stage& stage : stages()) stage.enqueue();
      context.wait();
      vertical_alignment_.commit();  // from now on it resamples
    }
  }

  std::vector<Stage> stages() {
    const double pixels = 2.0 * static_cast<double>(pixel_count(size_));
    const double map = 4 * pixels, maps = 2 * map, band = 12 * pixels, codes = 8 * pixels, grey = pixels;
    const double banded = cells(search_band_), full = cells(full_band_);
    const double sgm = 2 * (codes + band) + maps;  // each sweep reads codes and bands
    return {
        {"ForwardWarp", [this] { forward_warp_(belief_, motion_, warped_); }, 2 * maps},
        {"EdgeRejection", [this] { edge_rejection_(warped_, rejected_); }, 2 * maps},
        {"HoleFill", [this] { hole_fill_(rejected_, filled_); }, 2 * maps},
        {"ConsistencyCheck", [this] { consistency_(filled_, 3.0f, OutsideView::kKeep, predicted_); }, 2 * maps},
        {"CoarseMatch", [this] { coarse_match_(images_); }, grey},
        {"SearchBand", [this] { search_band_(predicted_, &predicted_, &coarse_match_.found()); }, maps + band},
        // Resampling both images, and the estimate on every fourth row of the left view.
        {"VerticalAlignment", [this] { align(); }, 2 * grey + (grey + map / 2) / 4},
        {"Census", [this] { census_(images_.pixels, codes_); }, grey + codes},
        {"StepPenalties", [this] { step_penalties_(images_.pixels, penalties_); }, grey + 8 * pixels},
        {"BandedSgm_full", [this] { banded_sgm_(codes_, penalties_, full_band_, measured_); }, sgm + 2 * full, full},
        {"BandedSgm_banded", [this] { banded_sgm_(codes_, penalties_, search_band_, matched_); }, sgm + 2 * banded,
         banded},
        {"MedianFilter", [this] { median_filter_(matched_, Holes::kLeave); }, 2 * map},
        {"SpeckleRemoval", [this] { speckle_removal_(matched_); }, map},
        {"KalmanUpdate", [this] { kalman_update_(before_, updated_, predicted_, matched_, updated_); }, 3 * maps},
        {"PredictionCheck", [this] { prediction_check_(&before_, predicted_, predicted_, matched_, after_); }, map / 4},
        {"DynamicMap", [this] { dynamic_map_(&predicted_, matched_, warped_); }, 4 * map + grey / 2},
        {"OutputVariance", [this] { output_variance_(updated_, measured_, 2, warped_, variance_); }, 11 * map},
        {"SadCheck", [this] { sad_check_(images_.pixels, updated_, checked_); }, grey + 2 * maps},
        {"RightMap", [this] { right_map_(matched_, 1.0f, checked_); }, 5 * map / 2},
    };
  }

 private:
  static PipelineOptions options(shared::DisparityRange range) {
    PipelineOptions options;
    options.min_disparity = range.min;
    options.disparities = range.count;
    return options;
  }

  int padding() const { return BandedSgm::code_padding(range_); }

  void align() { vertical_alignment_.estimate(vertical_alignment_.align(images_), predicted_); }

  /// That are matched, also those that cannot win.
  double cells(const SearchBand& band) {
    double sum = 0;
    for (const shared::RowSum& row : band.row_sums().read(context_)) sum += row.cells;
    return sum;
  }

  ocl::Context& context_;
  const shared::ImageSize size_;
  const shared::DisparityRange range_;
  const Motion motion_;
  FrameImages images_;
  ocl::Buffer<cl_uint> codes_;
  ocl::Buffer<cl_uchar> penalties_;
  StereoMaps belief_, warped_, rejected_, filled_, predicted_, matched_, measured_, updated_, checked_;
  ForwardWarp forward_warp_;
  EdgeRejection edge_rejection_;
  HoleFill hole_fill_;
  ConsistencyCheck consistency_;
  CoarseMatch coarse_match_;
  SearchBand search_band_, full_band_;
  VerticalAlignment vertical_alignment_;
  Census census_;
  StepPenalties step_penalties_;
  BandedSgm banded_sgm_;
  MedianFilter median_filter_;
  SpeckleRemoval speckle_removal_;
  SadCheck sad_check_;
  KalmanUpdate kalman_update_;
  PredictionCheck prediction_check_;
  PredictionCheck::State before_, after_;
  OutputVariance output_variance_;
  ocl::Buffer<float> variance_;
  DynamicMap dynamic_map_;
  RightMap right_map_;
};

void measure(benchmark::State& state, ocl::Context& context, const Stage& stage, double copy_gb_s) {
  using benchmark::Counter;
  double device_ms = 0;
  for (auto _ : state) {
    stage.enqueue();
    for (const auto& command : context.wait()) device_ms += command.ms;
  }
  state.counters["device_ms"] = Counter(device_ms, Counter::kAvgIterations);
  state.counters["GB_s"] = Counter(1e-9 * stage.bytes, Counter::kIsIterationInvariantRate);
  state.counters["of_copy"] = Counter(1e-9 * stage.bytes / copy_gb_s, Counter::kIsIterationInvariantRate);
  if (stage.cells > 0) state.counters["Gcells_s"] = Counter(1e-9 * stage.cells, Counter::kIsIterationInvariantRate);
}

void run_chain(const Device& device, shared::ImageSize size, int disparities, int rounds, double copy,
               std::vector<Row>& rows) {
  ocl::Context context(device.handle().device);
  ocl::translated(context, [&] {
    Chain chain(context, make_street(size, disparities), disparities);
    for (const Stage& stage : chain.stages()) {
      benchmark::RegisterBenchmark(benchmark_name(stage.name, size, disparities).c_str(),
                                   [&, stage](benchmark::State& state) { measure(state, context, stage, copy); })
          ->UseRealTime()
          ->MinTime(0.1)
          ->Repetitions(rounds);
    }
    run_registered(rows);
  });
}

int run(int argc, char** argv) {
  const Arguments arguments = parse_arguments(argc, argv, kHelp, 3);
  const Device device = Device::select();
  Machine machine{device.info(), 0, "a synthetic street", arguments.threads};
  {
    ocl::Context context(device.handle().device);
    machine.copy_gb_s = ocl::translated(context, [&] { return copy_gb_s(context); });
  }
  print_machine(machine);
  const std::vector<shared::ImageSize> all_sizes{{640, 480}, {1242, 375}, {1920, 1080}};
  const std::vector<int> all_ranges{64, 128, 256};
  std::vector<Row> rows;
  for (const shared::ImageSize size : arguments.size ? std::vector{*arguments.size} : all_sizes) {
    for (const int disparities : arguments.disparities ? std::vector{*arguments.disparities} : all_ranges) {
      run_chain(device, size, disparities, arguments.rounds, machine.copy_gb_s, rows);
    }
  }
  if (!arguments.json.empty()) write_json(arguments.json, machine, rows);
  return rows.empty() ? 1 : 0;
}

}  // namespace
}  // namespace egosgm::bench

int main(int argc, char** argv) { return egosgm::bench::guarded("egosgm_stages", egosgm::bench::run, argc, argv); }
