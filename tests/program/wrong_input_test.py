# SPDX-License-Identifier: Apache-2.0
"""Wrong arguments and broken files: one line each that names the value and the remedy."""
import os

from program_case import FRAMES, HEIGHT, WIDTH, ProgramTest, grey_png

# Words after `egosgm run --odometry {street} --out {never}`, and what is said of them. Of each kind of option there is one: what each refuses, the
# tests of the library say.
AFTER_RUN = (
    ("--disparites 64", "--disparites", "egosgm run --help"), ("--disparites=64", "--disparites", "egosgm run --help"),
    ("--set p_2=64", "p_2", "choose from", "p2"), ("--set p3=150", "choose from"), ("--set p2", "NAME=VALUE"),
    ("--set process_noise_px2=nan", "process_noise_px2"), ("--write colour", "colour", "choose from", "color"),
    ("--preset papr", "papr", "choose default or paper"), ("--preset best", "best"), ("--temporal maybe", "maybe"),
    ("--disparities 0", "disparities is 0"), ("--disparities 64px", "64px"), ("--paths 5", "paths is 5"),
    ("--frames a:b", "a:b"), ("--frames 0:1000000000000000000", "0:1000000000000000000"), ("--frames 0:2000000000", "2000000000 is missing"),
    ("--device abacus", "abacus"), ("--device 1000", "1000"), ("--device", "--device"), ("--quiet=maybe", "maybe is no value for it"),
    ("--left-topic /left", "--left-topic", "--bag"), ("--pose-topic /odom", "--pose-topic", "--bag"), ("--max-skew-ms 1", "--max-skew-ms", "--bag"),
    ("--rectify off", "--rectify", "--bag"), ("--poses {street}/pose.txt", "{street}/pose.txt"), ("--kitti {street} --scene 1", "more than one input"),
    ("--scene 1", "--scene"), ("surplus", "more than one input", "--odometry", "surplus"), ("--pair-by order", "--pair-by order", "--left"),
    *((f"{option} ''", option, "is empty") for option in ("--temporal", "--device", "--config", "--set")),
)
# Whole command lines. The first sequence is mistyped.
COMMANDS = (
    ("rnu {street}", 'no command "rnu": see `egosgm --help`'), ("rnu --help", "rnu", "egosgm --help"), ("--versoin", "--versoin", "egosgm --help"),
    ("run --odometry {street}t --out {never}", "{street}t"),
    ("eval --estimate={street}t/truth/left_disp_occ/000000.png --truth {street}", "{street}t"),
    ("compile --out {never} --clang clang", "--clang", "--il"), ("compile --out {never} --llvm-spirv llvm-spirv", "--llvm-spirv", "--il"),
    ("run --out {never} -- {street} more", "more than one input", "and more"),
    ("run --odometry {street} --out ''", "--out", "is empty"),
    ("run {street} --out=~/out", "--out ~/out: a shell alone knows ~"), ("synth --out=~/out", "--out ~/out: a shell alone knows ~"),
    ("odometry {street} --out=~/out/poses.txt", "--out ~/out/poses.txt: a shell alone knows ~"),
    ("run {street} --out --quiet", "--out: its value is missing", "--quiet is an option"),
    ("run {street} --poses --out never", "--poses: its value is missing, as --out is an option"), ("synth --out -h", "--out: its value is missing"),
    ("run 'no\nway\x1b[31m\r' --out {never}", "no way [31m : no such folder"),
    ("synth --out {never} --seed -1", "-1 is no value for it"), ("synth --out {never} --seed 100000000000000000000", "100000000000000000000 is no value for it"),
    ("synth --out {never} --frames 0", "frames"), ("synth --out {never} --width wide", "wide"),
    ("", "subcommand"), ("run", "--out"), ("run --out {never}", "--odometry"), ("run --left a.png --out {never}", "--right"),
    ("odometry {street} --out {never} --max-rotation -1", "max_rotation_deg"), ("run {street} --out {never} --max-translation 0", "max_translation_m"),
    ("run --kitti {street} --out {never}", "--scene"), ("run --left a%d.png --right b%d.png --calib c --pair-by luck --out {never}", "luck"),
    ("run nix.png {street}/image_1/000000.png --out {never}", "nix.png: no such file; give the left and the right picture"),
    ("run nix.mp4 nixes.mp4 --out {never}", "nix.mp4: no such file; give the left and the right picture"),
    ("run {street}/image_0 {street}/image_1 --out {never}", "{street}/image_0 and {street}/image_1: are two folders",
     "--left '{street}/image_0/*' --right '{street}/image_1/*' --calib FILE"),
    ("run --left {street}/image_0 --right {street}/image_1 --calib {street}/calib.txt --out {never}", "image_0: is a folder", "image_0/*.png"),
)
# Commands to which a number belongs. Of the first two all numbers are tried that C and Python read and nobody means.
OF_NUMBERS = (
    "run --odometry {street} --out {never} --max-translation", "run --odometry {street} --out {never} --cloud-sigma",
    "run --odometry {street} --out {never} --max-rotation", "run --odometry {street} --out {never} --disparities",
    "run --odometry {street} --out {never} --min-disparity", "synth --out {never} --frames", "synth --out {never} --width", "synth --out {never} --seed",
    "synth --out {never} --speed", "synth --out {never} --noise", "eval-video {street} {street} --near",
    "eval --estimate {street} --truth {street} --truth-scale", "tune --rounds", "tune --width", "report {street} --picture-width", "rectify --alpha",
    "doctor {street} --disparities",
)


class WrongArguments(ProgramTest):
    def test_words_after_run(self):
        """Files of the options' names lie beside, and change nothing."""
        folder = self.new_folder()
        for name in ("r0", "o1", "sw", "fifo", "frames", "overview", "p2=151"):
            (folder / name).touch()
        self.assert_all_refused(AFTER_RUN, ["run", "--odometry", self.street, "--out", self.folder / "never"], cwd=folder)

    def test_commands(self):
        folder = self.new_folder()
        self.assert_all_refused(COMMANDS, cwd=folder)
        self.assertEqual(list(folder.iterdir()), [])

    def test_numbers_are_decimal(self):
        for command in OF_NUMBERS:
            all_values = ("0x10", "010", "' 16'", "'16 '", "+16", "nan", "inf", "1e999", "1,5", "1e", "0x1p3")
            self.assert_all_refused([f"{command} {value}"] for value in (all_values if command in OF_NUMBERS[:2] else all_values[:2]))

    def test_no_is_off_and_blanks_in_a_list_are_none(self):
        out = self.ran("--odometry", self.street, "--frames", "0:1", "--temporal", "no", "--write", "color, disparity, overview ", "--quiet")
        self.assertFalse(self.report(out)["options"]["temporal"])
        self.assertEqual(len(list((out / "color").iterdir())), 2)
        self.assertEqual(len(list((out / "overview").iterdir())), 2)

    def test_disparity_maps_of_both_cameras_are_no_images(self):
        half = self.new_folder()
        for name in ("image_0", "truth"):
            (half / name).symlink_to(self.street / name)
        self.assert_all_refused((
            ("run {street}/truth --out {never}", f"it belongs to the sequence {self.street.resolve()}"),
            (f"run {half} --out {{never}}", f"{half}: has neither image_0 and image_1 nor image_2 and image_3; give the folder that holds them")))

    def test_patterns_that_the_shell_expanded(self):
        left, right = (sorted((self.street / side).iterdir()) for side in ("image_0", "image_1"))
        calib = ["--calib", self.street / "calib.txt"]
        out = ["--out", self.folder / "never"]
        images = [["--left", *many, "--right", right[0], *calib] for many in (left, left[:2])]
        commands = [*(["run", *given, *out] for given in images), *(["doctor", *given] for given in images),
                    ["rectify", "--left", *left, "--right", *right, *calib, *out]]
        self.assert_all_refused((command, "quote", "'*.png'") for command in commands)

    def test_configuration_files(self):
        config = self.new_folder() / "config.toml"
        for text, named in ((None, config), (b"p_1 = 3\n", "p1"), (b"# 1.2.3.4.5\n[constants.a.b.c.d]\np1 = 3\n", "config.toml:2: "), (b"#" * 65537, config), ("p2 = 100".encode("utf-16"), "is UTF-16"), (bytes(range(256)), config),
                            (b"# options\n\n[constants.banded_sgm]\np2 = 150\np9 = 1\n", "config.toml:5: "), (b"p2\n", "name = value"), (b"p2 150\n", "name = value"),
                            (b"# fine\n\n  dynamic\n", "name = value")):
            if text is not None:
                config.write_bytes(text)
            with self.subTest(text):
                self.assert_all_refused([(f"run --odometry {{street}} --out {{never}} --config {config}", config, named)])


class BrokenInput(ProgramTest):
    def assert_sequence_refused(self, street, *named, options=()):
        self.assert_all_refused([(["run", "--odometry", street, "--out", self.folder / "never", *options], *named)])

    def assert_left_out(self, street, *named):
        """The pair that holds what is broken costs itself alone."""
        out = self.new_folder() / "out"
        text = self.assert_works("run", "--odometry", street, "--out", out)
        report = self.report(out)
        self.assertTrue(report["finished"])
        self.assertEqual(self.assert_whole(out), FRAMES - 1)
        self.assertEqual(len(report["left_out"]), 1)
        for word in named:
            self.assertIn(str(word), text)
            self.assertIn(str(word), report["left_out"][0]["why"])

    def test_a_run_that_read_nothing_leaves_nothing(self):
        street = self.broken_street()
        images = {file: file.read_bytes() for file in (street / "image_0").iterdir()}
        for file in images:
            file.write_bytes(b"no image")
        self.assert_sequence_refused(street, f"{FRAMES} of {FRAMES} pairs could not be read: {street}/image_0/000000.png")
        empty = self.new_folder()
        self.assert_refused(["run", street, "--out", empty], "could not be read")
        self.assertEqual(list(empty.iterdir()), [])
        for file, data in images.items():
            file.write_bytes(data)
        self.assert_works("run", street, "--out", empty)

    def test_a_folder_that_is_a_link_to_nothing(self):
        link = self.new_folder() / "link"
        link.symlink_to("nothing")
        self.assert_refused(["run", self.street, "--out", link], str(link), "leads nowhere")

    def test_what_rectify_refuses(self):
        folder, sizes = self.new_folder(), self.broken_street()
        for name in ("pipe.avi", "pipe.tif"):
            os.mkfifo(folder / name)
        for side in (0, 1):
            (sizes / f"image_{side}/000002.png").write_bytes(grey_png(WIDTH, HEIGHT + 2))
        for time in ("nan", "inf", "0x10", "1e", "1,5"):
            (folder / time).write_text(f"{self.street}/image_0/000000.png {self.street}/image_1/000000.png {time}\n")
        rows = [(["--side-by-side", source], source, "is no file") for source in (folder / "pipe.avi", folder / "pipe.tif", self.street / "image_0", "/dev/zero")]
        rows += [(["--list", folder / time], f"{time}:1") for time in ("nan", "inf", "0x10", "1e", "1,5")]
        rows += [(["--side-by-side", folder / "none.avi"], "none.avi", "no such file")]
        self.assert_all_refused(rows, ["rectify", "--calib", self.street / "calib.txt", "--out", self.folder / "never"])
        self.assert_refused(["rectify", *self.patterns(sizes), "--out", self.new_folder(), "--quiet"], "pair 3", f"{WIDTH}x{HEIGHT + 2}", "one size")

    def test_texts_may_begin_with_the_mark_of_utf_8(self):
        street = self.broken_street()
        files = {name: street / name for name in ("calib.txt", "poses.txt", "config.toml")}
        files["config.toml"].write_text("disparities = 16\r\n")
        for file in files.values():
            file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())
        self.ran(street, "--poses", files["poses.txt"], "--frames", "0:1", "--config", files["config.toml"], "--quiet")

    def test_an_image_that_is_none_costs_its_pair(self):
        def link(file):
            file.unlink()
            file.symlink_to("nowhere.png")

        def pipe(file):
            file.unlink()
            os.mkfifo(file)

        for image, breaks, named in (("image_0/000000.png", link, "is a link to what is not there; give an existing, readable file"),  # the first tells the type of all
                                     ("image_0/000001.png", link, "is a link to what is not there"), ("image_0/000002.png", pipe, "nobody writes to"),
                                     ("image_1/000002.png", lambda file: os.truncate(file, file.stat().st_size - 1500), "truncated?"),
                                     ("image_0/000001.png", lambda file: file.write_text("not an image"), "not a readable image"),
                                     ("image_0/000001.png", lambda file: file.write_bytes(b""), "not a readable image")):
            street = self.broken_street()
            breaks(street / image)
            with self.subTest(named):
                self.assert_left_out(street, street / image, named)

    def test_missing_right_image(self):
        street, out = self.broken_street(), self.new_folder() / "out"
        (street / "image_1/000002.png").unlink()
        self.assertIn("1 image without the other camera's left out", self.assert_works("run", street, "--out", out))
        self.assertEqual([frame["frame"] for frame in self.report(out)["frames"]], [0, 1, 3])
        self.assert_sequence_refused(street, "000002.png", "no partner", options=["--frames", "2"])

    def test_odometry_ends_at_an_image_that_is_none(self):
        street, poses = self.broken_street(), self.new_folder() / "poses.txt"
        (street / "image_1/000002.png").write_bytes(b"")
        self.assert_refused(["odometry", street, "--out", poses, "--quiet"], street / "image_1/000002.png")
        self.assertEqual(len(poses.read_text().splitlines()), 2)  # of the pairs before

    def test_size_that_changes(self):
        street = self.broken_street()
        for side in (0, 1):
            (street / f"image_{side}/000003.png").write_bytes(grey_png(WIDTH, HEIGHT + 1))
        self.assert_sequence_refused(street, "000003.png", f"{WIDTH}x{HEIGHT}")

    def test_calibrations(self):
        """What rows must hold, the tests of the library's reader say."""
        for text in ((self.street / "calib.txt").read_text().replace("P0: ", "P0: nan "), ""):
            street = self.broken_street()
            (street / "calib.txt").write_text(text)
            self.assert_sequence_refused(street, "calib.txt")
        (street / "calib.txt").unlink()
        self.assert_sequence_refused(street, "calib.txt")
        (street / "calib.txt").mkdir()
        self.assert_sequence_refused(street, "calib.txt: is no file")

    def test_poses(self):
        """What rows must hold, the tests of the library's reader say."""
        rows = (self.street / "poses.txt").read_text().splitlines()
        poses = self.new_folder() / "poses.txt"
        poses.write_text("\n".join([rows[0], "-1 0 0 0 0 1 0 0 0 0 1 0", *rows[2:]]) + "\n")
        self.assert_sequence_refused(self.street, f"{poses}:2", options=["--poses", poses])
        poses.write_text("\n".join(rows), encoding="utf-16")
        self.assert_sequence_refused(self.street, "poses.txt: is UTF-16", "save it as UTF-8", options=["--poses", poses])
        poses.write_text(rows[0] + "\n")
        self.assert_sequence_refused(self.street, poses, options=["--poses", poses])
        self.assert_sequence_refused(self.street, "nowhere", options=["--poses", "nowhere"])
        self.assert_refused(["eval-poses", "--estimate", poses, "--truth", self.street / "poses.txt"])
