# SPDX-License-Identifier: Apache-2.0
"""egosgm run: what it writes and says, and its options."""
import contextlib
import json
import os
import pty
import re
import shlex
import shutil
import subprocess

from program_case import FEW_KERNELS, FRAMES, HEIGHT, PROGRAM, WIDTH, ProgramTest, egosgm, grey_png

TWO_WITH_COARSE_ONES = 2 * (1 + 1 / 128)  # of the left view: its search


class Run(ProgramTest):
    def test_clouds_say_what_they_left_out(self):
        counts = {}
        for sigma in (None, 1, 50):
            out = self.new_folder() / "out"
            said = self.assert_works("run", "--odometry", self.street, "--out", out, "--write", "cloud", "--disparities", 64, "--frames", "0:1",
                                     *([] if sigma is None else ["--cloud-sigma", sigma]))
            self.assertIn(f"uncertain by more than {sigma or 10} % (--cloud-sigma)", said)
            points, pixels = 0, 0
            for name, frame in zip(("000000", "000001"), self.report(out)["frames"], strict=True):
                cloud, of_frame = frame["cloud"], round(frame["density"] * WIDTH * HEIGHT)
                self.assertIn(f"element vertex {cloud['points']}\n", (out / f"cloud/{name}.ply").read_bytes().split(b"end_header")[0].decode())
                self.assertEqual(cloud["points"] + sum(cloud["left_out"].values()), of_frame)
                points, pixels = points + cloud["points"], pixels + of_frame
            self.assertIn(f"clouds hold {100 * points / pixels:.1f} % of the pixels with a disparity", said)
            counts[sigma] = points
        self.assertLess(counts[1], counts[None])
        self.assertLess(counts[None], counts[50])
        self.assert_all_refused((("--cloud-sigma 0", "--cloud-sigma 0", "above 0"), ("--cloud-sigma 5", "--cloud-sigma 5", "give --write cloud")),
                                ["run", self.street, "--out", self.folder / "never"])

    def test_a_pair_that_cannot_be_read_costs_itself_alone(self):
        poses = ("--poses", self.street / "poses.txt", "--disparities", 48)
        for broken, left in ((2, 60), (0, 20)):  # in the pixels; in the header, of the first one
            street, out = self.broken_street(), self.new_folder() / "out"
            file = street / f"image_1/00000{broken}.png"
            os.truncate(file, left)
            text = self.assert_works("run", street, "--out", out, *poses)
            self.assertIn(f"frame 00000{broken}: left out: {file}", text)
            self.assertIn(f"1 of {FRAMES} pairs could not be read: {file}", text)
            quiet = egosgm("run", street, "--out", out.parent / "quiet", "--quiet", *poses)
            self.assertEqual((quiet.returncode, quiet.stdout, quiet.stderr.count("\n")), (0, "", 1))
            self.assertIn(f"1 of {FRAMES} pairs could not be read: {file}", quiet.stderr)
            report, others = self.report(out), [i for i in range(FRAMES) if i != broken]
            self.assertTrue(report["finished"])
            self.assertEqual([(one["frame"], one["name"]) for one in report["left_out"]], [(broken, f"00000{broken}")])
            self.assertEqual([frame["frame"] for frame in report["frames"]], others)
            self.assertEqual([file.stem for file in sorted((out / "disparity").iterdir())], [f"00000{i}" for i in others])
            for side in (0, 1):
                (street / f"image_{side}/00000{broken}.png").unlink()
            self.assert_same_files(self.ran(street, *poses), out, "poses.txt", "disparity/*")  # as without the frame
            for found, expected in zip((out / "poses.txt").read_text().split(), (1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0)):
                self.assertAlmostEqual(float(found), expected)

    def test_pairs_of_which_most_cannot_be_read_are_no_drive(self):
        street, out = self.broken_street(), self.new_folder() / "out"
        for i in range(1, FRAMES):
            os.truncate(street / f"image_0/00000{i}.png", 60)
        self.assert_refused(["run", street, "--out", out, "--quiet"], street / "image_0/000001.png", f"{FRAMES - 1} of {FRAMES} pairs")
        self.assertFalse(self.report(out)["finished"])
        self.assertEqual([file.name for file in (out / "disparity").iterdir()], ["000000.png"])

    def test_writes_maps_poses_and_report(self):
        out = self.new_folder()
        text = self.assert_works("run", "--odometry", self.street, "--out", out)
        self.assertEqual(self.assert_whole(out), FRAMES)
        self.assertEqual(len((out / "poses.txt").read_text().splitlines()), FRAMES)
        self.assertIn("frame 000003", text)
        self.assertNotIn("egosgm doctor", text)
        report = self.report(out)
        self.assertFalse({"stopped_by", "warning"} & set(report))
        for key in ("finished", "device", "driver", "version", "options"):
            self.assertTrue(report[key])
        self.assertEqual([frame["frame"] for frame in report["frames"]], list(range(FRAMES)))
        for frame in report["frames"]:
            for fraction in ("predicted_fraction", "density"):
                self.assertTrue(0 <= frame[fraction] <= 1, fraction)
            self.assertTrue(frame["ms"]["total"] > 0 and "BandedSgm" in frame["ms"], frame["ms"])
        first, later = report["frames"][0], report["frames"][-1]
        self.assertEqual((first["search_fraction"], first["searched_everything"], first["unpredicted"]), (TWO_WITH_COARSE_ONES, True, "first frame"))
        self.assertIsNone(first["odometry"]["motion"])
        self.assertLess(later["search_fraction"], 0.5)
        self.assertGreater(later["odometry"]["inliers"], 10)
        self.assertAlmostEqual(later["odometry"]["motion"]["translation_m"][2], -0.8, delta=0.1)

    def test_writes_what_is_asked_for(self):
        out = self.new_folder()
        kinds = "variance,color,predicted,measured,right,interpolated_certain,search,dynamic,reason,pfm,overview,cloud,depth,depth_m"
        self.assert_works("run", "--odometry", self.street, "--out", out, "--write", kinds, "--interpolate", "--frames", "1:2", "--quiet")
        for kind in (*kinds.split(","), "interpolated"):
            extension = "pfm" if kind in ("variance", "pfm", "depth_m") else "ply" if kind == "cloud" else "png"
            self.assertEqual([f.name for f in sorted((out / kind).iterdir())], [f"00000{i}.{extension}" for i in (1, 2)])
        self.assertEqual(self.json_of("eval", out / "interpolated", self.street / "truth/left_disp_occ")["pooled"]["density"], 100)
        reasons = self.report(out)["reasons"]
        self.assertEqual((reasons[0], reasons[9], len(reasons)), ("trusted", "predicted", 10))

    def test_truth_of_another_size_is_named(self):
        street = self.broken_street()
        truth = street / "truth/left_disp_noc/000001.png"
        truth.write_bytes(grey_png(WIDTH // 2, HEIGHT, depth=16))
        out = self.new_folder() / "out"
        self.assert_refused(["run", "--odometry", street, "--write", "overview", "--out", out], truth, "another size", "no overview")
        self.assertFalse(out.exists())

    def test_what_is_noted_of_a_run_is_in_its_report_and_told_quietly(self):
        street, out = self.broken_street(), self.new_folder()
        (street / "image_0/000003.png").unlink()
        depths, alone = r"frame 000000: [1-9]\d* depths beyond 65.535 m ", "1 image without the other camera's left out, the first is .*image_1/000003.png"
        run = ["run", street, "--disparities", 48, "--write", "depth", "--out"]
        told = self.assert_works(*run, out / "told")
        quiet = egosgm(*run, out / "quiet", "--quiet")
        self.assertEqual((quiet.returncode, quiet.stdout), (0, ""))
        for notes in (told.splitlines(), quiet.stderr.splitlines(), *(self.report(out / name)["notes"] for name in ("told", "quiet"))):
            self.assertEqual([sum(bool(re.search(text, line)) for line in notes) for text in (depths, alone)], [1, 1], notes)
        self.assertEqual(len(quiet.stderr.splitlines()), 2)
        self.assertNotIn("65.535", self.assert_works("run", street, "--disparities", 48, "--write", "depth,depth_m", "--out", out / "both"))

    def assert_warned(self, arguments, *named):
        """The last line of run names doctor, which finds a problem with the very arguments."""
        out = self.new_folder()
        last = self.assert_works("run", *arguments, "--out", out).splitlines()[-1]
        for text in named:
            self.assertIn(text, last)
            self.assertIn(text, self.report(out)["warning"])
        command = re.search("`(egosgm doctor .*)`", last)
        self.assertTrue(command, last)
        done = egosgm(*shlex.split(command[1])[1:])
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        self.assertIn("problem", done.stdout)
        self.assertEqual(self.assert_works("run", *arguments, "--out", self.new_folder(), "--quiet"), "")

    def test_plainly_wrong_input_ends_with_a_line_that_names_doctor(self):
        swapped = self.new_folder() / "it's swapped"
        shutil.copytree(self.street, swapped)
        (swapped / "image_0").rename(swapped / "left")
        (swapped / "image_1").rename(swapped / "image_0")
        (swapped / "left").rename(swapped / "image_1")
        self.assert_warned(["--odometry", swapped], f"no motion in {FRAMES - 1} of {FRAMES - 1} frames", "density")
        self.assert_warned(["--dataset", swapped, "--frames", "1:3"], "no motion in 2 of 2 frames")
        wide = self.broken_street()
        calib = (wide / "calib.txt").read_text()
        shift = calib.splitlines()[1].split()[4]
        (wide / "calib.txt").write_text(calib.replace(shift, str(1000 * float(shift))))
        self.assert_warned(["--odometry", wide], "baseline of", "millimetres")

    def test_pictures_that_repeat_are_told_and_taken_as_one_moment(self):
        """Of frame 1 three times, with poses between those of frames 1 and 2: its map stays, and frame 2 is as it is without."""
        street, out = self.broken_street(), self.new_folder()
        poses = (street / "poses.txt").read_text().splitlines()
        for side in ("image_0", "image_1"):
            for target, source in enumerate((0, 1, 1, 1, 2)):
                shutil.copy(self.street / f"{side}/{source:06d}.png", street / f"{side}/{target:06d}.png")
        (street / "given.txt").write_text("\n".join(poses[i] for i in (0, 1, 2, 0, 2)) + "\n")
        told = self.assert_works("run", street, "--poses", street / "given.txt", "--out", out)
        self.assertIn("2 frames repeat the pictures of the frame before", told)
        frames = self.report(out)["frames"]
        self.assertEqual([frame["repeated"] for frame in frames], [False, False, True, True, False])
        for frame in frames[2:]:
            self.assertGreater(frame["density"], frames[1]["density"] - 0.02)
            self.assertFalse(frame["searched_everything"])

    def test_a_trace_holds_every_command_and_step_of_the_host(self):
        out, file = self.new_folder(), self.new_folder() / "trace.json"
        self.assert_works("run", "--odometry", self.street, "--out", out, "--trace", file)
        self.assert_same_files(out, self.ran(self.street, "--quiet"), "disparity/*")
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
            self.assertIn(("BandedSgm", "sweep_to_middle"), {(span["cat"], span["name"]) for span in kernels})
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

    def test_what_is_compiled_is_waited_for_in_words(self):
        """Where nothing is cached. PoCL; other drivers may be quicker than what is worth a line."""
        run = [PROGRAM, "run", "--odometry", self.street, "--frames", "0:0", *map(str, FEW_KERNELS)]
        for quiet in ([], ["--quiet"]):
            environment = dict(os.environ, POCL_CACHE_DIR=str(self.new_folder()))
            for is_cached in (False, True):
                done = subprocess.run([*run, "--out", self.new_folder(), *quiet], env=environment, capture_output=True, text=True, check=True)
                lines = [line for line in done.stderr.splitlines() if "compiling the kernels" in line]
                if os.listdir(environment["POCL_CACHE_DIR"]):
                    self.assertLessEqual(len(lines), 0 if quiet else 1, done.stderr)
                    if not is_cached and not quiet:
                        self.assertEqual(len(lines), 1, done.stderr)

    def test_a_terminal_gets_a_bar(self):
        terminal, side = pty.openpty()
        with subprocess.Popen([PROGRAM, "run", "--odometry", self.street, "--out", self.new_folder()], stdout=side) as process:
            os.close(side)
            text = b""
            with contextlib.suppress(OSError):  # once the program has closed its end
                while part := os.read(terminal, 4096):
                    text += part
        os.close(terminal)
        self.assertEqual(process.returncode, 0)
        self.assertIn(b"frames/s", text)
        self.assertIn(f"{FRAMES}/{FRAMES}".encode(), text)
        self.assertGreaterEqual(text.count(b"\r\x1b[K"), FRAMES)

    def test_temporal_off_searches_everything(self):
        """A frame without time is matched twice: its report says so, and the text in words."""
        out = self.new_folder()
        told = self.assert_works("run", "--odometry", self.street, "--out", out, "--temporal", "off")
        for frame in self.report(out)["frames"]:
            self.assertEqual((frame["search_fraction"], frame["searched_everything"], frame["predicted_fraction"]), (TWO_WITH_COARSE_ONES, True, 0))
        self.assertEqual([float(share) for share in re.findall(r"search +([0-9.]+) %", told)], [100] * (FRAMES + 1), told)
        self.assertEqual((told.count("(no prediction: not temporal; matched 2 times)"), told.count("times)")), (FRAMES, FRAMES), told)
        self.assert_same_files(out, self.ran(self.street, "--frames", FRAMES - 1, "--temporal", "off"), "disparity/*")

    def test_poses_take_the_place_of_odometry(self):
        out = self.ran(self.street, "--poses", self.street / "poses.txt")
        self.assertEqual(self.report(out)["frames"][-1]["odometry"]["source"], "poses file")
        self.assertLess(self.json_of("eval-poses", out / "poses.txt", self.street / "poses.txt")["end_drift_m"], 1e-6)

    def test_patterns_and_16_bit_images_and_odd_sizes(self):
        folder = self.new_folder()
        for side in ("left", "right"):
            for i in (1, 2):
                (folder / f"{side}_{i}.png").write_bytes(grey_png(65, 31, depth=16))
        (folder / "calib.toml").write_text("fx = 100\nfy = 100\ncx = 32\ncy = 15\nbaseline_m = 0.5\n")
        out = self.ran("--left", folder / "left_%d.png", "--right", folder / "right_%d.png", "--calib", folder / "calib.toml",
                       "--disparities", 19, "--min-disparity", "-3", "--paths", 8)
        self.assertEqual(self.assert_whole(out), 2)
        options = self.report(out)["options"]
        self.assertEqual((options["disparities"], options["min_disparity"], options["paths"]), (19, -3, 8))

    def test_the_last_choice_wins_preset_config_set_named(self):
        """And a configuration that is saved says what was chosen."""
        config, saved, again = (self.new_folder() / name for name in ("config.toml", "saved.toml", "again.toml"))
        config.write_text("# a comment\ndisparities = 40\np1 = 7\np2 = 77\n")
        run = [self.street, "--frames", "0"]
        first = self.ran(*run, "--preset", "paper", "--config", config, "--set", "p2=88", "--set", "search_sigmas=2.7",
                         "--set", "disparities=41", "--disparities", 42, "--save-config", saved)
        second = self.ran(*run, "--config", saved, "--save-config", again)
        for out in (first, second):
            options = self.report(out)["options"]
            self.assertEqual([options[name] for name in ("preset", "disparities", "p1", "p2")], ["paper", 42, 7, 88])
        self.assertEqual(saved.read_text(), again.read_text())

    def test_a_preset_that_would_undo_what_was_chosen_is_refused(self):
        config = self.new_folder() / "config.toml"
        config.write_text("disparities = 40\npreset = 'paper'\n")
        self.assert_all_refused(((f"--config {config}", f"{config}:2: ", "preset", "put it first"), ("--set disparities=40 --set preset=paper", "preset", "put it first")),
                                ["run", self.street, "--out", self.folder / "never"])
        config.write_text("preset = 'paper'\ndisparities = 40\n")
        options = self.report(self.ran(self.street, "--frames", "0", "--set", "p2=77", "--config", config, "--preset", "default"))["options"]
        self.assertEqual((options["preset"], options["disparities"], options["p2"]), ("paper", 40, 77))
