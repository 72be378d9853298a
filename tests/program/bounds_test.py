# SPDX-License-Identifier: Apache-2.0
"""What a small file may take: the bounds of SECURITY.md, measured at the program's peak."""
import json
import os
import resource
import subprocess

from program_case import PROGRAM, ProgramTest, png

MOST_MIB = 256  # resident at the peak, of any file below 64 KiB: as SECURITY.md says
CEILING_MIB = 4096  # so that a broken bound ends the program, not the machine


class Bounds(ProgramTest):
    def peak_mib(self, *arguments):
        """The peak of a command that must refuse its input in one line; the line."""
        def limit():
            resource.setrlimit(resource.RLIMIT_AS, (CEILING_MIB << 20, CEILING_MIB << 20))

        with subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, preexec_fn=limit) as program:
            line = program.stderr.read().decode()
            _, status, usage = os.wait4(program.pid, 0)
            program.returncode = os.waitstatus_to_exitcode(status)
        if "needs the Python package egosgm, which" in line:
            self.skipTest("built without the Python package, which has this tool")
        self.assertEqual(program.returncode, 2, line)
        self.assertEqual(line.count("\n"), 1, line)
        return usage.ru_maxrss / 1024, line

    def assert_bounded(self, file, *arguments, says):
        self.assertLess(file.stat().st_size, 65536)
        peak_mib, line = self.peak_mib(*arguments)
        self.assertIn(file.name, line)
        self.assertIn(says, line)
        self.assertLess(peak_mib, MOST_MIB)

    def test_images_that_unpack_to_hundreds_of_megabytes(self):
        file = self.new_folder() / "bomb.png"
        side = 16384
        file.write_bytes(png(side, side, 1, [bytes(side // 8)] * side, palette=bytes(6)))
        plain, other = file.with_stem("plain"), file.with_stem("other")
        plain.write_bytes(png(side, side, 8, [bytes(side)] * 64))  # as most are: another reader's
        other.write_bytes(file.read_bytes())
        calib, out = ["--calib", self.street / "calib.txt"], ["--out", self.folder / "never"]
        for of, says, *command in ((file, "too short", "eval", file, file), (plain, "too short", "eval", plain, plain), (file, "bomb.png", "run", file, other, *out),
                                   (file, "too short", "doctor", "--left", file, "--right", other, *calib), (file, "bomb.png", "run", "--left", file, "--right", file, *calib, *out),
                                   (file, "too short", "rectify", "--left", file, "--right", other, *calib, *out)):
            with self.subTest(command=command[0], file=of.name):
                self.assert_bounded(of, *command, says=says)

    def test_headers_of_large_images(self):
        """No pipeline is built of a size that only a header, or only one image of a pair, has."""
        folder, side = self.new_folder(), 4096
        header, other, whole = (folder / f"{name}.png" for name in ("header", "other", "whole"))
        for file in (header, other, whole):
            file.write_bytes(png(side, side, 8, [bytes(side)] * side * (file == whole)))
        for left, named in ((header, header), (whole, other)):
            pair = ["--left", left, "--right", other, "--calib", self.street / "calib.txt"]
            for command in (["run", "--disparities", 16], ["odometry"]):
                with self.subTest(left=left, command=command[0]):
                    self.assert_bounded(named, *command, *pair, "--out", folder / "never", says="1 of 1 pair could not be read")
        self.assert_bounded(header, "doctor", "--left", header, "--right", other, "--calib", self.street / "calib.txt", says="not a readable image")

    def test_the_largest_map_that_a_small_file_may_hold(self):
        file = self.new_folder() / "flat.png"
        width, height = 4096, 2048  # 16 MiB of 16 bits
        file.write_bytes(png(width, height, 16, [b"\1\0" * width] * height))
        done = self.new_folder() / "bad.pfm"
        done.write_bytes(b"Pf\n4096 2048\n-1.0\n")
        self.assert_bounded(done, "eval", "--estimate", file, "--truth", done, says="0 bytes of pixels")

    def test_json_that_is_nested_deep(self):
        for name, text in {"objects": '{"x":' * 10000, "arrays": "[" * 30000 + "]" * 30000, "frames": '{"frames": ' + "[" * 20000}.items():
            with self.subTest(name):
                file = self.new_folder() / "report.json"
                file.write_text(text)
                self.assert_bounded(file, "report", file.parent, says="nested deeper than 64 levels")

    def test_calibrations_that_are_nested_deep(self):
        file = self.new_folder() / "nested.yml"
        pairs = ["--left", self.street / "image_0/*.png", "--right", self.street / "image_1/*.png", "--out", file.parent / "out"]
        for text in ("%YAML:1.0\n---\nM1: " + "[" * 60000, "%YAML:1.0\n---\nM1: " + "a: " * 20000, '{"M1":' + '{"data":' * 7000, "<?xml version='1.0'?>" + "<a>" * 20000):
            file.write_text(text)
            self.assert_bounded(file, "rectify", *pairs, "--calib", file, says="nested or named parts")
        ten = lambda name: "[" + ", ".join([name] * 10) + "]"  # noqa: E731
        aliases = f"a: &a {ten('1.0')}\n" + "".join(f"{name}: &{name} {ten('*' + before)}\n" for before, name in zip("abcdefgh", "bcdefghi"))
        groups = "a: &a {" + ", ".join(f"k{i}: 1" for i in range(900)) + "}\n" + "".join(f"m{i}: *a\n" for i in range(900))
        merged = "a: &a {k: 1}\n" + "".join(f"{name}: &{name} {{<<: {ten('*' + before)}}}\n" for before, name in zip("abcdefgh", "bcdefghi"))
        for text in (merged, aliases + "K1: *i\n", groups, aliases + "cam0: {camera_model: *i}\ncam1: {camera_model: *i}\n"):
            file.write_text(text)
            self.assert_bounded(file, "rectify", *pairs, "--calib", file, says="more than 100000 values")

    def test_values_of_a_zed_are_taken_as_they_stand(self):
        file = self.new_folder() / "SN1.conf"
        values = "".join(f"{name} = {f'%({after})s' * 10}\n" for name, after in zip("abcdefghi", "bcdefghij"))
        file.write_text(f"[LEFT_CAM_HD]\n{values}j = 1\n[RIGHT_CAM_HD]\n[STEREO]\n")
        both = file.parent / "both.png"
        both.write_bytes(png(2560, 720, 8, [bytes(2560)] * 720))
        self.assert_bounded(file, "rectify", "--side-by-side", both, "--calib", file, "--out", file.parent / "out", says="lacks fx")

    def test_reports_of_more_frames_than_there_are(self):
        out = self.new_folder() / "out"
        self.assert_works("run", "--odometry", self.street, "--out", out, "--frames", "0", "--disparities", 16, "--quiet")
        report = self.report(out)
        for sequence in ({"first_frame": 0, "last_frame": 2147483645, "frames": 2147483646}, {"first_frame": 0, "last_frame": 2**40, "frames": 2**40 + 1},
                         {"first_frame": 1, "last_frame": 2147483647, "frames": -2147483648}):
            (out / "report.json").write_text(json.dumps({**report, "sequence": sequence}))
            self.assert_works("report", out, "--out", out / "page.html", preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (CEILING_MIB << 20, CEILING_MIB << 20)))
            (out / "page.html").unlink()

    def test_configurations_of_deep_sections(self):
        file = self.new_folder() / "config.toml"
        file.write_text("[" + "a." * 5000 + "a]\n")
        self.assert_bounded(file, "run", "--odometry", self.street, "--config", file, "--out", self.folder / "never", says="nested too deep")
