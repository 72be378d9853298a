// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include "apps/command.h"
#include "apps/counted.h"
#include "apps/interrupt.h"
#include "apps/output_folder.h"
#include "apps/progress.h"
#include "apps/sequence_arguments.h"
#include "apps/standard_output.h"
#include "egosgm/vision/synthetic.h"
#include "host/vision/file_io.h"

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
  command->add_option("--out", arguments->out, "new folder, in the layout of KITTI odometry, with truth/ beside")
      ->type_name("DIR")
      ->required();
  command->add_option("--frames", options.frames, "number of frames")->type_name("N")->capture_default_str();
  command->add_option("--width", options.width, "image width [px]")->type_name("W")->capture_default_str();
  command->add_option("--height", options.height, "image height [px]")->type_name("H")->capture_default_str();
  command->add_option("--seed", options.seed, "seed of street, texture and noise")
      ->type_name("S")
      ->capture_default_str();
  command->add_flag("--plain", options.plain,
                    "what has no texture: a sky, which is nothing in the truth, walls and ground; people and poles");
  command->add_flag("--moving-object", options.moving_object,
                    "vehicles that move on their own; with --plain people who walk");
  command->add_option("--speed", options.speed_m, "travel per frame [m]")->type_name("M")->capture_default_str();
  command->add_option("--turn", options.turn_deg, "largest turn per frame [deg]")
      ->type_name("DEG")
      ->capture_default_str();
  command->add_option("--exposure", options.exposure, "scale of the grey values before noise; night: 0.08")
      ->type_name("F")
      ->capture_default_str();
  command->add_option("--noise", options.noise_grey, "sensor noise, standard deviation [grey values]")
      ->type_name("G")
      ->capture_default_str();
  command
      ->add_option("--pole-width", options.pole_width_px,
                   "mean width of a pole 10 m ahead [px]; single ones from 2/3 to 4/3 of it")
      ->type_name("PX")
      ->capture_default_str();
  command->add_option("--pole-spacing", options.pole_spacing_m, "mean distance of poles along either side [m]")
      ->type_name("M")
      ->capture_default_str();
  command->add_flag("--quiet", arguments->quiet, "no progress");
  return {command, [arguments] { return render(*arguments); }};
}

}  // namespace egosgm::app
