// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <CLI/App.hpp>

#include "apps/command.h"
#include "apps/counted.h"
#include "apps/interrupt.h"
#include "apps/option_group.h"
#include "apps/output_folder.h"
#include "apps/progress.h"
#include "apps/sequence_arguments.h"
#include "apps/standard_output.h"
#include "egosgm/vision/synthetic.h"
#include "vision/file_io.h"

namespace egosgm::app {
namespace {

/// By an interrupt, after so many frames.
struct Stopped {
  int frames;
};

struct SynthArguments {
  std::string out;
  vision::SyntheticOptions options;
  bool quiet = false;
};

int render(const SynthArguments& arguments) {
  arguments.options.validate();
  const std::filesystem::path folder = new_folder("--out", arguments.out);
  catch_interrupts();
  try {
    const vision::KeepFiles others;
    Progress progress(arguments.options.frames, arguments.quiet);
    vision::write_sequence(arguments.options, folder, [&](int done, int frames) {
      progress.done(fmt::format("rendered {} of {}", done, frames));
      if (done < frames && interrupted()) throw Stopped{done};
    });
  } catch (const Stopped& stopped) {
    say(fmt::format("egosgm: interrupted after {} of {} frames, which are whole in {}", stopped.frames,
                    arguments.options.frames, arguments.out));
    return kInterrupted;
  }
  if (!arguments.quiet) {
    fmt::print("{} in {}: egosgm run --odometry {} --out OUT\n", counted(arguments.options.frames, "frame"),
               arguments.out, shell_word(arguments.out));
  }
  return kOk;
}

}  // namespace

Command add_synth(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("synth", "Render a synthetic stereo sequence with exact disparity, masks and poses");
  auto arguments = std::make_shared<SynthArguments>();
  vision::SyntheticOptions& options = arguments->options;
  command->option_defaults()->always_capture_default();
  OptionGroup group(*command);
  group.add("--out", arguments->out, "DIR", "new folder, in the layout of KITTI odometry, with truth/ beside")
      ->required();
  group.add("--frames", options.frames, "N", "number of frames");
  group.add("--width", options.width, "W", "image width [px]");
  group.add("--height", options.height, "H", "image height [px]");
  group.add("--seed", options.seed, "S", "seed of street, texture and noise");
  group.add_flag("--plain", options.plain,
                 "what has no texture: a sky, which is nothing in the truth, walls and ground; people and poles");
  group.add_flag("--moving-object", options.moving_object,
                 "vehicles that move on their own; with --plain people who walk");
  group.add_flag("--traffic", options.traffic,
                 "with --moving-object also an oncoming car, one that turns off, and somebody who walks across");
  group.add("--speed", options.speed_m, "M", "travel per frame [m]");
  group.add("--turn", options.turn_deg, "DEG", "largest turn per frame [deg]");
  group.add("--exposure", options.exposure, "F", "scale of the grey values before noise; night: 0.08");
  group.add("--noise", options.noise_grey, "G", "sensor noise, standard deviation [grey values]");
  group.add("--pole-width", options.pole_width_px, "PX",
            "mean width of a pole 10 m ahead [px]; single ones from 2/3 to 4/3 of it");
  group.add("--pole-spacing", options.pole_spacing_m, "M", "mean distance of poles along either side [m]");
  group.add_flag("--quiet", arguments->quiet, "no progress");
  return {command, [arguments] { return render(*arguments); }};
}

}  // namespace egosgm::app
