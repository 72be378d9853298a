# SPDX-License-Identifier: Apache-2.0
"""egosgm doctor: sequences that are broken in just one way. Environment as for program_case.py."""
import json
import pathlib
import shutil
import unittest

import numpy

from input_case import InputTest, read_grey, rotation, sampled, write_grey, write_grey16
from program_case import DATA, FRAMES, HEIGHT, WIDTH


class Doctor(InputTest):
    def test_a_sound_sequence_has_no_problem(self):
        findings = self.examine(self.street)
        self.assertEqual(list(findings), ["images", "calibration", "rows", "sides", "range", "times"])
        self.assertLess(abs(float(findings["rows"]["text"].split()[2])), 0.1)
        text = self.assert_works("doctor", "--odometry", self.street)
        self.assertTrue(text.endswith("No problem was found.\n"))
        self.assertIn("baseline 0.54 m", text)
        self.assertIn(f" {FRAMES} pairs of ", text)
        self.assertIn(" 1 pair of ", self.assert_works("doctor", "--odometry", self.street, "--frames", "0"))

    def test_changed_images(self):
        """What is the only problem then, and what is said of it."""
        def smooth(image):
            image = image.astype(float)
            for axis in (0, 1) * 3:
                image = sum(numpy.roll(image, shift, axis) for shift in range(-3, 4)) / 7
            return image

        for check, words, change, *how in (
                ("matches", "the right images are turned by 180 degrees", lambda image: image[::-1, ::-1], ["image_1"]),
                ("matches", "the right images are upside down", lambda image: image[::-1], ["image_1"]),
                ("matches", "the right images are mirrored", lambda image: image[:, ::-1], ["image_1"]),
                ("matches", "invert them", lambda image: 255 - image, ["image_1"]),
                ("matches", "coarsely, left and right agree", smooth), ("images", "", lambda image: numpy.full_like(image, 60), ["image_1"]),
                ("images", "of nearly one tone", lambda image: image / 32), ("images", "of nearly one tone", lambda image: 0 * image)):
            with self.subTest(check=check, words=words):
                finding = self.assert_only_problem(check, self.changed_street(change, *how))
                self.assertIn(words, finding["text"] + finding["remedy"])

    def said_by_run(self, street):
        return self.assert_works("run", street, "--out", self.new_folder() / "out")

    def mosaic(self, order, scale=1, **how):
        """A street as a sensor sees it whose colours lie in this order, two by two."""
        return self.changed_street(lambda image: scale * numpy.clip(image * numpy.tile(order, (HEIGHT // 2, WIDTH // 2)), 0, 255), **how)

    def wide(self, scale, change=numpy.array):
        return self.changed_street(lambda image: change(scale * image.astype(numpy.uint16)), write=write_grey16)

    def test_mosaics_of_colour_sensors(self):
        orders = ((0.45, 0.8), (0.8, 1.25)), ((0.95, 0.9), (1.0, 0.95)), ((0.8, 1.25), (0.45, 0.8))
        streets = [self.mosaic(order) for order in orders] + [self.mosaic(order, 200, write=write_grey16) for order in orders]
        for street in streets:
            finding = self.examine(street, code=2)["images"]
            self.assertIn("mosaics of colour sensors", finding["text"])
            self.assertNotIn("deinterlace", finding["remedy"])
        self.assertIn("mosaics of colour sensors", self.said_by_run(streets[0]))
        of_one = self.mosaic(orders[0], sides=["image_1"])
        self.assertIn("mosaics of colour sensors", self.said_by_run(of_one) + self.assert_only_problem("images", of_one)["text"])

    def test_changed_values_of_which_run_tells_too(self):
        random, same = numpy.random.default_rng(1), self.broken_street()
        for file in (same / "image_0").iterdir():
            shutil.copy(file, same / "image_1" / file.name)
        chessboard = 64 * (numpy.indices((HEIGHT, WIDTH)).sum(0) % 2)
        two_levels = self.changed_street(lambda image: numpy.where(image + chessboard + random.integers(0, 9, image.shape) > 128, 255, 0))
        for check, words, run_says, street in (
                ("matches", "are the same", "are the same in 4 of 4 frames", same), ("images", "2 grey levels in all", "doctor", two_levels),
                ("images", "both bytes of each pixel exchanged", "both bytes of each pixel are exchanged", self.wide(200, numpy.ndarray.byteswap)),
                ("images", "no value above 255", "values of 8 bits in images of 16: `egosgm doctor", self.wide(1))):
            with self.subTest(words):
                said, findings = self.said_by_run(street), self.examine(street, code=2)
                self.assertIn(run_says, said)
                self.assertIn(words, findings[check]["text"])
                self.assertNotIn("mosaics", said + str(findings))
                self.assertEqual([finding["verdict"] for finding in findings.values()].count("problem"), 1, findings)

    def test_images_without_a_problem(self):
        every_other_column_is_brighter = self.mosaic(((1, 1.1), (1, 1.1)))
        for street in (self.wide(257), self.wide(256), every_other_column_is_brighter, self.street):
            self.assertNotIn("doctor", self.said_by_run(street))
            self.assertEqual(self.examine(street, code=0)["images"]["verdict"], "ok")

    def test_dark_images_and_another_exposure_or_gamma_of_one_side_are_matched(self):
        for change, *how in ((lambda image: 0.2 * image, ["image_1"]), (lambda image: 255 * (image / 255.0) ** 3, ["image_1"]), (lambda image: 0.11 * image,)):
            found = self.examine(self.changed_street(change, *how))
            self.assertEqual((found["rows"]["verdict"], found["sides"]["verdict"], found["range"]["verdict"]), ("ok", "ok", "note"), found)
            self.assertEqual("times as bright" in found["images"]["text"], bool(how))

    def shifted(self, shift_px):
        y, x = numpy.mgrid[0:HEIGHT, 0:WIDTH]
        return self.changed_street(lambda image: sampled(image, x, y - shift_px), ["image_1"])

    def test_a_vertical_misalignment_is_measured(self):
        for shift in (0.7, -3.0):
            finding = self.assert_only_problem("rows", self.shifted(shift))
            self.assertAlmostEqual(float(finding["text"].split()[2]), shift, delta=0.07)
            self.assertIn(f"{abs(shift):.1f} px: rectify again", finding["remedy"])
        street = self.shifted(-3)
        alone = self.assert_only_problem("rows", *self.patterns(street)[:4])
        self.assertIn("3.0 px: these images are not rectified: `egosgm calibrate`", alone["remedy"])

    def test_a_turned_camera_is_measured(self):
        y, x = numpy.mgrid[0:HEIGHT, 0:WIDTH]
        finding = self.assert_only_problem("rows", self.changed_street(lambda image: sampled(image, x, y - 8 * (x / WIDTH - 0.5)), ["image_1"]))
        self.assertAlmostEqual(float(finding["text"].split(" px from left to right")[0].split()[-1]), 8, delta=0.5)

    def test_swapped_sides(self):
        finding = self.assert_only_problem("sides", "--left", self.street / "image_1/%06d.png", "--right", self.street / "image_0/%06d.png",
                                           "--calib", self.street / "calib.txt")
        self.assertIn("swapped", finding["remedy"])

    def test_shifted_views_are_not_said_to_be_swapped(self):
        """By how much the right images are moved, the doffs_px that is given, and which checks find a problem."""
        for shift, doffs, checks, words in ((10, 0, ["sides", "range"], "the principal points differ"), (30, -30, ["sides", "range"], "its sign may be wrong"),
                                            (30, 30, ["range"], "give --min-disparity -3")):
            street = self.changed_street(lambda image: numpy.roll(image, shift, 1), ["image_1"])
            findings = self.examine(*self.patterns(street, self.calibrated(doffs_px=doffs)), code=2)
            with self.subTest(shift=shift, doffs=doffs):
                self.assertEqual([name for name, finding in findings.items() if finding["verdict"] == "problem"], checks, findings)
                self.assertIn(words, findings[checks[0]]["remedy"])

    def test_a_camera_that_is_off_in_some_frames(self):
        street = self.broken_street()
        for i in (1, 2):
            write_grey(street / f"image_1/{i:06d}.png", numpy.zeros((HEIGHT, WIDTH)))
        for frames, looked_at in ((":2", 3), (":", 4)):
            found = self.examine(street, *(["--frames", frames] if frames != ":" else []), code=2 if frames == ":2" else 0)
            self.assertIn("of nearly one tone", found["images"]["text"])
            self.assertNotIn("moments", found)
        self.assertIn("in 2 of 4 pairs that were looked at", found["images"]["text"])
        shutil.copy(street / "image_0/000003.png", street / "image_1/000003.png")
        said = self.said_by_run(street)
        self.assertIn("the right image is of one value in 2 frames", said)
        self.assertIn("the left and the right image are the same in 1 of 4 frames", said)
        self.assertNotIn("that of the frame before", said)

    def test_pairs_that_differ_from_each_other(self):
        swapped, loose = self.broken_street(), self.broken_street()
        for i, shift in enumerate((0, 4, -3, 2)):
            file = loose / f"image_1/{i:06d}.png"
            write_grey(file, numpy.roll(read_grey(file), shift, 0))
            for side in (0, 1):
                shutil.copy(self.street / f"image_{(side + i) % 2}/{i:06d}.png", swapped / f"image_{side}/{i:06d}.png")
        self.assertIn("in 2 of 4 pairs that were looked at", self.assert_only_problem("sides", swapped)["text"])
        self.assertIn("by another distance in each frame, from -3.0 to 4.0 px", self.assert_only_problem("rows", loose)["text"])

    def test_a_calibration_of_nothing_or_of_another_scale(self):
        f, cx, cy, _ = self.calibration()
        for changes, remedy in ((dict(fx=1e-30, fy=1e-30), ""), (dict(baseline_m=5e-324), ""), (dict(fx=2 * f, fy=2 * f, cx=2 * cx, cy=2 * cy), "scale")):
            with self.subTest(changes):
                self.assertIn(remedy, self.assert_only_problem("calibration", *self.patterns(calib=self.calibrated(**changes)))["remedy"])

    def test_a_range_that_clips_and_its_remedy(self):
        for least, too_few in ((0, 8), (-40, 45)):
            finding = self.assert_only_problem("range", self.street, "--min-disparity", least, "--disparities", too_few)
            enough = int(finding["remedy"].split()[-1])
            self.assertEqual(enough % 16, 0)
            self.assertNotEqual(self.examine(self.street, "--min-disparity", least, "--disparities", enough)["range"]["verdict"], "problem")
        finding = self.assert_only_problem("range", self.street, "--min-disparity", 4)
        self.examine(self.street, "--min-disparity", finding["remedy"].split()[-1])
        self.assertIn("faster", self.examine(self.street, "--disparities", 512)["range"]["remedy"])

    def test_gaps_in_time(self):
        street = self.broken_street()
        for times, *named in (("0 0.1 0.2 0.7", "0.5 s after frame 000002", "--frames :2 and --frames 3:"), ("0 0.1 0.05 0.15", "goes back"),
                              ("0 0.1 0.1 0.2", "frame 000002 has the time of the one before"), ("0 0.1", "times.txt: holds 2 times"), ("0 0.1 noon 0.3", ":3: 'noon'")):
            (street / "times.txt").write_text(times.replace(" ", "\n") + "\n")
            with self.subTest(times):
                finding = self.assert_only_problem("times", street)
                for words in named:
                    self.assertIn(words, finding["text"] + finding["remedy"])
        (street / "times.txt").write_text("2011-09-30 23:59:59.950\n2011-09-30 23:59:59.975\n2011-10-01 00:00:00.000\n2011-10-01 00:00:00.025\n")
        self.assertIn("0.025 s", self.examine(street)["times"]["text"])
        (street / "times.txt").unlink()
        (street.parent / "times.txt").write_text("0\n0.1\n")  # another one's
        self.assertEqual(self.examine(street)["times"]["verdict"], "note")

    def test_small_images_are_too_small_and_nothing_else(self):
        for height, width in ((5, 7), (8, 8), (24, 32), (62, 100), (70, 200)):
            street = self.changed_street(lambda image: image[20:20 + height, 100:100 + width])
            (street / "calib.txt").write_text(f"fx = {width}\nfy = {width}\ncx = {(width - 1) / 2}\ncy = {(height - 1) / 2}\nbaseline_m = 0.5\n")
            found = self.examine(street)
            self.assertIn("too small to find points in", found["images"]["text"])
            self.assertEqual((list(found), found["calibration"]["verdict"]), (["images", "calibration", "times"], "ok"))

    def test_turned_images_are_not_said_to_be_late(self):
        street = self.changed_street(numpy.rot90)
        found = self.examine(street, code=2)
        self.assertIn("turned by 90 degrees", found["calibration"]["text"])
        alone = self.examine(*self.patterns(street)[:4], code=2)
        for findings in (found, alone):
            self.assertEqual([name for name in ("rows", "sides", "range", "moments") if name in findings], ["rows"])
            self.assertIn("turned by 90 degrees: turn them back", findings["rows"]["remedy"])

    def test_images_of_other_moments(self):
        street = self.broken_street()
        for file in (street / "image_1").iterdir():
            write_grey(file, numpy.random.default_rng(int(file.stem)).integers(0, 255, (HEIGHT, WIDTH)))
        self.assert_only_problem("matches", street)

    def test_a_camera_that_stands_still_or_is_a_frame_late(self):
        frozen = self.broken_street()
        shutil.copy(frozen / "image_0/000001.png", frozen / "image_0/000002.png")
        self.assertIn("left image is that of the frame before in 1 of 3 steps", self.assert_only_problem("moments", frozen)["text"])
        said = self.assert_works("run", frozen, "--out", self.new_folder() / "out")
        self.assertIn("the left image is that of the frame before in 1 frame", said)
        shutil.copy(frozen / "image_1/000001.png", frozen / "image_1/000002.png")
        found = self.examine(frozen)
        self.assertEqual((found["moments"]["verdict"], found["rows"]["verdict"]), ("note", "ok"))
        self.assertIn("both images are those of the frame before in 1 of 3 steps", found["moments"]["text"])
        for late, side, lag, words in (("right", 0, 1, "a frame"), ("left", 1, 1, "a frame"), ("right", 0, 2, "2 frames")):
            street, frames = self.new_folder() / "street", FRAMES + lag
            self.assert_works("synth", "--out", street, "--frames", frames, "--width", WIDTH, "--height", HEIGHT, "--seed", 7)
            for i in range(frames):
                if i < lag:
                    (street / f"image_{side}/{i:06d}.png").unlink()
                    (street / f"image_{1 - side}/{frames - 1 - i:06d}.png").unlink()
                else:
                    (street / f"image_{side}/{i:06d}.png").rename(street / f"image_{side}/{i - lag:06d}.png")
            (street / "times.txt").unlink()
            self.assertIn(f"the {late} images are {words} late", self.assert_only_problem("moments", street)["text"])

    def test_an_image_that_came_twice_and_made_all_later_ones_late(self):
        street, frames = self.new_folder() / "street", 8
        self.assert_works("synth", "--out", street, "--frames", frames, "--width", WIDTH, "--height", HEIGHT, "--seed", 7)
        for i in range(frames - 1, 0, -1):
            shutil.copy(street / f"image_1/{i - 1:06d}.png", street / f"image_1/{i:06d}.png")
        self.assertIn("the right images are a frame late", self.assert_only_problem("moments", street)["text"])

    def test_a_camera_whose_images_are_in_reversed_order(self):
        street, frames = self.new_folder() / "street", 6
        self.assert_works("synth", "--out", street, "--frames", frames, "--width", WIDTH, "--height", HEIGHT, "--seed", 7)
        (street / "image_1").rename(street / "reversed")
        (street / "image_1").mkdir()
        for i in range(frames):
            (street / f"reversed/{i:06d}.png").rename(street / f"image_1/{frames - 1 - i:06d}.png")
        self.assertIn("in reversed order", self.assert_only_problem("moments", street)["text"])

    def test_a_right_image_that_is_the_left_one_moved(self):
        for shift in (9, -6):
            street = self.broken_street()
            for file in (street / "image_0").iterdir():
                write_grey(street / "image_1" / file.name, numpy.roll(read_grey(file), -shift, 1))
            self.assertIn(f"the left ones, moved by {shift} px", self.assert_only_problem("matches", street)["text"])

    def test_copies_that_differ(self):
        """By noise, or by a part of a pixel that one is moved by."""
        random = numpy.random.default_rng(1)
        y, x = numpy.mgrid[0:HEIGHT, 0:WIDTH]
        for shift, noise, verdict in ((0, 3, "problem"), (0.3, 0, "problem"), (3.5, 2, "note")):
            street = self.broken_street()
            for file in (street / "image_0").iterdir():
                write_grey(street / "image_1" / file.name, numpy.clip(sampled(read_grey(file), x + shift, y) + random.normal(0, noise, (HEIGHT, WIDTH)), 0, 255))
            found = self.examine(street, code=2 if verdict == "problem" else 0)
            self.assertEqual((found["depths"]["verdict"], found["rows"]["verdict"]), (verdict, "ok"))
            self.assertIn(f"one disparity, {shift:.1f}", found["depths"]["text"])

    def test_rows_of_two_moments(self):
        street = self.broken_street()
        for side in (0, 1):
            for i in range(FRAMES - 1):
                image = read_grey(self.street / f"image_{side}/{i:06d}.png").copy()
                image[1::2] = read_grey(self.street / f"image_{side}/{i + 1:06d}.png")[1::2]
                write_grey(street / f"image_{side}/{i:06d}.png", image)
        self.assertIn("interlaced", self.assert_only_problem("images", street)["text"])
        shutil.rmtree(street / "image_0")
        shutil.copytree(self.street / "image_0", street / "image_0")
        self.assertEqual(self.examine(street, code=2)["images"]["verdict"], "problem")
        brighter = 20 * (numpy.arange(HEIGHT) % 2)[:, None]  # as some sensors' rows are
        self.assertEqual(self.examine(self.changed_street(lambda image: numpy.clip(image + brighter, 0, 255)))["images"]["verdict"], "ok")

    def test_a_pair_that_cannot_be_read_costs_itself_alone(self):
        street = self.broken_street()
        (street / "image_1/000002.png").write_bytes((street / "image_1/000002.png").read_bytes()[:500])
        finding = self.assert_only_problem("files", street)
        self.assertIn("frame 000002", finding["text"])

    def test_names_that_are_times_are_the_times(self):
        for step, start in ((50_000_000, 1403636579763555584), (50_000, 1403636579763555)):
            folder = self.new_folder() / "named"
            for side, source in (("left", "image_0"), ("right", "image_1")):
                (folder / side).mkdir(parents=True)
                for i in range(FRAMES):
                    shutil.copy(self.street / source / f"{i:06d}.png", folder / side / f"{start + step * (i + 2 * (i > 1))}.png")
            shutil.copy(self.street / "calib.txt", folder / "calib.txt")
            finding = self.assert_only_problem("times", folder)
            self.assertIn("0.05 s between two frames", finding["text"])
            self.assertIn(f"0.15 s after frame {start + step}", finding["text"])

    def test_what_only_few_points_say_is_no_range(self):
        """Nearly all of the image is grey: what is left are a few points at the horizon."""
        def blank(image):
            image[:38], image[52:], image[:, :130], image[:, 190:] = 128, 128, 128, 128
            return image
        findings = self.examine(self.changed_street(blank), "--disparities", 4)
        self.assertEqual(findings["texture"]["verdict"], "note")
        self.assertNotIn("range", findings)

    def raw_rig(self, name, **changes):
        """A file of another program, of cameras whose images need no rectification but for `changes`."""
        f, cx, cy, baseline = self.calibration()
        matrix = [[f, 0, cx], [0, f, cy], [0, 0, 1]]
        file = self.new_folder() / name
        file.write_text(json.dumps({"K1": matrix, "D1": [0, 0, 0, 0], "K2": matrix, "D2": [0, 0, 0, 0], "R": numpy.eye(3).tolist(), "T": [-baseline, 0, 0], **changes}))
        return file

    def test_raw_images_are_rectified_by_their_calibration(self):
        patterns = self.patterns()[:4]
        self.assertEqual(self.examine(*patterns, "--calib", self.raw_rig("rig.json"))["calibration"]["verdict"], "ok")
        turned = self.raw_rig("turned.json", R=rotation((1, 0, 0), 1).tolist())  # which these cameras are not
        finding = self.assert_only_problem("rows", *patterns, "--calib", turned)
        self.assertGreater(abs(float(finding["text"].split()[2])), 2)
        lens = [-0.3, 0.1, 0.05, 0.08]  # of another order
        finding = self.examine(*patterns, "--calib", self.raw_rig("lens.json", D1=lens, D2=lens), code=2)["calibration"]
        self.assertIn("in the order k1, k2, p1, p2", finding["remedy"])
        self.assertIn("rectified here by", self.examine(*patterns, "--calib", turned, code=2)["images"]["text"])

    def test_a_calibration_may_be_a_file_for_each_camera(self):
        f, cx, cy, baseline = self.calibration()
        patterns = self.patterns()[:4]
        files = [self.new_folder() / name for name in ("a.yaml", "b.yaml")]  # of no names that tell the side
        for file, tx in zip(files, (0, -f * baseline)):
            camera = {"image_width": WIDTH, "image_height": HEIGHT, "k": [f, 0, cx, 0, f, cy, 0, 0, 1], "d": [0] * 5, "r": [1, 0, 0, 0, 1, 0, 0, 0, 1],
                      "p": [f, 0, cx, tx, 0, f, cy, 0, 0, 0, 1, 0]}
            file.write_text(json.dumps(camera))
        self.assertIn(f"baseline {baseline:.4g} m", self.examine(*patterns, "--calib", *files)["calibration"]["text"])
        self.assert_refused(["doctor", *patterns, "--calib", self.street / "calib.txt", files[1]], "calib.txt: is not the calibration of one camera")

    def test_a_wrong_sign_hides_nothing_else(self):
        street = self.shifted(2)
        findings = self.examine(*self.patterns(street, self.calibrated(baseline_m=-self.calibration()[3])), code=2)
        self.assertEqual([name for name, finding in findings.items() if finding["verdict"] == "problem"], ["calibration", "rows"])
        self.assertIn("exchange", findings["calibration"]["remedy"])

    def test_wrong_arguments(self):
        self.assert_all_refused((
            ("doctor {street} --samples 0", "--samples 0"), ("doctor {street} --disparities 0", "disparities"), ("doctor {never}", "{never}"),
            ("doctor --bag {never}", "{never}"), ("doctor {street} --bag {street}", "one input"), ("doctor {street} --left-topic /left", "--bag FILE")))


@unittest.skipUnless(DATA and pathlib.Path(DATA).is_dir(), "no real data")
class DoctorOnRealData(InputTest):
    def test_kitti_and_middlebury_are_sound(self):
        data = pathlib.Path(DATA)
        for arguments in (["--odometry", data / "odometry/sequences/A"], ["--kitti", data / "kitti2012/training", "--scene", "000151"],
                          ["--kitti", data / "kitti2015/training", "--scene", "000002"], [data / "middlebury/Motorcycle"]):
            findings = self.examine(*arguments)
            self.assertEqual(findings["rows"]["verdict"], "ok")
            self.assertEqual(findings["sides"]["verdict"], "ok")
