// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>
#include <fmt/ranges.h>

#include <CLI/App.hpp>
#include <CLI/Validators.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>

#include "apps/command.h"
#include "apps/device_arguments.h"
#include "apps/interrupt.h"
#include "apps/option_group.h"
#include "apps/output_folder.h"
#include "apps/standard_output.h"
#include "apps/tuning_file.h"
#include "egosgm/error.h"
#include "egosgm/pipeline.h"
#include "egosgm/vision/image.h"
#include "egosgm/vision/synthetic.h"

namespace egosgm::app {
namespace {

struct TuneArguments {
  std::string device, file, stage, cache;
  int width = 1242, height = 375, disparities = 128, rounds = 9;
};

/// Sizes to try together, and the stages whose time tells.
struct Trial {
  std::vector<std::string> stages;
  std::vector<std::vector<NamedOption>> candidates;
};

std::vector<NamedOption> pair(const char* first, int a, const char* second, int b) {
  return {{first, std::to_string(a)}, {second, std::to_string(b)}};
}

std::vector<Trial> trials(bool is_gpu) {
  std::vector<Trial> all(1, {{"BandedSgm"}, {}});
  auto& matching = all.front().candidates;
  if (is_gpu) {
    for (const int lanes : {4, 8, 16, 32, 64}) {
      for (const int lines : {1, 2, 4, 8}) {
        if (lanes * lines >= 16 && lanes * lines <= 256)
          matching.push_back(pair("path_lanes", lanes, "path_lines", lines));
      }
    }
    all.push_back({{"SearchBand", "SpeckleRemoval", "VerticalAlignment"}, {}});
    for (const char* size : {"32", "64", "128", "256"}) all.back().candidates.push_back({{"row_group", size}});
    return all;
  }
  for (const int width : {64, 96, 128, 192, 256}) {
    for (const int height : {16, 24, 32, 48}) matching.push_back(pair("tile_width", width, "tile_height", height));
  }
  for (const char* lanes : {"16", "32"}) matching.push_back({{"block_lanes", lanes}});
  all.push_back({{"ForwardWarp"}, {}});
  for (const char* rows : {"16", "24", "32", "48", "64"}) all.back().candidates.push_back({{"warp_band_rows", rows}});
  all.push_back({{"SpeckleRemoval"}, {}});
  for (const char* rows : {"12", "24", "48", "96"}) all.back().candidates.push_back({{"speckle_strip_rows", rows}});
  return all;
}

/// The trials of `stage`, or all where that is empty. Throws InvalidArgument where the device has none of it.
std::vector<Trial> trials_of(const std::string& stage, const DeviceInfo& device) {
  std::vector<Trial> all = trials(device.type == DeviceType::kGpu);
  if (stage.empty()) return all;
  std::erase_if(all, [&](const Trial& trial) {
    return std::find(trial.stages.begin(), trial.stages.end(), stage) == trial.stages.end();
  });
  if (!all.empty()) return all;
  throw InvalidArgument(
      fmt::format("--stage {}: has no sizes to choose on a {}: choose another stage", stage, to_string(device.type)));
}

/// The device's kept tuning without the sizes that are tried.
Tuning kept_beside(const std::vector<Trial>& trials, const std::filesystem::path& file, const DeviceInfo& device) {
  Tuning tuning;
  if (std::filesystem::is_regular_file(file)) tuning = kept_tuning(file, device).value_or(tuning);
  for (const Trial& trial : trials) {
    for (const std::vector<NamedOption>& sizes : trial.candidates) {
      for (const auto& [name, value] : sizes) set_tuning(tuning, name, "0");
    }
  }
  return tuning;
}

/// A short drive, and what a device with some tuning takes for it.
class Course {
 public:
  Course(const TuneArguments& arguments, const Device& device)
      : arguments_(arguments),
        device_(device),
        street_({.frames = 3, .width = arguments.width, .height = arguments.height}) {
    options_.disparities = arguments.disparities;
    for (int i = 0; i < street_.frames(); ++i) frames_.push_back(street_.render(i));
  }

  /// Least device time [ms] of each stage in a steady frame, or in a first one where a steady one has it not. The first
  /// call's maps are what all later ones must give.
  std::vector<StageTime> run(const Tuning& tuning) {
    Pipeline pipeline(street_.calibration(), arguments_.width, arguments_.height, options_,
                      device_.with_tuning(tuning));
    vision::Image disparity(arguments_.height, arguments_.width, vision::kF32);
    FrameOutputs outputs;
    outputs.disparity = vision::map_view(disparity);
    std::vector<std::vector<StageTime>> rounds;
    for (int round = 0; round < arguments_.rounds; ++round) {
      std::vector<StageTime> first;
      pipeline.reset();
      for (int i = 0; i < street_.frames(); ++i) {
        const std::optional<Motion> motion = i > 0 ? std::optional(street_.motion(i)) : std::nullopt;
        const FrameReport report = pipeline.process(vision::image_view(frames_[i].left),
                                                    vision::image_view(frames_[i].right), motion, outputs);
        if (i == 0) first = report.stages;
        if (i + 1 == street_.frames() && round > 0) rounds.push_back(with_missing(report.stages, first));
      }
    }
    expect_same(disparity);
    return least(rounds);
  }

 private:
  static std::vector<StageTime> with_missing(std::vector<StageTime> stages, const std::vector<StageTime>& others) {
    for (const StageTime& other : others) {
      if (std::none_of(stages.begin(), stages.end(), [&](const auto& s) { return s.stage == other.stage; })) {
        stages.push_back(other);
      }
    }
    return stages;
  }

  void expect_same(const vision::Image& disparity) {
    if (expected_.empty()) expected_ = disparity.clone();
    if (!std::equal(disparity.row<float>(0), disparity.row<float>(0) + disparity.pixels(), expected_.row<float>(0)))
      throw DeviceError(0, "tune: these sizes change the result on this device: please report it");
  }

  /// Other work on the machine only adds.
  static std::vector<StageTime> least(const std::vector<std::vector<StageTime>>& rounds) {
    std::vector<StageTime> result = rounds.front();
    for (const std::vector<StageTime>& round : rounds) {
      for (std::size_t stage = 0; stage < result.size(); ++stage) {
        result[stage].ms = std::min(result[stage].ms, round[stage].ms);
      }
    }
    return result;
  }

  const TuneArguments& arguments_;
  const Device device_;
  const vision::SyntheticSequence street_;
  PipelineOptions options_;
  std::vector<vision::SyntheticFrame> frames_;
  vision::Image expected_;
};

double ms_of(const std::vector<StageTime>& times, const std::vector<std::string>& stages) {
  double ms = 0;
  for (const StageTime& time : times) {
    if (std::find(stages.begin(), stages.end(), time.stage) != stages.end()) ms += time.ms;
  }
  return ms;
}

std::string text_of(const std::vector<NamedOption>& sizes) {
  std::string text;
  for (const auto& [name, value] : sizes) text += (text.empty() ? "" : ", ") + name + " " + value;
  return text;
}

/// Whether a device only has no such sizes: blocks of 32 lanes, of which its compiler makes no vectors, or groups.
bool is_of_sizes(const DeviceError& error) {
  constexpr int kInvalidWorkGroupSize = -54;  // as OpenCL numbers it
  return dynamic_cast<const BuildError*>(&error) || error.code() == kInvalidWorkGroupSize;
}

int stopped(const std::filesystem::path& file) {
  say(fmt::format("egosgm: interrupted: nothing is kept, {} is as it was", file.string()));
  return kInterrupted;
}

int tune(const TuneArguments& arguments) {
  catch_interrupts();
  const Device device = Device::select(arguments.device).with_cache(arguments.cache);
  const std::filesystem::path file =
      arguments.file.empty() ? user_tuning_file() : std::filesystem::path(arguments.file);
  if (file.empty()) throw InvalidArgument("tune: neither XDG_CONFIG_HOME nor HOME is set: give --file FILE");
  expect_no_folder("--file", file);
  const std::vector<Trial> trials = trials_of(arguments.stage, device.info());
  expect_tuning_file(file);
  Course course(arguments, device);
  Tuning best = kept_beside(trials, file, device.info());
  const std::vector<StageTime> untuned = course.run(best);
  constexpr double kGain = 0.98;  // less than 2 % is noise
  for (const Trial& trial : trials) {
    double least = ms_of(untuned, trial.stages);
    print_now(fmt::format("{}: {:.3f} ms with its defaults\n", fmt::join(trial.stages, " + "), least));
    for (const std::vector<NamedOption>& sizes : trial.candidates) {
      if (interrupted()) return stopped(file);
      Tuning candidate = best;
      for (const auto& [name, value] : sizes) set_tuning(candidate, name, value);
      double ms = 0;
      try {
        ms = ms_of(course.run(candidate), trial.stages);
      } catch (const DeviceError& error) {
        if (!is_of_sizes(error)) throw;
        print_now(fmt::format("  {:<36} not on this device\n", text_of(sizes)));
        continue;
      }
      const bool is_better = ms < kGain * least;
      print_now(fmt::format("  {:<36} {:8.3f} ms{}\n", text_of(sizes), ms, is_better ? "  the best so far" : ""));
      if (is_better) best = candidate, least = ms;
    }
  }
  if (interrupted()) return stopped(file);
  store_tuning(file, device.info(), best);
  fmt::print("Kept for {}, driver {}: {}\n", device.info().name, device.info().driver, file.string());
  return kOk;
}

}  // namespace

Command add_tune(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("tune", "Measure what tile and work-group sizes suit a device, and keep them");
  auto arguments = std::make_shared<TuneArguments>();
  OptionGroup output(*command, "Output");
  output.add("--file", arguments->file, "FILE",
             "where to keep them; other devices' stay [$XDG_CONFIG_HOME/egosgm/tuning.json, which egosgm run reads]");
  OptionGroup method(*command, "Method");
  method.add("--width", arguments->width, "N", "of the images to measure with, px [1242]")->check(CLI::Range(1, 8192));
  method.add("--height", arguments->height, "N", "[375]")->check(CLI::Range(1, 8192));
  method.add("--disparities", arguments->disparities, "N", "[128]")->check(CLI::Range(1, 4096));
  method.add("--rounds", arguments->rounds, "N", "runs with each size, the first of which does not count [9]")
      ->check(CLI::Range(2, 1000));
  method.add("--stage", arguments->stage, "NAME", "only the sizes of this one; the others stay")
      ->check(CLI::IsMember({"BandedSgm", "ForwardWarp", "SpeckleRemoval", "SearchBand", "VerticalAlignment"}));
  add_device_option(*command, "--device", arguments->device);
  add_device_option(*command, "--cache", arguments->cache);
  return {command, [arguments] { return tune(*arguments); }};
}

}  // namespace egosgm::app
