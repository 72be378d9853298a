# SPDX-License-Identifier: Apache-2.0
"""What people bring as it is: pictures alone, calibrations and maps of other programs, doubtful units. Environment as for program_case.py."""
import json
import re
import shutil
import subprocess
import unittest

import numpy

from input_case import InputTest, read_grey, write_grey, write_grey16
from program_case import FRAMES, HAS_PACKAGE, HEIGHT, WIDTH, egosgm


class Brought(InputTest):
    def pictures(self, i=0):
        return self.street / f"image_0/{i:06d}.png", self.street / f"image_1/{i:06d}.png"


class TwoPictures(Brought):
    def test_two_pictures_give_disparities_and_one_line(self):
        first = [str(picture).replace("000000", "00000*") for picture in self.pictures()]
        for arguments in (self.pictures(), ("--left", self.pictures()[0], "--right", self.pictures()[1]), [*first, "--frames", 0]):
            out = self.new_folder() / "out"
            said = self.assert_works("run", *arguments, "--out", out)
            self.assertEqual(said.count("no depth and no odometry"), 1)
            self.assertNotIn("doctor", said)
            self.assertEqual(sorted(file.name for file in out.iterdir()), ["disparity", "report.json"])
        self.assert_same_files(out, self.ran(*self.patterns(), "--frames", 0), "disparity/*")
        self.assertNotIn("doctor", self.assert_works("run", *self.patterns()[:4], "--out", self.new_folder() / "out"))  # a video

    def test_what_needs_a_calibration_says_so(self):
        end = [*self.pictures(), "--out", self.folder / "never"]
        self.assert_all_refused((
            *((f"run --write {kind}", f"--write {kind}", "--calib") for kind in ("depth", "depth_m", "cloud", "flow", "disp_1", "objects")),
            ("run --poses {street}/poses.txt", "--poses", "--calib"), ("odometry", "--calib")), end=end)
        self.assert_refused(["run", self.street, self.pictures()[0], "--out", self.folder / "never"], "more than one input")

    def test_doctor_looks_at_two_pictures(self):
        findings = self.examine(*self.pictures())
        self.assertEqual(findings["calibration"]["verdict"], "note")
        self.assertEqual(findings["rows"]["verdict"], "ok")


class Doubts(Brought):
    def test_units_of_a_baseline(self):
        f, _, _, baseline = self.calibration()
        for value, verdict, named in ((100 * baseline, "problem", "centimetres (0.54 m)"), (1000 * baseline, "problem", "millimetres (0.54 m)"),
                                      (baseline / f, "problem", "is fx missing, so that it is 0.54 m?"), (baseline / 1000, "problem", "is this one in metres there, 0.54 m?"), (3, "note", "decimetres (0.3 m)")):  # that may be right
            arguments = self.patterns(calib=self.calibrated(baseline_m=value))
            with self.subTest(named):
                self.assertIn(named, self.assert_works("run", *arguments, "--out", self.new_folder() / "out"))
                found = self.examine(*arguments, code=2 if verdict == "problem" else 0)
                self.assertEqual([name for name, finding in found.items() if finding["verdict"] == "problem"], ["calibration"] * (verdict == "problem"))
                self.assertEqual(found["calibration"]["verdict"], verdict)
                self.assertIn(named, found["calibration"]["remedy"])
        self.assertIn("doubtful: a baseline of 3 m", self.assert_works("rectify", *arguments, "--out", self.new_folder() / "out"))

    def test_what_is_nearer_than_the_range_is_said_with_a_range_that_holds_it(self):
        said = self.assert_works("run", self.street, "--disparities", 16, "--out", self.new_folder() / "out")
        share, enough = re.search(r"(\d+) % of the image is nearer than the range \(--disparities (\d+)\)", said).groups()
        self.assertTrue(1 <= int(share) <= 90 and 16 < int(enough) <= 128, said)
        said = self.assert_works("run", self.street, "--disparities", enough, "--out", self.new_folder() / "out")
        self.assertNotIn("nearer than the range", said)

    def test_what_is_farther_than_the_range_is_said_unless_it_is_beyond_infinity(self):
        for doffs, least, share in ((0, 12, "[1-9][0-9]"), (-12, 12, None), (0, 0, None)):
            arguments = *self.patterns(calib=self.calibrated(doffs_px=doffs)), "--min-disparity", least
            said = self.assert_works("run", *arguments, "--out", self.new_folder() / "out")
            with self.subTest(doffs=doffs, least=least):
                self.assertRegex(said, rf"{share} % of the image is farther than the range \(--min-disparity -?[0-4]\)") if share else self.assertNotIn("farther than", said)

    def test_a_principal_point_and_a_focal_length_of_other_images(self):
        f, cx, cy, _ = self.calibration()
        for changes, named in ((dict(cx=cx / 4, cy=cy / 4), "principal point"), (dict(fx=f / 40, fy=f / 40), "focal lengths"),
                               (dict(fx=0.58, fy=1.9, cx=0.5, cy=0.5), "shares of the sides"), (dict(fx=4, fy=4, cx=3, cy=1.1), "are they millimetres"),
                               (dict(doffs_px=cx), "the right principal point"), (dict(cx=HEIGHT / 2, cy=WIDTH / 2), "are turned by 90 degrees, or cx and cy are exchanged")):
            arguments = self.patterns(calib=self.calibrated(**changes))
            self.assertIn(named, self.assert_works("run", *arguments, "--out", self.new_folder() / "out"))
            finding = self.assert_only_problem("calibration", *arguments)
            self.assertIn(named, finding["text"] + finding["remedy"])

    def test_calibrations_of_images_of_other_sizes(self):
        """By the size that the file says, else by the principal point."""
        f, cx, cy, baseline = self.calibration()
        f, cx, cy = numpy.array([f, WIDTH / 2 - 0.5, HEIGHT / 2 - 0.5])
        for factor, is_told in ((0.5, True), (0.75, True), (0.9, False), (1, False), (1.1, False), (1.25, True), (1.5, True), (2, True)):
            arguments = self.patterns(calib=self.calibrated(fx=factor * f, fy=factor * f, cx=factor * cx, cy=factor * cy))
            said = self.assert_works("run", *arguments, "--out", self.new_folder() / "out")
            self.assertEqual("the principal point is far from the middle" in said, is_told, factor)
            finding = next(one for one in json.loads(self.run_doctor(*arguments, "--json").stdout) if one["check"] == "calibration")
            self.assertEqual("the principal point is far from the middle" in finding["text"], is_told, factor)
        wide = self.patterns(calib=self.calibrated(fx=1.3 * f, cx=1.3 * cx, fy=f, cy=cy))  # scaled as images were whose height stayed
        self.assertIn("the principal point is far from the middle", self.assert_works("run", *wide, "--frames", 0, "--out", self.new_folder() / "out"))
        k = f"[{f} 0 {cx}; 0 {f} {cy}; 0 0 1]"
        p = f"{f} 0 {cx} 0 0 {f} {cy} 0 0 0 1 0"
        for text in (f"cam0={k}\ncam1={k}\nbaseline={1000 * baseline}\nwidth={2 * WIDTH}\nheight={2 * HEIGHT}\n",
                     f"S_rect_00: {2 * WIDTH} {2 * HEIGHT}\nP_rect_00: {p}\nP_rect_01: {p.replace(' 0 0', f' {-f * baseline} 0', 1)}\n"):
            file = self.new_folder() / "calib.txt"
            file.write_text(text)
            for command in (["run", *self.patterns(calib=file), "--out", self.new_folder() / "never"], ["doctor", *self.patterns(calib=file)],
                            ["odometry", *self.patterns(calib=file), "--out", self.new_folder() / "never"]):
                self.assert_refused(command, f"is of images of {2 * WIDTH}x{2 * HEIGHT}, and these have {WIDTH}x{HEIGHT}")
            file.write_text(text.replace(str(2 * WIDTH), str(WIDTH)).replace(str(2 * HEIGHT), str(HEIGHT)))
            self.assert_works("run", *self.patterns(calib=file), "--out", self.new_folder() / "out")

    def test_a_folder_without_a_calibration_runs_as_two_pictures_do(self):
        folder = self.new_folder() / "drive"
        for side, source in (("left", "image_0"), ("right", "image_1")):
            shutil.copytree(self.street / source, folder / side)
        self.assertIn("no depth and no odometry; --calib FILE brings both", self.assert_works("run", folder, "--out", self.new_folder() / "out"))
        self.assertEqual(self.examine(folder)["calibration"]["verdict"], "note")
        self.assert_refused(["odometry", folder, "--out", folder / "never"], "holds no calibration", "--calib FILE")
        out = self.new_folder() / "out"
        self.assertNotIn("no depth", self.assert_works("run", folder, "--calib", self.street / "calib.txt", "--out", out))
        self.assertTrue((out / "poses.txt").exists())
        shutil.copy(self.street / "calib.txt", folder)
        self.assert_refused(["run", folder, "--calib", self.street / "calib.txt", "--out", folder / "never"], "is read with the calibration in it")

    def test_a_missing_baseline_is_no_reason_to_exchange_cameras(self):
        f, cx, cy, baseline = self.calibration()
        for row in ("", f"distance = {baseline}\n", "baseline_m = 0\n"):
            file = self.new_folder() / "calib.txt"
            file.write_text(f"fx = {f}\nfy = {f}\ncx = {cx}\ncy = {cy}\n{row}")
            done = egosgm("doctor", *self.patterns(calib=file))
            self.assertEqual(done.returncode, 2)
            self.assertNotIn("exchange", done.stdout + done.stderr)
            self.assertIn("baseline", done.stdout + done.stderr)

    def test_a_chessboard_is_no_problem(self):
        """Its squares are mistaken for each other, in rows and along them."""
        random = numpy.random.default_rng(1)
        folder = self.new_folder() / "board"
        for side in ("left", "right"):
            (folder / side).mkdir(parents=True)
        (folder / "calib.txt").write_text("fx = 460\nfy = 460\ncx = 319.5\ncy = 239.5\nbaseline_m = 0.06\n")
        board = numpy.kron(numpy.indices((7, 10)).sum(0) % 2, numpy.ones((36, 36))) * 190 + 30
        coarse = random.uniform(110, 150, (13, 21))
        wall = numpy.kron(coarse, numpy.ones((40, 40)))[:480, :800]
        for i in range(3):
            x, y, disparity = 160 + 12 * i, 80 + 14 * i, 40 + 8 * i
            for side, shift in (("left", 0), ("right", 1)):
                image = wall[:, 20 * shift:20 * shift + 640].copy()
                at = x - disparity * shift
                image[y:y + board.shape[0], at:at + board.shape[1]] = board
                write_grey(folder / side / f"{i}.png", numpy.clip(image + random.normal(0, 2, image.shape), 0, 255))
        findings = self.examine(folder)
        self.assertNotIn("problem", [finding["verdict"] for finding in findings.values()], findings)

    def test_a_drive_that_does_not_move_on_is_found_as_run_finds_it(self):
        street = self.broken_street()
        for side in (0, 1):  # every other moment is another place: the frames of a mirrored world
            for i in (1, 3):
                file = street / f"image_{side}/{i:06d}.png"
                write_grey(file, read_grey(self.street / f"image_{1 - side}/{i:06d}.png")[:, ::-1])
        said = self.assert_works("run", street, "--out", self.new_folder() / "out")
        self.assertIn("no motion in 3 of 3 frames", said)
        self.assertEqual(self.examine(street)["motion"]["verdict"], "note")
        self.assertNotIn("motion", self.examine(self.street))

    def test_a_pedestal_and_a_hot_pixel_of_16_bits(self):
        """Motions are found as in 8 bits, and doctor finds points."""
        def brighter(image):
            image = 7000 + 3 * image.astype(numpy.uint16)
            image[HEIGHT // 2, WIDTH // 3] = 65535
            return image
        street = self.changed_street(brighter, write=write_grey16)
        self.assertNotIn("no motion", self.assert_works("run", street, "--out", self.new_folder() / "out"))
        self.assertEqual(self.examine(street)["rows"]["verdict"], "ok")

    def test_times_in_other_units(self):
        street = self.broken_street()
        for unit, factor in (("milliseconds", 1e3), ("microseconds", 1e6), ("nanoseconds", 1e9)):
            (street / "times.txt").write_text("".join(f"{int((100 + 0.1 * i) * factor)}\n" for i in range(FRAMES)))
            self.assertIn(unit, self.assert_only_problem("times", street)["remedy"])

    def poses(self, change):
        rows = numpy.loadtxt(self.street / "poses.txt").reshape(-1, 3, 4)
        poses = numpy.concatenate([rows, numpy.tile([[[0, 0, 0, 1.0]]], (len(rows), 1, 1))], axis=1)
        file = self.new_folder() / "poses.txt"
        numpy.savetxt(file, change(poses)[:, :3].reshape(-1, 12))
        return file

    def test_given_poses_are_looked_at(self):
        def scaled(poses):
            changed = poses.copy()
            changed[:, :3, 3] *= 1000
            return changed

        ned = numpy.eye(4)
        ned[:3, :3] = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]
        cases = ((lambda poses: poses, ""), (scaled, "millimetres"), (numpy.linalg.inv, "inverses"),
                 (lambda poses: numpy.linalg.inv(ned) @ poses @ ned, "NED's axes"))
        for change, named in cases:
            out = self.new_folder() / "out"
            said = self.assert_works("run", self.street, "--poses", self.poses(change), "--out", out)
            with self.subTest(named):
                self.assertEqual("the given poses contradict the images" in said, bool(named))
                self.assertIn(named, said)
                self.assertIn(named, self.report(out).get("warning", ""))


class KnownFormats(Brought):
    def test_calibrations_that_are_not_read_are_named(self):
        texts = {"a camera chain of Kalibr": "cam0:\n  camera_model: pinhole\ncam1:\n  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, -0.3]\n",
                 "ROS's calibrator": "camera_matrix:\n  rows: 3\n  data: [1]\nprojection_matrix:\n  rows: 3\n  data: [1]\n",
                 "EuRoC or Kimera": "T_BS:\n  rows: 4\n  data: [1]\nintrinsics: [1, 2, 3, 4]\n",
                 "ORB-SLAM": "%YAML:1.0\nCamera.fx: 460.0\n", "DSEC": "disparity_to_depth:\n  cams_12:\n  - [1.0]\n",
                 "Cityscapes": '{"extrinsic": {"baseline": 0.3}, "intrinsic": {"fx": 460, "u0": 319.5}}',
                 "K.txt": "460.0 0.0 319.5 0.0 460.0 239.5 0.0 0.0 1.0\n0.3\n", "JSON": '{"a": 1}', "INI or TOML": "[left]\nfx = 460\n", "OpenCV's stereo calibration": '{"K1": [[1]], "K2": [[1]]}'}
        program, environment = self.without_package()
        for named, text in texts.items():
            file = self.new_folder() / "calib.yaml"
            file.write_text(text)
            done = subprocess.run([program, "run", *map(str, self.patterns(calib=file)), "--out", file.parent / "out"], env=environment,
                                  capture_output=True, text=True, timeout=900)
            if "needs the Python package" not in done.stderr:
                self.skipTest("the package is installed here")
            self.assertRegex(done.stderr, r"^egosgm: error: run: [^\n]*EgoSGM's formats[^\n]*pip install[^\n]*\n$")
            self.assertIn(named, done.stderr)

    @unittest.skipUnless(HAS_PACKAGE, "built without the Python package")
    def test_run_and_odometry_read_what_the_package_reads(self):
        f, cx, cy, baseline = self.calibration()
        folder, own = self.new_folder(), self.calibrated()
        file = folder / "K.txt"
        file.write_text(f"{f} 0 {cx} 0 {f} {cy} 0 0 1\n{baseline}\n")
        for calib, name in ((own, "own"), (file, "other")):
            self.assert_works("run", *self.patterns(calib=calib), "--frames", ":1", "--disparities", 16, "--out", folder / name)
            self.assert_works("odometry", *self.patterns(calib=calib), "--frames", ":1", "--out", folder / f"{name}.txt")
        self.assertEqual(self.report(folder / "other")["calibration"], self.report(folder / "own")["calibration"])
        for name in ("{}/disparity/000001.png", "{}/poses.txt", "{}.txt"):
            self.assertEqual((folder / name.format("other")).read_bytes(), (folder / name.format("own")).read_bytes())
        file.write_text(f"{f} 0 {cx} 0 {f} {cy} 0 0 1\n3\n")
        said = self.assert_works("run", *self.patterns(calib=file), "--frames", 0, "--out", folder / "doubtful")
        self.assertIn(f"--calib {file} --frames 0` tells why", said)
        k = [[f, 0, cx], [0, f, cy], [0, 0, 1]]
        (folder / "raw.json").write_text(json.dumps({"K1": k, "K2": k, "D1": [0.1, 0, 0, 0], "D2": [0] * 4, "R": numpy.eye(3).tolist(), "T": [-baseline, 0, 0]}))
        self.assert_refused(["run", *self.patterns(calib=folder / "raw.json"), "--out", folder / "never"], "is of raw images")
        own.write_text(own.read_text().replace("baseline_m", "baseline_m = 1\nbase"))  # of a format that is known: the program itself says it
        self.assert_refused(["run", *self.patterns(calib=own), "--out", folder / "never"], own, "unknown key 'base'")


class Names(Brought):

    def test_pairs_by_order_whose_numbers_go_apart_are_told(self):
        folder = self.new_folder()
        for side, source, left_out in (("left", "image_0", 1), ("right", "image_1", 2)):
            shutil.copytree(self.street / source, folder / side)
            (folder / side / f"{left_out:06d}.png").unlink()
        arguments = "--left", folder / "left/*.png", "--right", folder / "right/*.png", "--calib", self.street / "calib.txt", "--pair-by", "order"
        self.assertIn("is a frame missing on one side?", egosgm("doctor", *arguments).stdout)
        self.assertEqual(self.assert_whole(self.ran(*arguments, "--disparities", 16)), FRAMES - 1)
        self.assertNotIn("missing", egosgm("doctor", *self.patterns(), "--pair-by", "order").stdout)


class Maps(Brought):
    """One map in all formats, with what other programs write where there is nothing."""

    def npy(self, file, values):
        numpy.save(file, values)

    def pfm(self, file, values):
        file.write_bytes(f"Pf\n{values.shape[1]} {values.shape[0]}\n-1\n".encode() + values[::-1].astype("<f4").tobytes())

    def png16(self, file, values):
        write_grey16(file, values.astype(numpy.int64) % 65536)

    def setUp(self):
        self.maps = self.new_folder()
        random = numpy.random.default_rng(2)
        self.truth = random.uniform(4, 20, (24, 40)).astype(numpy.float32)
        self.npy(self.maps / "truth.npy", self.truth)
        self.missing = random.uniform(size=self.truth.shape) < 0.3

    def figures(self, name, *arguments):
        said = json.loads(self.assert_works("eval", self.maps / name, self.maps / "truth.npy", "--json", *arguments))
        return said["pooled"]["density"], said["pooled"]["bad_or_missing"], " ".join(said.get("warnings", []))

    def test_one_rule_of_what_has_no_value(self):
        sixteenths, expected = numpy.rint(self.truth * 16), 100 * (1 - self.missing.mean())

        def assert_holes(write, file, nothing, values, kind, *scale, is_told=False):
            write(self.maps / file, numpy.where(self.missing, nothing, values).astype(kind))
            with self.subTest(file=file, nothing=nothing):
                density, bad, warnings = self.figures(file, *scale)
                self.assertAlmostEqual(density, expected)
                self.assertAlmostEqual(bad, 100 - expected)
                self.assertEqual("no disparities" in warnings, is_told)

        for nothing in (-1, 0, numpy.inf, numpy.nan):
            assert_holes(self.npy, "map.npy", nothing, sixteenths / 16, numpy.float32)
            assert_holes(self.pfm, "map.pfm", nothing, sixteenths / 16, numpy.float32)
        for nothing in (-16, 0):
            assert_holes(self.png16, "map.png", nothing, sixteenths, numpy.int64, "--scale", 16, is_told=nothing < 0)
            assert_holes(self.npy, "map.npy", nothing, sixteenths, numpy.int16, "--scale", 16)

    def test_zero_is_a_disparity_where_infinity_marks_what_has_none(self):
        """Runs write such PFM, of a sky for instance, and PNG with the least value there."""
        self.npy(self.maps / "truth.npy", numpy.where(self.truth < 8, numpy.float32(1 / 256), self.truth))
        values = numpy.where(self.missing, numpy.inf, numpy.where(self.truth < 8, 0, self.truth))
        self.pfm(self.maps / "map.pfm", values)
        self.png16(self.maps / "map.png", numpy.where(self.missing, 0, numpy.maximum(1, 256 * numpy.where(self.missing, 0, values))))
        of_pfm, of_png = (self.json_of("eval", self.maps / name, self.maps / "truth.npy")["pooled"] for name in ("map.pfm", "map.png"))
        for name in ("filled", "density", "bad_or_missing"):
            self.assertEqual(of_pfm[name], of_png[name], name)

    def test_negative_disparities_that_differ_are_values(self):
        self.npy(self.maps / "truth.npy", numpy.abs(self.truth))
        self.pfm(self.maps / "signed.pfm", numpy.where(self.missing, -self.truth, self.truth))
        self.assertAlmostEqual(self.figures("signed.pfm")[0], 100)

    def test_what_is_wider_than_the_image_is_no_disparity(self):
        self.npy(self.maps / "wide.npy", numpy.where(self.missing, 4095, self.truth).astype(numpy.float32))
        density, _, warnings = self.figures("wide.npy")
        self.assertAlmostEqual(density, 100 * (1 - self.missing.mean()))
        self.assertIn("beyond the image's width", warnings)

    def test_a_file_that_is_compared_with_itself_is_told(self):
        self.pfm(self.maps / "copy.pfm", self.truth)
        self.npy(self.maps / "sparse.npy", numpy.where(self.missing, -1, self.truth).astype(numpy.float32))
        self.npy(self.maps / "near.npy", self.truth + numpy.float32(0.001))
        for name, is_told in (("truth.npy", True), ("copy.pfm", True), ("sparse.npy", False), ("near.npy", False)):
            self.assertEqual("is a file compared with itself" in self.figures(name)[2], is_told, name)
        said = self.assert_works("eval-video", self.maps / "truth.npy", self.maps / "truth.npy")
        self.assertIn("is a file compared with itself", said)

    def test_another_scale_is_told(self):
        self.png16(self.maps / "map.png", numpy.rint(self.truth * 16))
        self.assertIn("needs --scale 16;", self.figures("map.png")[2])
        self.assertEqual(self.figures("map.png", "--scale", 16)[2], "")
        for factor in (1.28, 1 / 1.28, 1.2, 0.8):
            self.npy(self.maps / "scaled.npy", (factor * self.truth).astype(numpy.float32))
            self.assertIn(f"needs --truth-scale {256 / factor:.4g}, an estimate of {256 * factor:.4g} --scale", self.figures("scaled.npy")[2])
        noise = numpy.random.default_rng(3).uniform(0.5, 1.9, self.truth.shape)  # of no one scale
        for name, values in (("poor.npy", noise * self.truth), ("little.npy", 1.1 * self.truth), ("shifted.npy", self.truth + 4)):
            self.npy(self.maps / name, values.astype(numpy.float32))
            self.assertEqual(self.figures(name)[2], "", name)

    def test_what_is_no_disparity_in_pixels_is_told(self):
        for name, values, named in (("width", self.truth / WIDTH, "are they disparities in pixels?"), ("depth", 20 / self.truth, "are they disparities in pixels?"),
                                    ("sign", -self.truth, "of the other sign"), ("none", numpy.full_like(self.truth, numpy.nan), "no estimate has a value")):
            self.npy(self.maps / f"{name}.npy", values.astype(numpy.float32))
            self.assertIn(named, self.figures(f"{name}.npy")[2], name)
        for values in (numpy.nan, 0, numpy.inf):
            self.npy(self.maps / "nothing.npy", numpy.full_like(self.truth, values, numpy.float32))
            self.assertIn("the truth has no disparity above 1 px in any pixel", self.assert_works("eval", self.maps / "truth.npy", self.maps / "nothing.npy"))

    def test_a_scale_that_does_not_apply_is_refused(self):
        maps, truth = self.maps, self.maps / "truth.npy"
        for write, name, factor in ((self.npy, "map.npy", 1), (self.pfm, "map.pfm", 1), (self.png16, "map.png", 256)):
            write(maps / name, numpy.rint(self.truth * factor))
        self.assert_all_refused((
            *((f"eval {maps / name} {truth} --scale 16", "--scale 16", name) for name in ("map.npy", "map.pfm")),
            (f"eval {maps}/map.png {truth} --truth-scale 16", "--truth-scale 16", "truth.npy")))
