# SPDX-License-Identifier: Apache-2.0
"""egosgm rectify: raw images of a known rig. Environment as for program_case.py."""
import csv
import math
import os
import re
import shutil
import struct
import unittest.mock

import cv2
import numpy

from input_case import InputTest, read_grey, rotation, sampled, write_grey
from program_case import FRAMES, HEIGHT, WIDTH, grey_png, png


def write_avi(file, images, is_bottom_up=False):
    """A video of raw frames."""
    height, width = images[0].shape
    pad = -3 * width % 4
    size = height * (3 * width + pad)

    def chunk(name, data):
        return name + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2)

    main = struct.pack("<14I", 100000, 10 * size, 0, 0, len(images), 0, 1, size, width, height, 0, 0, 0, 0)
    stream = struct.pack("<4s4sIHHIIIIIIIIHHHH", b"vids", b"DIB ", 0, 0, 0, 0, 1, 10, 0, len(images), size, 0, 0, 0, 0, width, height)
    frame = struct.pack("<IiiHHIIiiII", 40, width, height if is_bottom_up else -height, 1, 24, 0, size, 0, 0, 0, 0)
    head = chunk(b"LIST", b"hdrl" + chunk(b"avih", main) + chunk(b"LIST", b"strl" + chunk(b"strh", stream) + chunk(b"strf", frame)))
    rows = [numpy.pad(numpy.repeat(image[::-1 if is_bottom_up else 1, :, None], 3, 2).reshape(height, -1), ((0, 0), (0, pad))) for image in images]
    movie = chunk(b"LIST", b"movi" + b"".join(chunk(b"00db", row.tobytes()) for row in rows))
    file.write_bytes(chunk(b"RIFF", b"AVI " + head + movie))


class RectifyTest(InputTest):
    """The street as a rig would see it whose cameras are turned and distorted."""

    MODEL = "radial-tangential"
    DISTORTION = ([-0.12, 0.03, 0.001, -0.0005, 0.0], [-0.1, 0.02, -0.0008, 0.0006, 0.0])
    undistorted = staticmethod(cv2.undistortPoints)

    def rig(self):
        """K, distortion, rotation from the raw to the rectified camera; for left and right."""
        f, cx, cy, baseline = self.calibration()
        K = [numpy.array([[1.05 * f, 0, cx + 3], [0, 1.04 * f, cy - 2], [0, 0, 1]]), numpy.array([[1.03 * f, 0, cx - 4], [0, 1.04 * f, cy + 1], [0, 0, 1]])]
        R = [rotation([0, 0, 1], 0.8), rotation([1, 0, 0], -1.5) @ rotation([0, 0, 1], -0.7)]
        return K, R, numpy.array([[f, 0, cx], [0, f, cy], [0, 0, 1]]), baseline

    def raw(self, image, side):
        """Where each raw pixel lies in the rectified image."""
        K, R, P, _ = self.rig()
        raw = numpy.moveaxis(numpy.mgrid[0:HEIGHT, 0:WIDTH][::-1], 0, -1).reshape(-1, 1, 2).astype(float)
        at = self.undistorted(raw, K[side], numpy.array(self.DISTORTION[side]), R=R[side], P=P).reshape(HEIGHT, WIDTH, 2)
        return sampled(image, at[..., 0], at[..., 1])

    def opencv_yaml(self, unit_m=1.0, given=True):
        K, R, P, baseline = self.rig()
        T = R[1].T @ numpy.array([-baseline, 0, 0]) / unit_m
        storage = cv2.FileStorage(".yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
        for i in (0, 1):
            storage.write(f"M{i + 1}", K[i])
            storage.write(f"D{i + 1}", numpy.array([self.DISTORTION[i]]))
            if given:
                storage.write(f"R{i + 1}", R[i])
                storage.write(f"P{i + 1}", numpy.hstack([P, [[-P[0, 0] * baseline / unit_m * i], [0], [0]]]))
        storage.write("R", R[1].T @ R[0])
        storage.write("T", T.reshape(3, 1))
        return storage.releaseAndGetString()

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.raw_folder = cls.folder / "raw"
        for side in (0, 1):
            (cls.raw_folder / f"cam{side}").mkdir(parents=True)
            for i in range(2):
                image = cls.raw(cls("id"), read_grey(cls.street / f"image_{side}/00000{i}.png"), side)
                write_grey(cls.raw_folder / f"cam{side}/{9 + i}.png", image)

    def rectify(self, *arguments, calib=None):
        out = self.new_folder() / "out"
        file = out.parent / "stereo.yml"
        file.write_text(calib or self.opencv_yaml())
        text = self.assert_works("rectify", *arguments, "--calib", file, "--out", out)
        return out, text

    PAIRS = property(lambda self: ("--left", self.raw_folder / "cam0/*.png", "--right", self.raw_folder / "cam1/%d.png"))

    def assert_like_the_street(self, out):
        """It was interpolated twice: blurred, but each pixel at its place, to a tenth of a pixel."""
        valid = read_grey(out / "valid.png") == 255
        self.assertGreater(valid.mean(), 0.8)
        for side in (0, 1):
            for i in range(2):
                mine, true = (read_grey(folder / f"image_{side}/00000{i}.png").astype(int) for folder in (out, self.street))
                inner = numpy.zeros_like(valid)
                inner[12:-12, 16:-16] = True
                left, here, right, up, down = (numpy.abs(mine - numpy.roll(true, shift, (0, 1)))[inner & valid].mean()
                                               for shift in ((0, -1), (0, 0), (0, 1), (-1, 0), (1, 0)))
                self.assertLess(here, 0.5 * min(left, right, up, down))
                self.assertLess(max(abs(left - right), abs(up - down)), 0.1 * left)

    def euroc(self, drop=()):
        folder = self.new_folder() / "mav0"
        K, R, P, baseline = self.rig()
        body_from_left = numpy.eye(4)
        body_from_left[:3, :3] = rotation([0, 1, 0], 90)
        left_from_right = numpy.eye(4)
        left_from_right[:3, :3] = R[0].T @ R[1]
        left_from_right[:3, 3] = R[0].T @ [baseline, 0, 0]
        for side, pose in enumerate((body_from_left, body_from_left @ left_from_right)):
            camera = folder / f"cam{side}"
            (camera / "data").mkdir(parents=True)
            numbers = ", ".join(f"{value:.12g}" for value in pose.ravel())
            fu, fv, cu, cv = K[side][0, 0], K[side][1, 1], K[side][0, 2], K[side][1, 2]
            (camera / "sensor.yaml").write_text(
                "# General sensor definitions.\nsensor_type: camera\ncomment: VI-Sensor cam0 (MT9M034)\n\n# Sensor extrinsics wrt. the body-frame.\n"
                f"T_BS:\n  cols: 4\n  rows: 4\n  data: [{numbers}]\n\nrate_hz: 20\nresolution: [{WIDTH}, {HEIGHT}]\ncamera_model: pinhole\n"
                f"intrinsics: [{fu:.12g}, {fv:.12g}, {cu:.12g}, {cv:.12g}] #fu, fv, cu, cv\ndistortion_model: {self.MODEL}\n"
                f"distortion_coefficients: {self.DISTORTION[side][:4]}\n")
            with open(camera / "data.csv", "w", newline="") as file:
                writer = csv.writer(file)
                writer.writerow(["#timestamp [ns]", "filename"])
                for i, time in enumerate((1403636579763555584, 1403636579813555456)):
                    if (side, i) in drop:
                        continue
                    writer.writerow([time, f"{time}.png"])
                    shutil.copy(self.raw_folder / f"cam{side}/{9 + i}.png", camera / "data" / f"{time}.png")
        return folder


class Rectify(RectifyTest):
    """Rectified back."""

    def test_raw_pairs_of_a_known_rig_become_the_street_again(self):
        findings = self.run_doctor(*self.PAIRS[:2], "--right", self.raw_folder / "cam1/*.png", "--calib", self.street / "calib.txt")
        self.assertIn("rectify again", findings.stdout)
        out, text = self.rectify(*self.PAIRS)
        self.assert_like_the_street(out)
        self.assertIn("baseline 0.5400 m", text)
        self.assertIn("valid: left", text)
        self.assertFalse((out / "times.txt").exists())
        self.assertLess(abs(float(self.examine(out)["rows"]["text"].split()[2])), 0.1)
        self.assert_works("run", "--odometry", out, "--out", out.parent / "maps", "--disparities", 48, "--quiet")

    def test_without_projections_opencv_finds_them_and_units_are_converted(self):
        out, _ = self.rectify(*self.PAIRS, "--unit", "mm", calib=self.opencv_yaml(unit_m=1e-3, given=False))
        self.assertIn("baseline 0.54 m", self.examine(out)["calibration"]["text"])
        self.assertGreater((read_grey(out / "valid.png") == 255).mean(), 0.98)  # alpha 0
        wide, _ = self.rectify(*self.PAIRS, "--alpha", 1, calib=self.opencv_yaml(given=False))
        self.assertLess((read_grey(wide / "valid.png") == 255).mean(), 0.95)

    def test_a_raw_video_whose_last_row_is_first(self):
        """OpenCV 5 writes beyond its pictures' ends."""
        video = self.new_folder() / "video.avi"
        write_avi(video, [read_grey(file) for file in sorted((self.street / "image_0").iterdir())], is_bottom_up=True)
        command = "rectify", "--left", video, "--right", shutil.copy(video, video.with_stem("right")), "--calib", self.street / "calib.txt", "--out"
        if int(cv2.__version__.split(".")[0]) < 5:
            out = self.new_folder() / "out"
            self.assert_works(*command, out)
            numpy.testing.assert_array_equal(cv2.imread(str(out / "image_2/000000.png"))[..., 0], read_grey(self.street / "image_0/000000.png"))
        with unittest.mock.patch.object(cv2, "__version__", "5.0.0"):
            self.assert_refused([*command, self.new_folder() / "never"], "video.avi: is an AVI of pixels that are not compressed, the last row first", "ffv1")

    def test_a_video_that_ends_before_the_other_one_is_told_of(self):
        folder = self.new_folder()
        whole, cut = folder / "whole.avi", folder / "cut.avi"
        write_avi(whole, [read_grey(file) for file in sorted((self.street / "image_0").iterdir())])
        content = whole.read_bytes()
        cut.write_bytes(content[:content.index(b"00db", len(content) // 2)])  # its header still counts all frames
        for left, right, ended, longer in ((whole, cut, f"--right {cut}", f"--left {whole}"), (cut, whole, f"--left {cut}", f"--right {whole}")):
            out = self.new_folder() / "out"
            text = self.assert_works("rectify", "--left", left, "--right", right, "--calib", self.street / "calib.txt", "--out", out)
            pairs = len(list((out / "image_3").iterdir()))
            self.assertIn(pairs, range(1, FRAMES))
            self.assertIn(f"{ended} ends after {pairs} image{'s' * (pairs > 1)}, before {longer}: ", text)
        told = f"{cut} has {FRAMES} images, and only the first {pairs} can be read"
        self.assertIn(told, text)
        self.assertIn(told, self.assert_works("rectify", "--left", cut, "--right", shutil.copy(cut, folder / "also.avi"), "--calib", self.street / "calib.txt",
                                              "--out", self.new_folder() / "out"))
        both = self.assert_works("rectify", "--side-by-side", cut, "--calib", self.street / "calib.txt", "--out", self.new_folder() / "out")
        self.assertIn(told, both)
        self.assert_refused(["rectify", "--left", whole, "--right", folder / "../" / folder.name / "whole.avi", "--calib", self.street / "calib.txt", "--out",
                             folder / "never"], "are one file", "--side-by-side")

    def test_images_of_both_views_and_lists(self):
        both, above = self.new_folder(), self.new_folder()
        for i in range(2):
            left, right = (read_grey(self.raw_folder / f"cam{side}/{9 + i}.png") for side in (0, 1))
            write_grey(both / f"{i}.png", numpy.hstack([left, right]))
            write_grey(above / f"{i}.png", numpy.vstack([left, right]))
        expected, _ = self.rectify(*self.PAIRS)
        out, _ = self.rectify("--side-by-side", both / "*.png")
        stacked, _ = self.rectify("--top-bottom", above / "*.png")
        rows = "# left right seconds\n" + "".join(f"cam#0/{i}.png cam1/{i}.png {i / 8} # a comment\n" for i in (9, 10))
        (self.raw_folder / "cam#0").symlink_to("cam0")
        (self.raw_folder / "list.txt").write_text(rows)
        listed, _ = self.rectify("--list", self.raw_folder / "list.txt")
        for folder in (out, stacked, listed):
            self.assert_same_files(folder, expected, "**/*.png")
        self.assertEqual((listed / "times.txt").read_text(), "1.125000000\n1.250000000\n")

    def test_one_view_above_the_other_is_told_where_it_is_taken_for_side_by_side(self):
        folder = self.new_folder()
        write_grey(folder / "above.png", numpy.zeros((4 * 40, 2 * 30), numpy.uint8))
        calib = (self.street / "calib.txt").read_text()
        self.assertIn("does one view lie above the other? --top-bottom", self.rectify("--side-by-side", folder / "above.png", calib=calib)[1])
        self.assertNotIn("--top-bottom", self.rectify("--top-bottom", folder / "above.png", calib=calib)[1])
        write_grey(folder / "odd.png", numpy.zeros((41, 60), numpy.uint8))
        self.assert_refused(["rectify", "--top-bottom", folder / "odd.png", "--calib", self.street / "calib.txt", "--out", folder / "never"], "41 px high, which has no half")

    def test_both_pictures_of_a_3d_camera_in_one_file(self):
        folder = self.new_folder()
        images = [read_grey(self.street / f"image_{side}/000000.png") for side in (0, 1)]
        jpegs = [cv2.imencode(".jpg", image)[1].tobytes() for image in images]
        thumbnail = b"\xff\xe1" + (2 + len(jpegs[1])).to_bytes(2, "big") + jpegs[1]  # in a header, as cameras write it
        (folder / "both.MPO").write_bytes(jpegs[0][:2] + thumbnail + jpegs[0][2:] + b"\0\0" + jpegs[1])
        out, _ = self.rectify("--side-by-side", folder / "*.MPO", calib=(self.street / "calib.txt").read_text())
        for side, jpeg in enumerate(jpegs):
            expected = cv2.imdecode(numpy.frombuffer(jpeg, numpy.uint8), cv2.IMREAD_GRAYSCALE)
            numpy.testing.assert_array_equal(read_grey(out / f"image_{side}/000000.png"), expected)
        (folder / "one.mpo").write_bytes(jpegs[0])
        self.assert_refused(["rectify", "--side-by-side", folder / "one.mpo", "--calib", self.street / "calib.txt", "--out", folder / "never"], "does not hold two pictures")

    def test_a_sequence_of_jpegs_gives_what_it_gives_of_pngs(self):
        jpegs, errors = self.broken_street(), []
        for file in jpegs.glob("image_*/*.png"):
            cv2.imwrite(str(file.with_suffix(".jpg")), read_grey(file))
            file.unlink()
        for street in (self.street, jpegs):
            errors.append(self.json_of("eval", self.ran(street, "--disparities", 64), self.street)["pooled"]["bad_or_missing"])
        self.assertAlmostEqual(*errors, delta=1)
        self.assertEqual(self.examine(jpegs)["rows"]["verdict"], "ok")
        file = jpegs / "image_1/000001.jpg"
        os.truncate(file, file.stat().st_size - 200)
        self.assertIn(str(file), self.assert_works("run", jpegs, "--out", self.new_folder() / "out"))

    def test_pairs_are_those_of_equal_names(self):
        raw = self.new_folder()
        for side, missing in ((0, 2), (1, 4)):
            (raw / f"cam{side}").mkdir()
            for i in range(6):
                if i != missing:
                    write_grey(raw / f"cam{side}/{i:06}.png", numpy.full((40, 60), 10 * i + side))
        for pattern in ("%06d.png", "*.png", "*"):
            out, text = self.rectify("--left", raw / "cam0" / pattern, "--right", raw / "cam1" / pattern, calib=(self.street / "calib.txt").read_text())
            self.assertIn("2 images without the other camera's left out", text)
            pairs = [tuple(int(read_grey(out / f"image_{side}/00000{i}.png")[0, 0]) for side in (0, 1)) for i in range(4)]
            self.assertEqual(pairs, [(0, 1), (10, 11), (30, 31), (50, 51)])
            self.assertEqual(len(list((out / "image_0").iterdir())), 4)
        out, text = self.rectify("--left", raw / "cam0/*.png", "--right", raw / "cam1/*.png", "--pair-by", "order",
                                 calib=(self.street / "calib.txt").read_text())
        self.assertEqual([int(read_grey(out / f"image_1/00000{i}.png")[0, 0]) for i in range(5)], [1, 11, 21, 31, 51])

    def test_what_is_rectified_already_is_only_split(self):
        both = self.new_folder() / "both.png"
        images = [read_grey(self.street / f"image_{side}/000000.png") for side in (0, 1)]
        write_grey(both, numpy.hstack(images))
        out, text = self.rectify("--side-by-side", both, calib=(self.street / "calib.txt").read_text())
        for side in (0, 1):
            self.assertTrue((read_grey(out / f"image_{side}/000000.png") == images[side]).all())
        self.assertIn("rectified already", text)

    def test_colour_of_16_bits_stays_so(self):
        both = self.new_folder() / "both.png"
        image = numpy.random.default_rng(1).integers(0, 65536, (HEIGHT, 2 * WIDTH, 3)).astype(numpy.uint16)
        cv2.imwrite(str(both), image)
        out, _ = self.rectify("--side-by-side", both, calib=(self.street / "calib.txt").read_text())
        for side in (0, 1):
            found = cv2.imread(str(out / f"image_{side + 2}/000000.png"), cv2.IMREAD_UNCHANGED)
            numpy.testing.assert_array_equal(found, image[:, side * WIDTH:(side + 1) * WIDTH])
        self.assert_works("run", out, "--disparities", 16, "--write", "cloud", "--out", self.new_folder(), "--quiet")

    def test_a_bad_file_leaves_the_pairs_before_it_as_a_sequence(self):
        street, out = self.broken_street(), self.new_folder() / "out"
        os.truncate(street / "image_1/000003.png", 1000)
        self.assert_refused(["rectify", *self.patterns(street), "--out", out], "000003.png")
        self.assert_works("odometry", out, "--quiet", "--out", self.new_folder() / "poses.txt")
        self.assertEqual(len(list((out / "image_1").iterdir())), 3)

    def test_a_pair_of_another_size_is_named(self):
        street, calib = self.broken_street(), self.new_folder() / "stereo.yml"
        calib.write_text(self.opencv_yaml(given=False))
        for side in (0, 1):
            (street / f"image_{side}/000002.png").write_bytes(grey_png(WIDTH, HEIGHT + 1))
        self.assert_refused(["rectify", *self.patterns(street, calib), "--out", self.new_folder() / "out"], f"pair 3 is {WIDTH}x{HEIGHT + 1}, the pairs before {WIDTH}x{HEIGHT}")

    def test_euroc_folders(self):
        out = self.new_folder() / "out"
        folder = self.euroc()
        text = self.assert_works("rectify", "--euroc", folder.parent, "--out", out)
        self.assertIn("baseline 0.5400 m", text)
        self.assertEqual((out / "times.txt").read_text(), "0.000000000\n0.049999872\n")
        self.assertEqual(self.examine(out)["rows"]["verdict"], "ok")
        text = self.assert_works("rectify", "--euroc", self.euroc(drop=[(1, 0)]), "--out", out.parent / "fewer")
        self.assertIn("1 image without the other one", text)
        self.assertEqual(len(list((out.parent / "fewer/image_0").iterdir())), 1)
        self.assert_all_refused(((ignored, "has its own calibration") for ignored in ("--calib {street}/calib.txt", "--unit m", "--fisheye")),
                                ["rectify", "--euroc", folder, "--out", self.folder / "never"])

    def test_euroc_folders_as_others_write_them(self):
        """The right camera is 12 us late, the header has no mark, and the model has Kalibr's name."""
        folder, out = self.euroc(), self.new_folder() / "out"
        rows = [row.split(",") for row in (folder / "cam1/data.csv").read_text().splitlines()[1:]]
        for sensor in folder.glob("cam*/sensor.yaml"):
            sensor.write_text(sensor.read_text().replace("radial-tangential", "radtan"))

        def let_the_right_be_late(late_ns):
            (folder / "cam1/data.csv").write_text("timestamp [ns],filename\n" + "".join(f"{int(time) + late_ns},{name}\n" for time, name in rows))

        let_the_right_be_late(20_000_000)
        self.assert_refused(["rectify", "--euroc", folder, "--out", out], "the nearest are 20.000 ms apart")
        let_the_right_be_late(12_000)
        self.assertIn("stamps of a pair differ by up to 0.012 ms", self.assert_works("rectify", "--euroc", folder, "--out", out))
        self.assertEqual(len(list((out / "image_0").iterdir())), 2)

    def test_what_cannot_be_rectified_is_refused(self):
        """Of rigs: what one must be, the tests of Python's Rectification and of its readers say."""
        folder, good = self.new_folder(), self.opencv_yaml(given=False)
        calib, raw = folder / "stereo.yml", self.raw_folder
        far = re.sub(r"(M1:.*?data: \[ ?)[^,]*", r"\g<1>1e300", good, flags=re.DOTALL)
        for text, *named in (
                (good.replace("M2:", "M3:"), calib, "M2"), (good.replace("T:", "U:"), calib, "T"), (good.replace("dt: d", "dt: q", 1), calib),
                ("%YAML:1.0\n---\nM1: [1, 2", calib), ("nothing", calib), (good.replace("data: [ ", "data: [ .Nan, ", 1), calib),
                (self.opencv_yaml(unit_m=-1, given=False), "exchange left and right"), (self.opencv_yaml(unit_m=1e-3, given=False), "--unit mm"),
                (self.opencv_yaml(unit_m=math.inf, given=False), "stand in one place"), (self.opencv_yaml(unit_m=1e300, given=False), "stand in one place"),
                (far, "none of the left image's pixels"), (good + "image_width: 640\nimage_height: 480\n", "640x480 were calibrated")):
            calib.write_text(text)
            self.assert_all_refused([(self.PAIRS, *named)], ["rectify"], ["--calib", calib, "--out", self.folder / "never"])
        calib.write_text(good)
        (folder / "cut.png").write_bytes((self.street / "image_0/000000.png").read_bytes()[:-2000])
        (folder / "cut.jpg").write_bytes(b"\xff\xd8\xff\xe0" + bytes(200))
        for name, text in (("empty.mp4", ""), ("empty.avi", ""), ("half.txt", f"{raw}/cam0/9.png\n"), ("same.txt", f"{raw}/cam0/9.png {raw}/cam0/9.png\n"),
                           ("some.txt", "a.png b.png 0.1\nc.png d.png\n"), ("\udcff.tif", ""), ("\udcff.avi", "")):
            (folder / name).write_text(text)
        others = ("a.pfm", b"Pf\n8 8\n-1\n" + bytes(256), "a map of floats"), ("a.dng", b"II*\0" + bytes(99), "developed to PNG"), ("a.pnm", b"P5\n2 2\n255\nabcd", "name it .pgm")
        for name, content, _ in others:  # which OpenCV would take for videos
            (folder / name).write_bytes(content)
        page = numpy.zeros((8, 8), numpy.uint8)
        for name, pages in (("pages.tif", [page] * 3), ("float.tif", [page / numpy.float32(2)]), ("small.tif", [page, page[:4, :4]])):
            cv2.imwritemulti(str(folder / name), pages)
        for bits in (8, 16):
            (folder / f"{bits}.png").write_bytes(png(8, 8, bits, [bytes(bits)] * 8))
        left, both = f"--left {raw}/cam0/*.png", f"--left {raw}/cam0/*.png --right {raw}/cam1/%d.png"
        self.assert_all_refused((
            (f"{left} --right {raw}/cam1/9.png", "both must hold"), (f"{left} --right {{street}}/image_1/*.png", "no right image has the name", "--pair-by order"),
            (f"--side-by-side {raw}/*.jpg", "no file matches"), (left, "half a pair"), (f"{both} --list {calib}", "more than one input"),
            ("--side-by-side {street}/calib.txt", "calib.txt"), (f"{both} --unit inch", "--unit inch"), (f"{both} --alpha 2", "--alpha 2"),
            (f"--left {folder}/small.tif --right {folder}/16.png", "8x8 of 8 bits", "8x8 of 16 bits"),
            *((f"--side-by-side {folder}/{name}", name, "not a readable image") for name in ("cut.png", "cut.jpg")),  # one line, whole or not at all
            *((f"--side-by-side {folder}/{name}", name, "neither an image nor a video") for name in ("empty.mp4", "empty.avi")),
            *((f"--side-by-side {folder}/{name}", words) for name, _, words in others), (f"{folder}/8.png {folder}/16.png", "--left LEFT --right RIGHT"),
            (f"--side-by-side {folder}/pages.tif", "pages.tif: holds 3 pictures"), (f"--side-by-side {folder}/float.tif", "float.tif", "its pixels are float32"),
            (f"--list {folder}/half.txt", "half.txt:1"), (f"--list {folder}/same.txt", "same.txt:1", "is the left and the right image"),
            (f"--list {folder}/some.txt", "has SECONDS in some rows only"),
            *((f"--side-by-side {folder}/\udcff.{kind}", "its name is no UTF-8") for kind in ("tif", "avi")),
            (f"--left {folder}/8.png --right {folder}/16.png", "8x8 of 8 bits", "8x8 of 16 bits")), ["rectify"], ["--calib", calib, "--out", self.folder / "never"])
        self.assert_all_refused((
            (f"{both} --calib {{street}}/calib.txt --alpha 0.5 --out {{never}}", "--alpha 0.5", "rectified images"), (f"{both} --out {{never}}", "--calib FILE"),
            (f"{both} --calib {calib} --out {{street}}", "not empty"), (f"{both} --fisheye --calib {{street}}/calib.txt --out {{never}}", "--fisheye", "calib.txt")), ["rectify"])


class RectifyFisheye(RectifyTest):
    """cv::fisheye's model: four coefficients of the angle to the optical axis."""

    MODEL = "equidistant"
    DISTORTION = ([0.06, -0.02, 0.004, -0.001], [0.05, -0.015, 0.003, -0.0008])
    undistorted = staticmethod(cv2.fisheye.undistortPoints)

    def test_raw_pairs_of_a_known_rig_become_the_street_again(self):
        out, text = self.rectify(*self.PAIRS, "--fisheye")
        self.assert_like_the_street(out)
        self.assertIn("baseline 0.5400 m", text)
        with self.assertRaises(AssertionError):  # and with the other model they do not
            self.assert_like_the_street(self.rectify(*self.PAIRS)[0])

    def test_equidistant_euroc_folders(self):
        out = self.new_folder() / "out"
        self.assertIn("baseline 0.5400 m", self.assert_works("rectify", "--euroc", self.euroc(), "--out", out))
        self.assertEqual(self.examine(out)["rows"]["verdict"], "ok")
