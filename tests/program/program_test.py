# SPDX-License-Identifier: Apache-2.0
"""The program from outside: every subcommand, wrong arguments, broken input, interrupts, full disks.

EGOSGM_PROGRAM names the program, EGOSGM_EXAMPLES the folder of the examples; EGOSGM_DATA the folder of real data (tests that need it are skipped without).
"""
import json
import os
import pathlib
import pty
import re
import resource
import select
import shutil
import signal
import struct
import subprocess
import tempfile
import time
import unittest
import zlib

PROGRAM = os.environ["EGOSGM_PROGRAM"]
EXAMPLES = pathlib.Path(os.environ.get("EGOSGM_EXAMPLES", ""))
SOURCE = pathlib.Path(__file__).resolve().parents[2]
DATA = os.environ.get("EGOSGM_DATA", "")
WIDTH, HEIGHT, FRAMES = 320, 96, 4


def egosgm(*arguments, **options):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=240, **options)


def grey_png(width, height, depth=8):
    """A textured PNG, built here so that sizes and depths are free."""
    rows = b"".join(b"\0" + bytes((x * 7 + y * 13 + x * y) % 256 for x in range(width * depth // 8)) for y in range(height))

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", width, height, depth, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


class ProgramTest(unittest.TestCase):
    """A folder with a small synthetic sequence for each class, and a copy of it for each test that breaks it."""

    @classmethod
    def setUpClass(cls):
        cls.folder_holder = tempfile.TemporaryDirectory(prefix="egosgm_program_")
        cls.folder = pathlib.Path(cls.folder_holder.name)
        cls.street = cls.folder / "street"
        done = egosgm("synth", "--out", cls.street, "--frames", FRAMES, "--width", WIDTH, "--height", HEIGHT, "--seed", 7, "--quiet")
        assert done.returncode == 0, done.stderr

    @classmethod
    def tearDownClass(cls):
        cls.folder_holder.cleanup()

    def new_folder(self):
        return pathlib.Path(tempfile.mkdtemp(dir=self.folder))

    def broken_street(self):
        copy = self.new_folder() / "street"
        shutil.copytree(self.street, copy)
        return copy

    def assert_works(self, *arguments, **options):
        done = egosgm(*arguments, **options)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stderr, "")
        return done.stdout

    def assert_refused(self, arguments, *named, code=2, **options):
        """One line on the standard error that holds every text of `named`, and the exit code."""
        done = egosgm(*arguments, **options)
        lines = [line for line in done.stderr.splitlines() if line]
        self.assertEqual(done.returncode, code, f"{arguments}: {done.stdout}{done.stderr}")
        self.assertEqual(len(lines), 1, done.stderr)
        self.assertTrue(lines[0].startswith("egosgm: error: "), lines[0])
        for text in named:
            self.assertIn(str(text), lines[0])

    def report(self, out):
        return json.loads((out / "report.json").read_text())

    def assert_whole(self, out, at_least=0):
        """Everything in `out` can be read, and nothing temporary is left."""
        maps = sorted((out / "disparity").glob("*"))
        self.assertGreaterEqual(len(maps), at_least)
        for file in maps:
            self.assertRegex(file.name, r"^\d{6}\.png$")
            self.assert_works("eval", "--estimate", file, "--truth", file)
        return len(maps)


class Help(ProgramTest):
    def test_every_subcommand_explains_itself(self):
        for command in ("run", "eval", "devices", "synth", "odometry", "eval-poses", "tune", "view", "report", "doctor", "rectify", "completion"):
            self.assertIn("--help", self.assert_works(command, "--help"))
            self.assertIn(command, self.assert_works("--help"))

    def test_run_lists_all_its_options_and_those_of_the_stages(self):
        text = self.assert_works("run", "--help")
        for option in ("--kitti", "--scene", "--odometry", "--left", "--right", "--calib", "--frames", "--out", "--poses", "--preset",
                       "--search", "--temporal", "--paths", "--disparities", "--min-disparity", "--device", "--tuning", "--interpolate",
                       "--write", "--trace", "--resume", "--overwrite", "--set", "--config", "--save-config", "--quiet", "banded_sgm.p2", "kalman_update.gate_px"):
            self.assertIn(option, text)

    def test_version(self):
        self.assertRegex(self.assert_works("--version"), r"^egosgm \d+\.\d+\.\d+\n$")

    def complete(self, *words):
        """What bash offers after these words."""
        script = self.new_folder() / "completion.bash"
        script.write_text(self.assert_works("completion", "bash"))
        line = " ".join(f"'{word}'" for word in ("egosgm", *words))
        code = f"shopt -s expand_aliases; compopt() {{ :; }}; source {script}; COMP_WORDS=({line}); COMP_CWORD={len(words)}; " \
               '_egosgm; printf "%s\\n" "${COMPREPLY[@]}"'
        return subprocess.run(["bash", "-euc", code], capture_output=True, text=True, check=True, cwd=self.folder).stdout.split()

    def test_bash_completes_commands_options_and_values(self):
        self.assertEqual(self.complete("ru"), ["run"])
        self.assertIn("eval-poses", self.complete("e"))
        self.assertEqual(self.complete("run", "--disp"), ["--disparities"])
        self.assertEqual(self.complete("run", "--preset", "p"), ["paper"])
        self.assertEqual(self.complete("run", "--odometry", "str"), ["street"])
        self.assertIn("banded_sgm.p2=", self.complete("run", "--set", "banded_sgm.p"))
        self.assertEqual(self.complete("run", "--write", "color,ov"), ["color,overview"])
        self.assertEqual(self.complete("run", "--disparities", ""), [])
        self.assertEqual(self.complete("odometry", "str"), ["street"])
        self.assert_refused(["completion", "fish"], "bash or zsh")

    @unittest.skipUnless(shutil.which("zsh"), "no zsh")
    def test_zsh_completes_commands_options_and_values(self):
        script = self.new_folder() / "completion.zsh"
        script.write_text(self.assert_works("completion", "zsh"))
        terminal, side = pty.openpty()
        process = subprocess.Popen(["zsh", "-f", "-i"], stdin=side, stdout=side, stderr=side, cwd=self.folder, start_new_session=True,
                                   env=dict(os.environ, TERM="dumb", PS1="", HOME=str(self.folder)))
        os.close(side)

        def wait_for(text):
            seen = b""
            while text not in seen:
                self.assertTrue(select.select([terminal], [], [], 60)[0], f"zsh shows no {text}: {seen}")
                seen += os.read(terminal, 4096).replace(b"\a", b"")  # it may complete only a part, and beep

        try:
            os.write(terminal, f"unsetopt zle_bracketed_paste; autoload -U compinit; compinit -u -D; source {script}; echo rea''dy\n".encode())
            wait_for(b"ready")
            for typed, completed in (("view --vid", "--video"), ("run --odometry st", "street/"), ("run --preset pap", "paper"),
                                     ("run --set banded_sgm.p2_s", "banded_sgm.p2_slope="), ("run --write ove", "overview"), ("devi", "devices")):
                os.write(terminal, f"egosgm {typed}\t".encode())
                wait_for(completed.encode())
                os.write(terminal, b"\x15")  # clears the line
        finally:
            process.kill()
            process.wait()
            os.close(terminal)

    def test_devices_names_the_default_and_why(self):
        text = self.assert_works("devices")
        self.assertIn("* 0", text)
        self.assertIn("is taken by default", text)
        devices = json.loads(self.assert_works("devices", "--json"))
        self.assertEqual(sum(device["default"] for device in devices), 1)

    def test_without_a_device_it_says_how_to_install_one(self):
        nothing = dict(os.environ, OCL_ICD_VENDORS="/nonexistent")
        self.assert_refused(["devices"], "pocl-opencl-icd", env=nothing)
        self.assert_refused(["run", "--odometry", self.street, "--out", self.new_folder()], "pocl-opencl-icd", env=nothing)


class Example(ProgramTest):
    def run_example(self, name, *arguments, **options):
        return subprocess.run([EXAMPLES / f"egosgm_example_{name}", *arguments], capture_output=True, text=True, timeout=240, **options)

    def assert_gives_what_the_program_gives(self, example, options=(), arguments=()):
        out, own = self.new_folder(), self.new_folder()
        self.assert_works("run", "--odometry", self.street, "--out", out, *options)
        done = self.run_example(example, self.street, *arguments, cwd=own)
        self.assertEqual(done.returncode, 0, done.stderr)
        for file in (out / "disparity").iterdir():
            self.assertEqual(file.read_bytes(), (own / file.name).read_bytes(), file.name)

    def test_minimal_gives_what_the_program_gives(self):
        self.assert_gives_what_the_program_gives("minimal")

    def test_own_poses_gives_what_the_program_gives(self):
        poses = self.street / "poses.txt"
        self.assert_gives_what_the_program_gives("own_poses", ["--poses", poses], [poses])

    def test_opencv_types_gives_a_pair_in_kittis_format(self):
        out = self.new_folder()
        left, right = (self.street / f"image_{side}/000000.png" for side in (0, 1))
        done = self.run_example("opencv_types", left, right, out / "steps.png")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assert_works("run", "--odometry", self.street, "--frames", "0", "--out", out, "--temporal", "off")
        steps, own = (json.loads(self.assert_works("eval", "--estimate", file, "--truth",
                                                   self.street / "truth/left_disp_noc/000000.png", "--json"))["pooled"]
                      for file in (out / "steps.png", out / "disparity/000000.png"))
        self.assertAlmostEqual(steps["bad_of_valid"], own["bad_of_valid"], delta=1)
        self.assertGreater(steps["density"], 90)  # the sky's disparity rounds to no step
        self.assertNotEqual(self.run_example("opencv_types", left, self.street / "calib.txt", out / "no.png").returncode, 0)

    def test_the_readme_shows_it(self):
        shown = (SOURCE / "README.md").read_text().split("```cpp\n")[1].split("```")[0]
        self.assertIn(shown.strip(), (SOURCE / "examples/minimal.cpp").read_text())

    def test_the_comparison_names_tests_that_exist(self):
        claims = (SOURCE / "docs/comparison.md").read_text().split("## Each claim")[1]
        sources = "".join(file.read_text() for folder in ("tests", "bench") for kind in ("*.cpp", "*.py") for file in (SOURCE / folder).rglob(kind))
        named = [name for name in re.findall("`([A-Za-z_0-9.]+)`", claims) if "test_" in name or "." in name]
        self.assertGreater(len(named), 20)
        for name in named:
            suite, _, test = name.rpartition(".")
            if test.startswith("test_"):
                self.assertIn(f"def {test}(", sources)
            else:
                self.assertRegex(sources, rf"TEST(_F|_P)?\({suite}, {test}\)")

    def test_the_readme_names_every_subcommand_and_exit_code(self):
        text = (SOURCE / "README.md").read_text()
        for name in ("run", "eval", "devices", "synth", "odometry", "eval-poses", "tune", "view", "report", "doctor", "rectify", "completion"):
            self.assertIn(f"`{name}`", text)
        self.assertIn("130", text)


class Run(ProgramTest):
    def test_writes_maps_poses_and_report(self):
        out = self.new_folder()
        text = self.assert_works("run", "--odometry", self.street, "--out", out)
        self.assertEqual(self.assert_whole(out), FRAMES)
        self.assertEqual(len((out / "poses.txt").read_text().splitlines()), FRAMES)
        self.assertIn("frame 000003", text)
        report = self.report(out)
        self.assertTrue(report["finished"])
        for key in ("device", "driver", "version", "options"):
            self.assertTrue(report[key])
        self.assertEqual([frame["frame"] for frame in report["frames"]], list(range(FRAMES)))
        for frame in report["frames"]:
            for fraction in ("search_fraction", "computed_fraction", "predicted_fraction", "density"):
                self.assertTrue(0 <= frame[fraction] <= 1, fraction)
            self.assertGreater(frame["ms"]["total"], 0)
            self.assertIn("BandedSgm", frame["ms"])
        first, later = report["frames"][0], report["frames"][-1]
        self.assertEqual((first["search_fraction"], first["full_range"], first["full_range_reason"]), (1, True, "first frame"))
        self.assertIsNone(first["odometry"]["motion"])
        self.assertLess(later["search_fraction"], 0.5)
        self.assertGreater(later["odometry"]["inliers"], 10)
        self.assertAlmostEqual(later["odometry"]["motion"]["translation_m"][2], -0.8, delta=0.1)

    def test_writes_what_is_asked_for(self):
        out = self.new_folder()
        kinds = "variance,color,predicted,measured,right,interpolated,search,dynamic,pfm,overview,cloud,depth,depth_m"
        self.assert_works("run", "--odometry", self.street, "--out", out, "--write", kinds, "--frames", "1:2", "--quiet")
        for kind in kinds.split(","):
            extension = "pfm" if kind in ("variance", "pfm", "depth_m") else "ply" if kind == "cloud" else "png"
            self.assertEqual([f.name for f in sorted((out / kind).iterdir())], [f"00000{i}.{extension}" for i in (1, 2)])
        text = json.loads(self.assert_works("eval", "--estimate", out / "interpolated", "--truth",
                                            self.street / "truth/left_disp_occ", "--json"))
        self.assertEqual(text["pooled"]["density"], 100)

    def test_interpolate_fills_a_folder_of_its_own(self):
        out = self.new_folder()
        self.assert_works("run", "--odometry", self.street, "--out", out, "--interpolate", "--frames", "0")
        self.assertTrue((out / "interpolated/000000.png").exists())

    def test_frames_keep_their_own_numbers(self):
        out = self.new_folder()
        self.assert_works("run", "--odometry", self.street, "--out", out, "--frames", "2:3")
        self.assertEqual([f.name for f in sorted((out / "disparity").iterdir())], ["000002.png", "000003.png"])
        self.assertEqual([frame["frame"] for frame in self.report(out)["frames"]], [2, 3])
        self.assertTrue((out / "poses.txt").read_text().startswith("1.0000"))

    def test_same_bits_twice_and_quiet_says_nothing(self):
        first, second = self.new_folder(), self.new_folder()
        for out in (first, second):
            self.assertEqual(self.assert_works("run", "--odometry", self.street, "--out", out, "--quiet", "--write", "variance"), "")
        for file in [*first.glob("disparity/*"), *first.glob("variance/*"), first / "poses.txt"]:
            self.assertEqual(file.read_bytes(), (second / file.relative_to(first)).read_bytes(), file.name)

    def test_a_trace_holds_every_command_and_step_of_the_host(self):
        out, plain, file = self.new_folder(), self.new_folder(), self.new_folder() / "trace.json"
        self.assert_works("run", "--odometry", self.street, "--out", out, "--trace", file)
        self.assert_works("run", "--odometry", self.street, "--out", plain)
        for picture in (plain / "disparity").iterdir():
            self.assertEqual(picture.read_bytes(), (out / "disparity" / picture.name).read_bytes())
        events = json.loads(file.read_text())["traceEvents"]
        rows = {event["tid"]: event["args"]["name"] for event in events if event["name"] == "thread_name"}
        spans = [event for event in events if event["ph"] == "X"]
        frames = {f"{index:06}" for index in range(FRAMES)}
        self.assertEqual({span["args"]["frame"] for span in spans}, frames)
        for step in ("read", "odometry", "write"):
            self.assertEqual([span["args"]["frame"] for span in spans if span["name"] == step and span["cat"] == "host"], sorted(frames))
        for frame in self.report(out)["frames"]:
            commands = [span for span in spans if int(span["args"]["frame"]) == frame["frame"] and span["cat"] != "host"]
            kernels = [span for span in commands if span["name"] not in ("fill", "wait", "map", "unmap", "read", "write")]
            self.assertEqual(len(kernels), frame["launches"])
            self.assertEqual({rows[span["tid"]] for span in kernels}, {"device: kernels"})
            self.assertEqual({rows[span["tid"]] for span in commands}, {"device: upload", "device: kernels", "device: download"})
            self.assertIn(("BandedSgm", "sweep_forward"), {(span["cat"], span["name"]) for span in kernels})
        for span in spans:
            self.assertGreaterEqual(span["dur"], 0)
            if span["cat"] != "host":
                self.assertLessEqual(span["args"]["queued_us"], span["args"]["submitted_us"])
                self.assertLessEqual(span["args"]["submitted_us"], span["ts"])
        for row in rows:  # in-order queues: what overlaps in a row, no viewer can draw
            in_row = sorted((span["ts"], span["ts"] + span["dur"]) for span in spans if span["tid"] == row)
            for before, after in zip(in_row, in_row[1:]):
                self.assertLessEqual(before[1], after[0] + 50)  # us: clocks of host and device are aligned frame by frame
        self.assert_refused(["run", "--odometry", self.street, "--out", self.new_folder(), "--trace", "/nonexistent/trace.json"],
                            "/nonexistent/trace.json", code=1)

    def test_tune_keeps_sizes_that_run_uses_and_change_no_bit(self):
        folder = self.new_folder()
        plain, tuned, file = folder / "plain", folder / "tuned", folder / "egosgm/tuning.json"
        environment = dict(os.environ, XDG_CONFIG_HOME=str(folder))
        self.assert_works("tune", "--width", 64, "--height", 24, "--disparities", 16, "--rounds", 2, "--stage", "SpeckleRemoval", env=environment)
        stored = json.loads(file.read_text())
        self.assertEqual(len(stored), 1)
        key, sizes = stored.popitem()
        self.assertIn("driver", key)
        self.assertIn("tile_width", sizes)
        sizes.update(tile_width=32, tile_height=8, warp_band_rows=5)
        file.write_text(json.dumps({"another device, driver 1": {"tile_width": "nonsense"}, key: sizes}))
        self.assert_works("run", "--odometry", self.street, "--out", tuned, "--trace", folder / "tuned.json", env=environment)
        self.assert_works("run", "--odometry", self.street, "--out", plain, "--tuning", "none", env=environment)
        for picture in (plain / "disparity").iterdir():
            self.assertEqual(picture.read_bytes(), (tuned / "disparity" / picture.name).read_bytes())
        self.assertGreater(self.report(tuned)["frames"][2]["launches"], self.report(plain)["frames"][2]["launches"])  # more, smaller tiles
        for broken in ("", "[]", "{", json.dumps({key: {"tile_width": 3, "tile_height": 3}}), json.dumps({key: {"tiles": 3}}),
                       json.dumps({key: 7}), json.dumps({key: {"tile_width": "wide"}})):
            file.write_text(broken)
            self.assert_refused(["run", "--odometry", self.street, "--out", plain], file, "egosgm tune", env=environment)
        self.assert_refused(["run", "--odometry", self.street, "--out", plain, "--tuning", "/nonexistent"], "/nonexistent")
        self.assert_refused(["tune", "--file", "/proc/tuning.json"], "/proc/tuning.json", code=1)

    def test_a_terminal_gets_a_bar(self):
        terminal, side = pty.openpty()
        with subprocess.Popen([PROGRAM, "run", "--odometry", self.street, "--out", self.new_folder()], stdout=side) as process:
            os.close(side)
            text = b""
            try:
                while part := os.read(terminal, 4096):
                    text += part
            except OSError:  # the program has closed its end
                pass
        os.close(terminal)
        self.assertEqual(process.returncode, 0)
        self.assertIn(b"frames/s", text)
        self.assertIn(f"{FRAMES}/{FRAMES}".encode(), text)
        self.assertGreaterEqual(text.count(b"\r\x1b[K"), FRAMES)

    def test_temporal_off_searches_everything(self):
        out = self.new_folder()
        self.assert_works("run", "--odometry", self.street, "--out", out, "--temporal", "off")
        for frame in self.report(out)["frames"]:
            self.assertEqual((frame["search_fraction"], frame["full_range"], frame["predicted_fraction"]), (1, True, 0))

    def test_search_full_still_predicts(self):
        out = self.new_folder()
        self.assert_works("run", "--odometry", self.street, "--out", out, "--search", "full")
        last = self.report(out)["frames"][-1]
        self.assertEqual(last["search_fraction"], 1)
        self.assertGreater(last["predicted_fraction"], 0.5)

    def test_poses_take_the_place_of_odometry(self):
        out = self.new_folder()
        self.assert_works("run", "--odometry", self.street, "--out", out, "--poses", self.street / "poses.txt")
        self.assertEqual(self.report(out)["frames"][-1]["odometry"]["source"], "poses file")
        drift = json.loads(self.assert_works("eval-poses", "--estimate", out / "poses.txt", "--truth", self.street / "poses.txt",
                                             "--json"))
        self.assertLess(drift["end_drift_m"], 1e-6)

    def test_patterns_and_16_bit_images_and_odd_sizes(self):
        folder = self.new_folder()
        for side in ("left", "right"):
            for i in (1, 2):
                (folder / f"{side}_{i}.png").write_bytes(grey_png(65, 31, depth=16))
        (folder / "calib.toml").write_text("fx = 100\nfy = 100\ncx = 32\ncy = 15\nbaseline_m = 0.5\n")
        out = self.new_folder()
        self.assert_works("run", "--left", folder / "left_%d.png", "--right", folder / "right_%d.png", "--calib",
                          folder / "calib.toml", "--out", out, "--disparities", 19, "--min-disparity", "-3", "--paths", 4)
        self.assertEqual(self.assert_whole(out), 2)
        options = self.report(out)["options"]
        self.assertEqual((options["disparities"], options["min_disparity"], options["banded_sgm.paths"]), (19, -3, 4))

    def test_a_saved_configuration_gives_the_same_bits(self):
        first, second = self.new_folder(), self.new_folder()
        saved, again = first / "saved.toml", second / "again.toml"
        self.assert_works("run", "--odometry", self.street, "--out", first, "--preset", "paper", "--set", "banded_sgm.p2=97",
                          "--set", "search_band.sigmas=2.7", "--disparities", 50, "--save-config", saved)
        self.assert_works("run", "--odometry", self.street, "--out", second, "--config", saved, "--save-config", again)
        self.assertEqual(saved.read_text(), again.read_text())
        for file in first.glob("disparity/*"):
            self.assertEqual(file.read_bytes(), (second / "disparity" / file.name).read_bytes())

    def test_the_last_choice_wins_preset_config_set_named(self):
        folder = self.new_folder()
        config = folder / "config.toml"
        config.write_text("# a comment\ndisparities = 40\n[banded_sgm]\np1 = 7\np2 = 77\n")
        self.assert_works("run", "--odometry", self.street, "--out", folder / "out", "--frames", "0", "--config", config, "--set",
                          "banded_sgm.p2=88", "--set", "disparities=41", "--disparities", 42)
        options = self.report(folder / "out")["options"]
        self.assertEqual((options["disparities"], options["banded_sgm.p1"], options["banded_sgm.p2"]), (42, 7, 88))

    def test_paper_preset_searches_everything_that_is_not_predicted(self):
        default, paper = self.new_folder(), self.new_folder()
        self.assert_works("run", "--odometry", self.street, "--out", default)
        self.assert_works("run", "--odometry", self.street, "--out", paper, "--preset", "paper")
        self.assertGreater(self.report(paper)["frames"][-1]["search_fraction"],
                           self.report(default)["frames"][-1]["search_fraction"])


class View(ProgramTest):
    """A smaller sequence, since what is looked at is the same."""

    def png_size(self, file):
        return struct.unpack(">II", file.read_bytes()[16:24])

    def test_pictures_and_a_video_without_a_display(self):
        out = self.new_folder()
        headless = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
        video = ["--video", out / "street.avi"]  # OpenCV writes it without FFmpeg
        text = self.assert_works("view", "--odometry", self.street, "--pictures", out / "pictures", *video, "--cell-width", 200,
                                 env=headless)
        self.assertIn("frame 000003", text)
        pictures = sorted((out / "pictures").iterdir())
        self.assertEqual([file.name for file in pictures], [f"00000{i}.png" for i in range(FRAMES)])
        width, height = self.png_size(pictures[0])
        self.assertEqual(width, 404)  # two panels and a gap
        self.assertGreater(height, 3 * HEIGHT * 200 / WIDTH)  # three rows, the last one for the error
        self.assertEqual([file.name for file in out.iterdir() if file.is_file()], ["street.avi"])
        content = (out / "street.avi").read_bytes()
        self.assertEqual((content[:4], content[8:12]), (b"RIFF", b"AVI "))
        self.assertEqual(content.count(b"00dc") // 2, FRAMES)  # each frame stands in the stream and in the index

    def test_without_truth_there_is_no_error_panel(self):
        street, heights = self.broken_street(), []
        for name in ("with", "without"):
            self.assert_works("view", "--odometry", street, "--pictures", street / name, "--frames", "0", "--quiet")
            heights.append(self.png_size(street / name / "000000.png")[1])
            shutil.rmtree(street / "truth", ignore_errors=True)
        self.assertGreater(heights[0], heights[1])

    def test_what_cannot_be_shown_is_refused(self):
        headless = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
        view = ["view", "--odometry", self.street]
        self.assert_refused(view, "--video", "--pictures", env=headless)
        for name in ("DISPLAY", "WAYLAND_DISPLAY"):  # a display that is not there
            self.assert_refused(view, f":77777 ({name})", "--video", "--pictures", env={**headless, name: ":77777"})
        self.assert_refused([*view, "--video", self.folder / "street.mkv"], ".mp4 or .avi")
        self.assert_refused([*view, "--pictures", self.folder / "p", "--fps", 0], "--fps 0")
        self.assert_refused([*view, "--pictures", self.folder / "p", "--cell-width", 0], "1..32768")
        self.assert_refused([*view, "--pictures", self.street / "calib.txt/p"], "calib.txt", code=1)

    @unittest.skipUnless(shutil.which("Xvfb"), "no Xvfb")
    def test_the_window_plays_until_it_is_told_to_stop(self):
        # A number of its own: those that Xvfb finds free may be taken in another root folder on this machine.
        display = f":{1000 + os.getpid() % 50000}"
        with subprocess.Popen(["Xvfb", display, "-nolisten", "tcp"], stderr=subprocess.DEVNULL) as screen:
            try:
                self.wait_until(pathlib.Path(f"/tmp/.X11-unix/X{display[1:]}").exists)
                process = subprocess.Popen([PROGRAM, "view", "--odometry", self.street], stderr=subprocess.PIPE, text=True,
                                           env=dict(os.environ, DISPLAY=display))
                with self.assertRaises(subprocess.TimeoutExpired):  # it stays open after the last frame
                    process.wait(timeout=8)
                process.send_signal(signal.SIGINT)
                _, errors = process.communicate(timeout=60)
                self.assertEqual(process.returncode, 130, errors)
                self.assertNotIn("error", errors)
            finally:
                screen.terminate()

    def wait_until(self, is_so):
        for _ in range(100):
            if is_so():
                return
            time.sleep(0.1)
        self.fail("waited 10 s in vain")


class Accuracy(ProgramTest):
    def test_synthetic_sequence_with_true_poses(self):
        street, out = self.new_folder(), self.new_folder()
        self.assert_works("synth", "--out", street, "--frames", 20, "--quiet")
        self.assert_works("run", "--odometry", street, "--poses", street / "poses.txt", "--out", out, "--quiet")
        for i in range(3):
            (out / f"disparity/00000{i}.png").unlink()
        result = json.loads(self.assert_works("eval", "--estimate", out, "--truth", street / "truth/left_disp_noc", "--json"))
        self.assertEqual(len(result["pairs"]), 17)
        self.assertEqual(len(result["without_estimate"]), 3)
        self.assertLessEqual(result["pooled"]["bad_or_missing"], 2.0)

    def test_odometry_of_a_synthetic_sequence(self):
        street, poses = self.new_folder(), self.new_folder() / "poses.txt"
        self.assert_works("synth", "--out", street, "--frames", 8, "--quiet")
        self.assert_works("odometry", street, "--out", poses)
        drift = json.loads(self.assert_works("eval-poses", "--estimate", poses, "--truth", street / "poses.txt", "--json"))
        self.assertEqual(drift["frames"], 8)
        self.assertEqual(len(drift["motions"]), 7)
        self.assertLess(drift["end_drift_percent"], 0.5)
        folder = self.new_folder()
        self.assert_works("eval-poses", "--estimate", poses, "--truth", street / "poses.txt", "--plot", folder / "path.svg", "--plot",
                          folder / "path.png")
        self.assertIn("<svg", (folder / "path.svg").read_text())
        self.assertTrue((folder / "path.png").read_bytes().startswith(b"\x89PNG"))

    def test_bounds_on_the_motion(self):
        street, poses = self.street, self.new_folder() / "poses.txt"
        done = egosgm("odometry", street, "--out", poses, "--max-translation", 0.5)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("exceeds the bound of 0.50 m", done.stdout + done.stderr)
        self.assert_refused(["odometry", street, "--out", poses, "--max-rotation", "-1"], "max_rotation_deg")
        self.assert_refused(["run", "--odometry", street, "--out", self.folder / "never", "--max-translation", "0"], "max_translation_m")
        self.assert_refused(["eval-poses", "--estimate", poses, "--truth", street / "poses.txt", "--plot", "path.jpg"], "path.jpg", ".svg")


class Synth(ProgramTest):
    def test_moving_objects_have_masks(self):
        street = self.new_folder() / "street"
        self.assert_works("synth", "--out", street, "--frames", 2, "--width", 160, "--height", 64, "--moving-object")
        for folder in ("image_0", "image_1", "truth/left_disp_occ", "truth/right_disp_noc", "truth/left_moving"):
            self.assertEqual([f.name for f in sorted((street / folder).iterdir())], ["000000.png", "000001.png"], folder)
        for file in ("calib.txt", "poses.txt", "times.txt"):
            self.assertTrue((street / file).read_text().strip(), file)

    def test_a_seed_is_a_street(self):
        first, same, other = (self.new_folder() / "street" for _ in range(3))
        for street, seed in ((first, 3), (same, 3), (other, 4)):
            self.assert_works("synth", "--out", street, "--frames", 1, "--width", 80, "--height", 40, "--seed", seed, "--quiet")
        image = "image_0/000000.png"
        self.assertEqual((first / image).read_bytes(), (same / image).read_bytes())
        self.assertNotEqual((first / image).read_bytes(), (other / image).read_bytes())


class Eval(ProgramTest):
    def test_an_estimate_against_itself_is_perfect(self):
        truth = self.street / "truth/left_disp_occ"
        result = json.loads(self.assert_works("eval", "--estimate", truth, "--truth", truth, "--json"))
        self.assertEqual(len(result["pairs"]), FRAMES)
        for key, value in {"bad_or_missing": 0, "bad_of_valid": 0, "density": 100, "interpolated": 0, "d1": 0,
                           "d1_interpolated": 0, "mae": 0}.items():
            self.assertEqual(result["pooled"][key], value, key)
        table = self.assert_works("eval", "--estimate", truth, "--truth", truth)
        self.assertIn("pooled", table)
        self.assertIn("000003", table)

    def test_a_mask_limits_what_is_compared(self):
        everything, visible = self.street / "truth/left_disp_occ", self.street / "truth/left_disp_noc"

        def counts(*arguments):
            return [pair["truth_pixels"] for pair in json.loads(self.assert_works("eval", "--estimate", everything, *arguments, "--json"))["pairs"]]
        masked = counts("--truth", everything, "--mask", visible)
        self.assertEqual(masked, counts("--truth", visible))
        self.assertLess(sum(masked), sum(counts("--truth", everything)))
        arguments = ["eval", "--estimate", everything, "--truth", everything, "--mask"]
        self.assert_refused([*arguments, self.new_folder()], "000000.png")
        small = self.new_folder()
        (small / "000000.png").write_bytes(grey_png(20, 10))
        self.assert_refused([*arguments, small], "20x10")

    def test_refuses_what_cannot_be_compared(self):
        truth = self.street / "truth/left_disp_occ"
        small = self.new_folder() / "000000.png"
        small.write_bytes(grey_png(20, 10, depth=16))
        self.assert_refused(["eval", "--estimate", small, "--truth", truth / "000000.png"], small)
        self.assert_refused(["eval", "--estimate", self.street / "calib.txt", "--truth", truth / "000000.png"], "calib.txt")
        self.assert_refused(["eval", "--estimate", self.new_folder(), "--truth", truth])
        self.assert_refused(["eval", "--estimate", "nowhere", "--truth", truth], "nowhere")

    def test_a_full_disk_under_the_standard_output_is_an_error(self):
        truth = self.street / "truth/left_disp_occ/000000.png"
        with open("/dev/full", "w") as full:
            done = subprocess.run([PROGRAM, "eval", "--estimate", truth, "--truth", truth], stdout=full, stderr=subprocess.PIPE,
                                  text=True, timeout=60)
        self.assertEqual(done.returncode, 1)
        self.assertIn("standard output", done.stderr)


class WrongArguments(ProgramTest):
    def run_with(self, *arguments):
        return ["run", "--odometry", self.street, "--out", self.folder / "never", *arguments]

    def tearDown(self):
        self.assertFalse((self.folder / "never").exists(), "refused, but wrote")

    def test_mistyped_names_get_a_suggestion(self):
        self.assert_refused(["rnu"], "rnu", "did you mean run?")
        self.assert_refused(["--versoin"], "--version")
        self.assert_refused(self.run_with("--disparites", 64), "--disparites", "did you mean --disparities?")
        self.assert_refused(self.run_with("--disparites=64"), "did you mean --disparities?")
        self.assert_refused(self.run_with("--set", "banded_sgm.p_2=64"), "banded_sgm.p_2", "banded_sgm.p2")
        self.assert_refused(self.run_with("--write", "colour"), "colour", "did you mean color?")

    def test_mistyped_paths_get_a_suggestion(self):
        mistyped = self.street.parent / "stret"
        self.assert_refused(["run", "--odometry", mistyped, "--out", self.folder / "never"], mistyped, f"did you mean {self.street}?")
        self.assert_refused(["eval", f"--estimate={mistyped}/truth/left_disp_occ/000000.png", "--truth", self.street],
                            f"did you mean {self.street}/truth/left_disp_occ/000000.png?")
        self.assert_refused(self.run_with("--poses", self.street / "pose.txt"), f"did you mean {self.street / 'poses.txt'}?")
        done = egosgm("run", "--odometry", self.street.parent / "another", "--out", self.folder / "never")
        self.assertNotIn("did you mean", done.stderr)

    def test_missing_and_contradicting_arguments(self):
        self.assert_refused([], "subcommand")
        self.assert_refused(["run"], "--out")
        self.assert_refused(["run", "--out", self.folder / "never"], "--odometry")
        self.assert_refused(self.run_with("--kitti", self.street, "--scene", 1), "more than one input")
        self.assert_refused(self.run_with("--scene", 1), "--scene")
        self.assert_refused(["run", "--left", "a.png", "--out", self.folder / "never"], "--right")
        self.assert_refused(["run", "--kitti", self.street, "--out", self.folder / "never"], "--scene")
        self.assert_refused(self.run_with("--device"), "--device")
        self.assert_refused(self.run_with("surplus"), "surplus")

    def test_values_out_of_range(self):
        self.assert_refused(self.run_with("--disparities", 0), "disparities", "0")
        self.assert_refused(self.run_with("--disparities", "many"), "many")
        self.assert_refused(self.run_with("--paths", 5), "paths", "5")
        self.assert_refused(self.run_with("--preset", "best"), "best")
        self.assert_refused(self.run_with("--search", "some"), "some")
        self.assert_refused(self.run_with("--temporal", "maybe"), "maybe")
        self.assert_refused(self.run_with("--frames", "a:b"), "a:b")
        self.assert_refused(self.run_with("--frames", "3:1"), "3:1")
        self.assert_refused(self.run_with("--set", "banded_sgm.p2"), "stage.option=value")
        self.assert_refused(self.run_with("--set", "forward_warp.process_noise_px2=nan"), "process_noise_px2")
        self.assert_refused(self.run_with("--device", "abacus"), "abacus")
        self.assert_refused(["synth", "--out", self.folder / "never", "--frames", 0], "frames")
        self.assert_refused(["synth", "--out", self.folder / "never", "--width", "wide"], "wide")

    def test_configuration_files(self):
        config = self.new_folder() / "config.toml"
        self.assert_refused(self.run_with("--config", config), config)
        config.write_text("banded_sgm.p_1 = 3\n")
        self.assert_refused(self.run_with("--config", config), config, "banded_sgm.p1")
        config.write_bytes(bytes(range(256)))
        self.assert_refused(self.run_with("--config", config), config)

    def test_scenes_that_do_not_exist(self):
        folder = self.new_folder()
        for name in ("image_0", "image_1", "calib"):
            (folder / name).mkdir()
        (folder / "image_0/000007_10.png").write_bytes(grey_png(8, 8))
        self.assert_refused(["run", "--kitti", folder, "--scene", 8, "--out", self.folder / "never"], "8", "000007")


class BrokenInput(ProgramTest):
    def assert_sequence_refused(self, street, *named, code=2, frames_left=None, options=()):
        out = self.new_folder() / "out"
        self.assert_refused(["run", "--odometry", street, "--out", out, *options], *named, code=code)
        if frames_left is None:
            self.assertFalse(out.exists(), "refused before the run, but wrote")
        else:
            self.assertEqual(self.assert_whole(out), frames_left)
            report = self.report(out)
            self.assertFalse(report["finished"])
            self.assertEqual(len(report["frames"]), frames_left)

    def test_empty_folder(self):
        empty = self.new_folder()
        self.assert_sequence_refused(empty, empty, "image_0")

    def test_missing_frame(self):
        street = self.broken_street()
        (street / "image_0/000002.png").unlink()
        (street / "image_1/000002.png").unlink()
        self.assert_sequence_refused(street, "000002.png", "--frames")

    def test_missing_right_image(self):
        street = self.broken_street()
        (street / "image_1/000002.png").unlink()
        self.assert_sequence_refused(street, "000002.png")

    def test_truncated_image(self):
        street = self.broken_street()
        file = street / "image_1/000002.png"
        file.write_bytes(file.read_bytes()[:-1500])
        self.assert_sequence_refused(street, file, frames_left=2)

    def test_image_that_is_none(self):
        street = self.broken_street()
        file = street / "image_0/000001.png"
        file.write_text("not an image")
        self.assert_sequence_refused(street, file)
        file.write_bytes(b"")
        self.assert_sequence_refused(street, file)

    def test_sizes_that_differ(self):
        street = self.broken_street()
        file = street / "image_1/000000.png"
        file.write_bytes(grey_png(WIDTH - 1, HEIGHT))
        self.assert_sequence_refused(street, file)

    def test_size_that_changes(self):
        street = self.broken_street()
        for side in (0, 1):
            (street / f"image_{side}/000003.png").write_bytes(grey_png(WIDTH, HEIGHT + 1))
        self.assert_sequence_refused(street, "000003.png", f"{WIDTH}x{HEIGHT}")

    def test_a_header_that_promises_gigabytes(self):
        street = self.broken_street()
        for side in (0, 1):
            for file in (street / f"image_{side}").iterdir():
                data = bytearray(grey_png(8, 8))
                data[16:24] = struct.pack(">II", 100000, 100000)
                data[29:33] = struct.pack(">I", zlib.crc32(bytes(data[12:29])))
                file.write_bytes(bytes(data))
        self.assert_sequence_refused(street, "000000.png")

    def test_calibrations(self):
        good = (self.street / "calib.txt").read_text().splitlines()
        left = good[0].split()

        def with_left(index, value):
            return " ".join(left[:index] + [value] + left[index + 1:])

        def with_right_shift(value):
            row = good[1].split()
            row[4] = value
            return " ".join(row)

        for name, rows in {
                "zero focal length": [with_left(1, "0"), good[1]],
                "NaN": [with_left(1, "nan"), good[1]],
                "too few numbers": [" ".join(left[:-1]), good[1]],
                "no number": [with_left(3, "wide"), good[1]],
                "zero baseline": [good[0], with_right_shift("0")],
                "negative baseline": [good[0], with_right_shift("100")],
                "one camera": [good[0]],
                "empty": [],
        }.items():
            with self.subTest(name):
                street = self.broken_street()
                (street / "calib.txt").write_text("\n".join(rows) + "\n")
                self.assert_sequence_refused(street, "calib.txt")
        street = self.broken_street()
        (street / "calib.txt").unlink()
        self.assert_sequence_refused(street, "calib.txt")

    def test_poses(self):
        rows = (self.street / "poses.txt").read_text().splitlines()
        stretched = "2 0 0 0 0 1 0 0 0 0 1 0"
        mirrored = "-1 0 0 0 0 1 0 0 0 0 1 0"
        for name, bad in {"too few numbers": "1 0 0", "not a rotation": stretched, "a reflection": mirrored, "words": "a " * 12,
                          "NaN": "nan " * 12}.items():
            with self.subTest(name):
                poses = self.new_folder() / "poses.txt"
                poses.write_text("\n".join([rows[0], bad, *rows[2:]]) + "\n")
                self.assert_sequence_refused(self.street, f"{poses}:2", options=["--poses", poses])
        poses = self.new_folder() / "poses.txt"
        poses.write_text(rows[0] + "\n")
        self.assert_sequence_refused(self.street, poses, options=["--poses", poses])
        self.assert_sequence_refused(self.street, "nowhere", options=["--poses", "nowhere"])
        self.assert_refused(["eval-poses", "--estimate", poses, "--truth", self.street / "poses.txt"])


class LongRuns(ProgramTest):
    """What tests of stopped runs are made of."""
    LONG = 60

    def street_of(self, frames):
        """The sequence forth and back, again and again."""
        street = self.broken_street()
        there_and_back = [*range(FRAMES), *range(FRAMES - 2, 0, -1)]
        for side in (0, 1):
            for i in range(FRAMES, frames):
                source = self.street / f"image_{side}/{there_and_back[i % len(there_and_back)]:06d}.png"
                shutil.copyfile(source, street / f"image_{side}/{i:06d}.png")
        return street

    def long_street(self):
        """A sequence that takes a while."""
        return self.street_of(self.LONG)

    def start(self, street, out, *arguments, lines=1):
        """A run that has reported `lines` frames."""
        process = subprocess.Popen([PROGRAM, "run", "--odometry", street, "--out", out, *arguments], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        for _ in range(lines):
            process.stdout.readline()
        return process


class Disk(LongRuns):
    def test_output_folders_that_cannot_be_written(self):
        below_a_file = self.street / "calib.txt/out"
        self.assert_refused(["run", "--odometry", self.street, "--out", below_a_file], below_a_file, code=1)
        self.assert_refused(["synth", "--out", below_a_file], below_a_file, code=1)
        self.assert_refused(["odometry", self.street, "--out", below_a_file / "poses.txt"], below_a_file, code=1)

    def test_a_full_disk_leaves_whole_files(self):
        street, out = self.long_street(), self.new_folder()
        process = subprocess.Popen([PROGRAM, "run", "--odometry", street, "--out", out], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        for _ in range(3):  # by then the driver has written its kernel cache
            process.stdout.readline()
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (4096, 4096))  # EFBIG: ENOSPC without a file system of its own
        _, errors = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 1, errors)
        self.assertRegex(errors, r"^egosgm: error: .*disparity/\d{6}\.png.*\n$")
        self.assert_whole(out, at_least=3)

    def test_an_interrupt_ends_cleanly(self):
        street, out = self.long_street(), self.new_folder()
        for stop in (signal.SIGINT, signal.SIGTERM):
            process = self.start(street, out, "--overwrite")
            process.send_signal(stop)
            _, errors = process.communicate(timeout=120)
            self.assertEqual(process.returncode, 130, errors)
            self.assertIn("interrupted", errors)
            report = self.report(out)
            self.assertFalse(report["finished"])
            self.assertTrue(1 <= len(report["frames"]) < self.LONG)
            self.assertEqual(len((out / "poses.txt").read_text().splitlines()), len(report["frames"]))

    def test_a_kill_leaves_only_whole_files(self):
        street, out = self.long_street(), self.new_folder()
        for lines in (1, 2, 3):
            process = self.start(street, out, "--overwrite", lines=lines)
            process.kill()
            process.communicate()
            self.assert_whole(out, at_least=lines)
            self.assertFalse(self.report(out)["finished"])

    def assert_fails_after(self, frames, broken, *named):
        """A run over a long sequence that `broken(street)` breaks while it runs."""
        street, out = self.long_street(), self.new_folder()
        process = self.start(street, out, lines=frames)
        broken(street)
        _, errors = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 2, errors)
        self.assertEqual(len(errors.splitlines()), 1, errors)
        for text in named:
            self.assertIn(text, errors)
        report = self.report(out)
        self.assertFalse(report["finished"])
        self.assertEqual(self.assert_whole(out, at_least=frames), len(report["frames"]))

    def test_a_file_that_vanishes(self):
        last = f"image_1/{self.LONG - 1:06d}.png"
        self.assert_fails_after(2, lambda street: (street / last).unlink(), last, "cannot be read")

    def test_a_file_that_changes_size_or_is_cut(self):
        last = f"image_0/{self.LONG - 1:06d}.png"
        self.assert_fails_after(2, lambda street: (street / last).write_bytes(grey_png(WIDTH, HEIGHT + 1)), last)
        self.assert_fails_after(2, lambda street: os.truncate(street / last, 1000), last, "truncated")

    def test_a_file_system_without_room(self):
        out = self.new_folder()
        small = ["unshare", "--map-root-user", "--mount", "sh", "-c", f"mount -t tmpfs -o size=96k tmpfs '{out}' && exec \"$@\"; exit 77", "sh"]
        if shutil.which("unshare") is None or subprocess.run([*small, "true"], capture_output=True).returncode != 0:
            self.skipTest("no small file system can be mounted here")
        inside = f"'{PROGRAM}' run --odometry '{self.long_street()}' --out '{out}'; echo code $?; ls -A '{out}/disparity'; cat '{out}/report.json'"
        done = subprocess.run([*small, "sh", "-c", inside], capture_output=True, text=True, timeout=240)
        self.assertIn("code 1\n", done.stdout)
        self.assertRegex(done.stderr, r"^egosgm: error: .*disparity/\d{6}\.png.*No space left on device.*\n$")
        left = done.stdout.split("code 1\n")[1]
        self.assertNotIn(".part", left)
        self.assertFalse(json.loads(left[left.index("{"):])["finished"])

    @unittest.skipUnless(os.geteuid() == 0, "rights are taken from another user: needs root")
    def test_a_folder_without_rights(self):
        out, cache = self.new_folder(), self.new_folder()
        for folder in (self.folder, out):
            folder.chmod(0o755)
        shutil.chown(cache, "nobody")
        nobody = {"user": "nobody", "env": dict(os.environ, POCL_CACHE_DIR=str(cache), HOME=str(cache))}
        try:
            egosgm("--version", **nobody)
        except PermissionError:
            self.skipTest("another user cannot run the program where it lies")
        self.assert_refused(["run", "--odometry", self.street, "--out", out], out, "Permission denied", code=1, **nobody)
        self.assertEqual(list(out.iterdir()), [])


class Resume(LongRuns):
    """An earlier run in OUT: in the way, replaced, or gone on with."""
    FRAMES = 12
    KINDS = ("--write", "variance,color,search")

    def assert_same_run(self, out, expected):
        files = sorted(file.relative_to(expected) for file in expected.rglob("*") if file.is_file())
        self.assertEqual(sorted(file.relative_to(out) for file in out.rglob("*") if file.is_file()), files)
        for file in files:
            if file.name != "report.json":
                self.assertEqual((out / file).read_bytes(), (expected / file).read_bytes(), file)
        mine, undisturbed = self.report(out), self.report(expected)
        for report in (mine, undisturbed):
            for frame in report["frames"]:
                del frame["ms"]
        self.assertEqual(mine, undisturbed)

    def test_equals_an_undisturbed_run(self):
        street, expected = self.street_of(self.FRAMES), self.new_folder()
        self.assert_works("run", "--odometry", street, "--out", expected, *self.KINDS)
        for stop in (signal.SIGKILL, signal.SIGINT):
            out = self.new_folder()
            for lines in (3, 5):
                process = self.start(street, out, "--resume", *self.KINDS, lines=lines)
                process.send_signal(stop)
                process.communicate()
                self.assertLess(self.assert_whole(out, at_least=lines), self.FRAMES)
            kept = {file: file.stat().st_ino for file in out.rglob("0*.*")}
            self.assertGreaterEqual(len(kept), 4 * 3)
            self.assert_works("run", "--odometry", street, "--out", out, "--resume", *self.KINDS)
            self.assert_same_run(out, expected)
            for file, inode in kept.items():
                self.assertEqual(file.stat().st_ino, inode, f"{file} was there and was written again")

    def test_an_earlier_run_is_in_the_way(self):
        out = self.new_folder()
        self.assert_works("run", "--odometry", self.street, "--out", out, "--write", "color")
        before = {file: file.read_bytes() for file in out.rglob("*") if file.is_file()}
        again = ["run", "--odometry", self.street, "--out", out, "--frames", "1:2"]
        self.assert_refused(again, out, "--resume", "--overwrite")
        self.assert_refused([*again, "--resume"], "first_frame", "--overwrite")
        self.assert_refused([*again, "--resume", "--overwrite"], "contradict")
        self.assertEqual({file: file.read_bytes() for file in out.rglob("*") if file.is_file()}, before)
        (out / "color/mine.png").write_text("not a map")
        self.assert_works(*again, "--overwrite")
        self.assertEqual([file.name for file in sorted((out / "disparity").iterdir())], ["000001.png", "000002.png"])
        self.assertEqual([file.name for file in (out / "color").iterdir()], ["mine.png"])

    def test_other_settings_cannot_go_on(self):
        out = self.new_folder()
        run = ["run", "--odometry", self.street, "--out", out]
        self.assert_works(*run, "--frames", ":1", "--quiet")
        self.assert_refused([*run, "--resume", "--set", "banded_sgm.p2=99"], "banded_sgm.p2", "160", "99")
        self.assert_refused([*run, "--resume", "--poses", self.street / "poses.txt"], "motion")
        self.assert_works(*run, "--resume")
        self.assertEqual(self.assert_whole(out), FRAMES)
        (out / "report.json").write_text("[]")
        self.assert_refused([*run, "--resume"], out / "report.json")
        (out / "report.json").unlink()
        self.assert_refused([*run, "--resume"], out, "report.json")


class Limits(ProgramTest):
    """Devices that allow little, which PoCL can play."""

    def run_with(self, *arguments, **environment):
        out = self.new_folder()
        self.assert_works("run", "--odometry", self.street, "--out", out, "--quiet", *arguments, env=dict(os.environ, **environment))
        return out

    def assert_same_maps(self, out, expected):
        for file in sorted((expected / "disparity").iterdir()):
            self.assertEqual((out / "disparity" / file.name).read_bytes(), file.read_bytes(), file.name)

    def test_small_work_groups_give_the_same_bits(self):
        for scheduling in ("wavefront", "paths"):
            arguments = ("--frames", ":1", "--disparities", 32, "--set", f"banded_sgm.scheduling={scheduling}")
            expected = self.run_with(*arguments)
            for size in ("1", "6"):
                with self.subTest(scheduling=scheduling, size=size):
                    self.assert_same_maps(self.run_with(*arguments, POCL_MAX_WORK_GROUP_SIZE=size), expected)

    def test_one_compute_unit_gives_the_same_bits(self):
        self.assert_same_maps(self.run_with("--frames", ":1", POCL_MAX_PTHREAD_COUNT="1"), self.run_with("--frames", ":1"))

    def test_a_range_that_does_not_fit_is_matched_in_stripes(self):
        folder, out = self.new_folder(), self.new_folder()
        for side in ("left", "right"):
            (folder / f"{side}.png").write_bytes(grey_png(640, 200))
        (folder / "calib.toml").write_text("fx = 400\nfy = 400\ncx = 320\ncy = 100\nbaseline_m = 0.5\n")
        run = ["run", "--left", folder / "left.png", "--right", folder / "right.png", "--calib", folder / "calib.toml", "--out", out]
        gigabyte = dict(os.environ, POCL_MEMORY_LIMIT="1")
        self.assert_works(*run, "--disparities", 2048, env=gigabyte)
        report = self.report(out)
        self.assertGreater(report["frames"][0]["stripes"], 1)
        self.assertLess(report["device_memory_bytes"], 1 << 30)
        self.assert_refused([*run, "--overwrite", "--disparities", 64, "--set", "banded_sgm.max_memory_mib=3"],
                            "BandedSgm: a stripe of 96 rows needs", "max_memory_mib allows 3 MiB", "fewer disparities", code=1)

    def test_stripes_are_almost_as_good(self):
        street, bad = self.new_folder(), {}
        self.assert_works("synth", "--out", street, "--frames", 3, "--width", 320, "--height", 240, "--seed", 7, "--quiet")
        for name, arguments in (("whole", []), ("stripes", ["--set", "banded_sgm.max_memory_mib=8"])):
            out = self.new_folder()
            self.assert_works("run", "--odometry", street, "--out", out, "--disparities", 64, *arguments)
            self.assertTrue(all((frame["stripes"] > 1) == (name == "stripes") for frame in self.report(out)["frames"]))
            bad[name] = json.loads(self.assert_works("eval", "--estimate", out, "--truth", street / "truth/left_disp_noc",
                                                     "--json"))["pooled"]["bad_or_missing"]
        self.assertLess(abs(bad["stripes"] - bad["whole"]), 1, bad)


@unittest.skipUnless(pathlib.Path(DATA, "README.md").is_file(), f"no real data: EGOSGM_DATA is '{DATA}'")
class RealData(ProgramTest):
    data = pathlib.Path(DATA)

    def evaluate(self, estimate, truth):
        return json.loads(self.assert_works("eval", "--estimate", estimate, "--truth", truth, "--json"))["pooled"]

    def test_evaluation_agrees_with_kittis_kit(self):
        kit = self.data / "devkit2012"
        figures = self.evaluate(kit / "disp_est.png", kit / "disp_gt.png")
        for key, value in {"density": 96.337, "interpolated": 5.186, "bad_of_valid": 4.393, "bad_or_missing": 7.894,
                           "d1_interpolated": 5.185}.items():
            self.assertAlmostEqual(figures[key], value, delta=0.0006, msg=key)

    def test_kitti_2012_beats_the_single_frame(self):
        training = self.data / "kitti2012/training"
        figures = {}
        for temporal in ("on", "off"):
            out = self.new_folder()
            self.assert_works("run", "--kitti", training, "--scene", "000151", "--frames", "7:10", "--temporal", temporal, "--out", out)
            figures[temporal] = self.evaluate(out / "disparity/000010.png", training / "disp_noc/000151_10.png")
            if temporal == "on":
                self.assertLessEqual(self.report(out)["frames"][-1]["search_fraction"], 0.12)
        self.assertLessEqual(figures["on"]["bad_or_missing"], 5.0)
        self.assertLessEqual(figures["on"]["interpolated"], 4.0)
        self.assertLessEqual(figures["off"]["bad_or_missing"], 10.0)
        self.assertLess(figures["on"]["interpolated"], figures["off"]["interpolated"])

    def test_kitti_2015_in_colour(self):
        out = self.new_folder()
        self.assert_works("run", "--kitti", self.data / "kitti2015/training", "--scene", "2", "--frames", "10:11", "--out", out)
        self.assertEqual(self.assert_whole(out), 2)

    def test_middlebury_has_an_offset(self):
        out = self.new_folder()
        self.assert_works("run", "--dataset", self.data / "middlebury/Motorcycle", "--out", out)
        self.assertGreater(self.report(out)["calibration"]["doffs_px"], 1)

    def test_odometry_excerpt(self):
        folder, poses = self.data / "odometry/sequences/A", self.new_folder() / "poses.txt"
        self.assert_works("odometry", folder, "--out", poses)
        drift = json.loads(self.assert_works("eval-poses", "--estimate", poses, "--truth", folder / "poses.txt", "--json"))
        self.assertLessEqual(drift["end_drift_percent"], 1.5)


if __name__ == "__main__":
    unittest.main()
