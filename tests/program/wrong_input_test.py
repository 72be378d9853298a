# SPDX-License-Identifier: Apache-2.0
"""Wrong arguments and broken files: one line each that names the value and the remedy."""
import os

from program_case import FRAMES, HEIGHT, WIDTH, ProgramTest, grey_png


class WrongArguments(ProgramTest):
    def run_with(self, *arguments):
        return ["run", "--odometry", self.street, "--out", self.folder / "never", *arguments]

    def tearDown(self):
        self.assertFalse((self.folder / "never").exists(), "refused, but wrote")

    def test_unknown_names_are_named(self):
        self.assert_refused(["rnu", self.street], 'no command "rnu": see `egosgm --help`')
        self.assert_refused(["rnu", "--help"], "rnu", "egosgm --help")
        self.assert_refused(["--versoin"], "--versoin", "egosgm --help")
        self.assert_refused(self.run_with("--disparites", 64), "--disparites", "egosgm run --help")
        self.assert_refused(self.run_with("--disparites=64"), "--disparites", "egosgm run --help")
        self.assert_refused(self.run_with("--set", "p_2=64"), "p_2", "choose from", "p2")
        self.assert_refused(self.run_with("--write", "colour"), "colour", "choose from", "color")
        self.assert_refused(self.run_with("--preset", "papr"), "papr", "choose default or paper")

    def test_options_of_bags_need_one(self):
        for option in (["--left-topic", "/left"], ["--pose-topic", "/odom"], ["--max-skew-ms", 1], ["--rectify", "off"]):
            self.assert_refused(self.run_with(*option), option[0], "--bag")

    def test_a_path_that_is_not_there_is_named(self):
        mistyped = self.street.parent / "stret"
        self.assert_refused(["run", "--odometry", mistyped, "--out", self.folder / "never"], mistyped)
        self.assert_refused(["eval", f"--estimate={mistyped}/truth/left_disp_occ/000000.png", "--truth", self.street], mistyped)
        self.assert_refused(self.run_with("--poses", self.street / "pose.txt"), self.street / "pose.txt")

    def test_numbers_are_decimal(self):
        commands = (self.run_with("--max-translation"), self.run_with("--cloud-sigma"), self.run_with("--max-rotation"), self.run_with("--disparities"), self.run_with("--min-disparity"),
                    *(["synth", "--out", self.folder / "never", option] for option in ("--frames", "--width", "--seed", "--speed", "--noise")),
                    ["eval-video", self.street, self.street, "--near"], ["eval", "--estimate", self.street, "--truth", self.street, "--truth-scale"], ["tune", "--rounds"], ["tune", "--width"],
                    ["report", self.street, "--picture-width"],
                    ["rectify", "--alpha"], ["doctor", self.street, "--disparities"])
        for command in commands:
            for value in ("0x10", "010", " 16", "16 ", "+16", "nan", "inf", "1e999", "1,5", "1e", "0x1p3") if command in commands[:2] else ("0x10", "010"):
                with self.subTest(command=command, value=value):
                    self.assert_refused([*command, value])

    def test_words_after_two_dashes(self):
        self.assert_refused(["run", "--out", self.folder / "never", "--", self.street, "more"], "more than one input", "and more")

    def test_empty_values_are_refused(self):
        for option in ("--temporal", "--device", "--config", "--set"):
            self.assert_refused(["run", "--odometry", self.street, "--out", self.folder / "never", option, ""], option, "is empty")
        self.assert_refused(["run", "--odometry", self.street, "--out", ""], "--out", "is empty", cwd=self.new_folder())

    def test_an_option_is_no_value(self):
        out = self.new_folder()
        self.assert_refused(["run", self.street, "--out", "--quiet"], "--out: its value is missing", "--quiet is an option", cwd=out)
        self.assert_refused(["run", self.street, "--poses", "--out", "never"], "--poses: its value is missing, as --out is an option", cwd=out)
        self.assert_refused(["synth", "--out", "-h"], "--out: its value is missing", cwd=out)
        self.assertEqual(list(out.iterdir()), [])

    def test_a_name_of_several_lines_is_told_on_one(self):
        self.assert_refused(["run", "no\nway\x1b[31m\r", "--out", self.folder / "never"], "no way [31m : no such folder")

    def test_values_of_another_kind(self):
        self.assert_refused(self.run_with("--quiet=maybe"), "maybe is no value for it")
        for seed in (-1, 10**20):
            self.assert_refused(["synth", "--out", self.folder / "never", "--seed", seed], f"{seed} is no value for it")

    def test_no_is_off_and_blanks_in_a_list_are_none(self):
        out = self.new_folder()
        self.assert_works("run", "--odometry", self.street, "--out", out, "--frames", "0:1", "--temporal", "no", "--write", "color, disparity, overview ",
                          "--quiet")
        self.assertFalse(self.report(out)["options"]["temporal"])
        self.assertEqual(len(list((out / "color").iterdir())), 2)
        self.assertEqual(len(list((out / "overview").iterdir())), 2)

    def test_missing_and_contradicting_arguments(self):
        self.assert_refused([], "subcommand")
        self.assert_refused(["run"], "--out")
        self.assert_refused(["run", "--out", self.folder / "never"], "--odometry")
        self.assert_refused(self.run_with("--kitti", self.street, "--scene", 1), "more than one input")
        self.assert_refused(self.run_with("--scene", 1), "--scene")
        self.assert_refused(["run", "--left", "a.png", "--out", self.folder / "never"], "--right")
        self.assert_refused(["run", "--kitti", self.street, "--out", self.folder / "never"], "--scene")
        self.assert_refused(self.run_with("--device"), "--device")
        self.assert_refused(self.run_with("surplus"), "more than one input", "--odometry", "surplus")
        self.assert_refused(self.run_with("--pair-by", "order"), "--pair-by order", "--left")
        self.assert_refused(["run", "--left", "a%d.png", "--right", "b%d.png", "--calib", "c", "--pair-by", "luck", "--out", self.folder / "never"], "luck")

    def test_two_inputs_that_are_no_pair(self):
        out = ["--out", self.folder / "never"]
        for left, right in (("nix.png", self.street / "image_1/000000.png"), ("nix.mp4", "nixes.mp4")):
            self.assert_refused(["run", left, right, *out], f"{left}: no such file; give the left and the right picture")
        left, right = self.street / "image_0", self.street / "image_1"
        self.assert_refused(["run", left, right, *out], f"{left} and {right}: are two folders", f"--left '{left}/*' --right '{right}/*' --calib FILE")

    def test_disparity_maps_of_both_cameras_are_no_images(self):
        self.assert_refused(["run", self.street / "truth", "--out", self.folder / "never"], f"it belongs to the sequence {self.street.resolve()}")
        half = self.new_folder()
        for name in ("image_0", "truth"):
            (half / name).symlink_to(self.street / name)
        self.assert_refused(["run", half, "--out", self.folder / "never"], f"{half}: has neither image_0 and image_1 nor image_2 and image_3; give the folder that holds them")

    def test_patterns_that_the_shell_expanded(self):
        left, right = (sorted((self.street / side).iterdir()) for side in ("image_0", "image_1"))
        for many in (left, left[:2]):
            for command in (["run", "--out", self.folder / "never"], ["doctor"]):
                self.assert_refused([*command, "--left", *many, "--right", right[0], "--calib", self.street / "calib.txt"], "quote", "'*.png'")
        self.assert_refused(["rectify", "--left", *left, "--right", *right, "--calib", self.street / "calib.txt", "--out", self.folder / "never"],
                            "quote", "'*.png'")

    def test_values_out_of_range(self):
        """One of each kind of option: what each refuses, the tests of the library say. Files of the options' names lie beside, and change nothing."""
        folder = self.new_folder()
        for name in ("r0", "o1", "sw", "fifo", "frames", "overview", "p2=151"):
            (folder / name).touch()
        for arguments, named in ((["--disparities", 0], "disparities is 0"), (["--disparities", "64px"], "64px"), (["--paths", 5], "paths is 5"), (["--preset", "best"], "best"),
                                 (["--temporal", "maybe"], "maybe"), (["--frames", "a:b"], "a:b"), (["--frames", f"0:{10**18}"], f"0:{10**18}"),
                                 (["--frames", "0:2000000000"], "2000000000 is missing"), (["--set", "p2"], "NAME=VALUE"), (["--set", "p3=150"], "choose from"),
                                 (["--set", "process_noise_px2=nan"], "process_noise_px2"), (["--device", "abacus"], "abacus"), (["--device", 1000], "1000")):
            self.assert_refused(self.run_with(*arguments), named, cwd=folder)
        self.assert_refused(["synth", "--out", "never", "--frames", 0], "frames", cwd=folder)
        self.assert_refused(["synth", "--out", "never", "--width", "wide"], "wide", cwd=folder)
        self.assertFalse((folder / "never").exists())

    def test_configuration_files(self):
        config = self.new_folder() / "config.toml"
        self.assert_refused(self.run_with("--config", config), config)
        for text, named in ((b"p_1 = 3\n", "p1"), (b"# 1.2.3.4.5\n[constants.a.b.c.d]\np1 = 3\n", "config.toml:2: "), (b"#" * 65537, config), (bytes(range(256)), config),
                            (b"# options\n\n[constants.banded_sgm]\np2 = 150\np9 = 1\n", "config.toml:5: "), (b"p2\n", "name = value"), (b"p2 150\n", "name = value"),
                            (b"# fine\n\n  dynamic\n", "name = value")):
            config.write_bytes(text)
            self.assert_refused(self.run_with("--config", config), config, named)


class BrokenInput(ProgramTest):
    def assert_sequence_refused(self, street, *named, code=2, options=()):
        out = self.new_folder() / "out"
        self.assert_refused(["run", "--odometry", street, "--out", out, *options], *named, code=code)
        self.assertFalse(out.exists(), "refused before the run, but wrote")

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
        self.assert_sequence_refused(street, f"{FRAMES} of {FRAMES} pairs could not be read")
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

    def test_pipes_folders_and_devices_that_opencv_would_read(self):
        folder = self.new_folder()
        for name in ("pipe.avi", "pipe.tif"):
            os.mkfifo(folder / name)
        for source in (folder / "pipe.avi", folder / "pipe.tif", self.street / "image_0", "/dev/zero"):
            self.assert_refused(["rectify", "--side-by-side", source, "--calib", self.street / "calib.txt", "--out", self.new_folder() / "out"],
                                source, "is no file")
        self.assert_refused(["rectify", "--side-by-side", folder / "none.avi", "--calib", self.street / "calib.txt", "--out", self.new_folder() / "out"],
                            "none.avi", "no such file")

    def test_texts_may_begin_with_the_mark_of_utf_8(self):
        street = self.broken_street()
        files = {name: street / name for name in ("calib.txt", "poses.txt", "config.toml")}
        files["config.toml"].write_text("disparities = 16\r\n")
        for file in files.values():
            file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())
        self.assert_works("run", street, "--poses", files["poses.txt"], "--frames", "0:1", "--out", self.new_folder(), "--config", files["config.toml"], "--quiet")

    def test_raw_pairs_of_two_sizes(self):
        street = self.broken_street()
        for side in (0, 1):
            (street / f"image_{side}/000002.png").write_bytes(grey_png(WIDTH, HEIGHT + 2))
        self.assert_refused(["rectify", "--left", street / "image_0/*.png", "--right", street / "image_1/*.png", "--calib", street / "calib.txt",
                             "--out", self.new_folder(), "--quiet"], "pair 3", f"{WIDTH}x{HEIGHT + 2}", "one size")

    def test_times_of_pairs_are_finite_numbers(self):
        street = self.broken_street()
        for time in ("nan", "inf", "0x10", "1e", "1,5"):
            (street / "list").write_text(f"image_0/000000.png image_1/000000.png {time}\n")
            self.assert_refused(["rectify", "--list", street / "list", "--calib", street / "calib.txt", "--out", self.new_folder() / "out"], "list:1")

    def test_folders_where_patterns_belong(self):
        self.assert_refused(["run", "--left", self.street / "image_0", "--right", self.street / "image_1", "--calib", self.street / "calib.txt",
                             "--out", self.new_folder() / "out"], "image_0: is a folder", "image_0/*.png")

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
        poses.write_text(rows[0] + "\n")
        self.assert_sequence_refused(self.street, poses, options=["--poses", poses])
        self.assert_sequence_refused(self.street, "nowhere", options=["--poses", "nowhere"])
        self.assert_refused(["eval-poses", "--estimate", poses, "--truth", self.street / "poses.txt"])
