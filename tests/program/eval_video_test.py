# SPDX-License-Identifier: Apache-2.0
"""egosgm eval-video."""
import shutil
import struct

from program_case import FRAMES, HEIGHT, WIDTH, ProgramTest, grey_png, png


def constant_png(value, width=WIDTH, height=HEIGHT):
    """KITTI's disparity PNG with one value [px] everywhere."""
    return png(width, height, 16, [struct.pack(">H", round(256 * value)) * width] * height)


class EvalOverTime(ProgramTest):
    def evaluate(self, *arguments):
        return self.json_of("eval-video", *arguments)

    def maps(self, values, write=constant_png, suffix="png"):
        folder = self.new_folder()
        for i, value in enumerate(values):
            (folder / f"{i:06}.{suffix}").write_bytes(write(value))
        return folder

    def test_the_truth_itself_is_calm(self):
        video = self.evaluate("--estimate", self.street / "truth/left_disp_occ", "--sequence", self.street)
        self.assertEqual((video["frames"], video["pairs"]), (FRAMES, FRAMES - 1))
        self.assertEqual(video["motion"], f"poses {self.street / 'poses.txt'}")
        figures = video["figures"]
        for name in ("tepe_dynamicstereo_px", "tepe_codd_px", "tepe_dynamicstereo_above_1px_percent"):
            self.assertEqual(figures[name], 0, name)
        self.assertLess(figures["flicker_px"], 0.3)
        self.assertIsNone(figures["harm_percent"])
        self.assertEqual(len(video["over_frames"]), FRAMES)
        self.assertIsNone(video["over_frames"][0]["flicker_px"])
        self.assertIn("uncovered", video["regions"])

    def test_odometry_takes_the_place_of_poses(self):
        street = self.broken_street()
        (street / "poses.txt").unlink()
        arguments = ("--estimate", self.street / "truth/left_disp_occ", "--sequence")
        found, given = self.evaluate(*arguments, street), self.evaluate(*arguments, self.street)
        self.assertEqual(found["motion"], "odometry")
        self.assertAlmostEqual(found["figures"]["flicker_px"], given["figures"]["flicker_px"], delta=0.1)
        again = self.evaluate(*arguments, street, "--poses", self.street / "poses.txt")
        self.assertEqual(again["figures"], given["figures"])

    def test_one_truth_file_leaves_the_other_frames_in_the_video(self):
        maps, truth = self.street / "truth/left_disp_occ", self.street / "truth/left_disp_noc/000002.png"
        result = self.evaluate("--estimate", maps, "--truth", truth, "--sequence", self.street)
        self.assertEqual((result["frames"], result["regions"]["all"]["truth_pixels"]), (FRAMES, self.evaluate(truth, truth)["regions"]["all"]["truth_pixels"]))
        self.assertEqual(self.evaluate("--estimate", maps, "--truth", truth)["frames"], 1)

    def test_two_folders_are_enough_for_a_jump(self):
        estimate, truth = self.maps([10, 12, 10.5]), self.maps([10, 10, 10])
        result = self.evaluate(estimate, truth)
        figures = result["figures"]
        self.assertEqual(figures["tepe_dynamicstereo_px"], 1.75)
        self.assertEqual(figures["tepe_dynamicstereo_above_1px_percent"], 100)
        self.assertEqual([frame["tepe_dynamicstereo_px"] for frame in result["over_frames"]], [None, 2, 1.5])
        self.assertEqual(self.evaluate(estimate, truth, "--frames", "1:2")["figures"]["tepe_dynamicstereo_px"], 1.5)
        table = self.assert_works("eval-video", estimate, truth)
        self.assertIn("2 pairs of frames", table)
        self.assertRegex(table, r"tepe_dynamicstereo_px +1\.7500")

    def test_a_gap_is_no_pair(self):
        estimate, truth = self.maps([10, 12, 30, 11]), self.maps([10, 10, 10, 10])
        (estimate / "000002.png").unlink()
        figures = self.evaluate(estimate, truth)
        self.assertEqual((figures["frames"], figures["pairs"]), (3, 1))
        self.assertEqual(figures["figures"]["tepe_dynamicstereo_px"], 2)

    def test_names_without_zeros_are_in_the_order_of_their_numbers(self):
        figures = []
        for digits in (6, 1):
            street = self.broken_street()
            (street / "poses.txt").unlink()
            maps = self.new_folder()
            for i, file in enumerate(sorted((street / "truth/left_disp_occ").iterdir())):
                shutil.copy(file, maps / f"{i + 8:0{digits}}.png")
            shutil.rmtree(street / "truth")
            for image in sorted(street.glob("image_*/*.png"), reverse=True):
                image.rename(image.with_stem(f"{int(image.stem) + 8:0{digits}}"))
            video = self.evaluate(maps, "--sequence", street)
            self.assertEqual((video["pairs"], video["motion"]), (FRAMES - 1, "odometry"))
            figures.append(video["figures"])
        self.assertEqual(figures[0], figures[1])

    def test_pictures_that_are_no_video_have_their_regions(self):
        folder = self.new_folder()
        for name in ("000000_10", "000001_10"):
            (folder / f"{name}.png").write_bytes(constant_png(9))
        table = self.assert_works("eval-video", folder, folder)
        self.assertIn("2 frames, 0 pairs of frames", table)
        self.assertRegex(table, r"\nall +\d+ ")

    def test_against_counts_what_was_gained_and_lost(self):
        estimate, against, truth = self.maps([10, 0, 14]), self.maps([0, 10, 10]), self.maps([10, 10, 10])
        figures = self.evaluate(estimate, truth, "--against", against)["figures"]
        for name, value in {"gained_percent": 100 / 3, "gained_right_percent": 100, "lost_right_percent": 200 / 3}.items():
            self.assertAlmostEqual(figures[name], value, msg=name)
        self.assertRegex(self.assert_works("eval-video", estimate, truth, "--against", against), r"lost_right_percent +66\.6667")

    def test_reasons_of_a_run_tell_what_was_trusted(self):
        out, truth = self.ran(self.street, "--write", "reason"), self.street / "truth/left_disp_noc"
        figures = self.evaluate(out, truth)["figures"]
        self.assertLess(figures["wrong_of_trusted_percent"], 5)
        self.assertEqual(self.evaluate(out / "disparity", truth)["figures"], figures)
        self.assertIn("wrong_of_trusted_percent", self.assert_works("eval-video", out / "disparity/000001.png", truth / "000001.png"))
        (out / "report.json").unlink()
        self.assertIsNone(self.evaluate(out / "disparity", truth)["figures"]["wrong_of_trusted_percent"])

    def test_formats_of_others(self):
        def npy(value):
            header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': ({HEIGHT}, {WIDTH}), }}".ljust(117) + "\n"
            return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + struct.pack("<f", value) * (WIDTH * HEIGHT)
        truth = self.maps([8, 8])
        for folder, scale in ((self.maps([8.5, 9], npy, "npy"), ()), (self.maps([4.25, 4.5]), ("--scale", 128))):
            figures = self.evaluate(folder, truth, *scale)["figures"]
            self.assertEqual(figures["tepe_dynamicstereo_px"], 0.5)

    def test_variance_and_confidence_are_opposite_orders(self):
        out, truth = self.ran(self.street, "--write", "variance"), self.street / "truth/left_disp_noc"
        result = self.evaluate(out, truth, "--variance", out)
        wrong_way = self.evaluate(out, truth, "--confidence", out / "variance")
        self.assertGreater(wrong_way["figures"]["ause_px"], 2 * result["figures"]["ause_px"])
        at = result["density"]["at_density"]
        self.assertEqual([entry["density_percent"] for entry in at], list(range(50, 101, 5)))
        self.assertLessEqual(at[0]["bad_percent"], at[-1]["bad_percent"])
        self.assertEqual(len(result["density"]["sparsification"]), 50)
        last = result["density"]["sparsification"][-1]
        self.assertEqual(last["bad_percent"], last["oracle_bad_percent"])

    def test_plots(self):
        estimate, truth = self.maps([10, 12, 10.5]), self.maps([10, 10, 10])
        out = self.new_folder()
        self.assert_works("eval-video", estimate, truth, "--plot-frames", out / "frames.svg", "--variance", estimate, "--plot-density", out / "density.png")
        self.assertIn("is a run compared with itself?", self.assert_works("eval-video", estimate, truth, "--against", estimate))
        self.assertNotIn("is a run compared", self.assert_works("eval-video", estimate, truth, "--against", truth))
        self.assertIn("TEPE same pixel", (out / "frames.svg").read_text())
        self.assertTrue((out / "density.png").read_bytes().startswith(b"\x89PNG"))

    def test_wrong_input_gives_one_line_and_no_table(self):
        truth, same, empty, other, small, plain = f"{self.street}/truth/left_disp_occ", self.maps([10, 10, 10]), *(self.new_folder() / "d" for _ in range(4))
        for folder in (empty, other, small):
            folder.mkdir()
        shutil.copytree(self.street, plain, ignore=shutil.ignore_patterns("truth"))
        for name in ("000001.png", "000077.png"):
            shutil.copy(f"{truth}/000001.png", other / name)
        (small / "000001.png").write_bytes(grey_png(20, 10, depth=16))
        broken = self.maps([1, 1, 1, 1])
        (broken / "000003.png").write_bytes(constant_png(1)[:100])
        self.assert_all_refused((
            (f"--estimate {truth}", "no truth"), (f"{truth} {truth} --poses {{street}}/poses.txt", "--sequence"),
            (f"{truth} {truth} --variance {truth} --confidence {truth}", "give one of them"), (f"{truth} {truth} --against {empty}", "holds no"),
            (f"{truth} {truth} --variance {{street}}", "the truth of a sequence"),
            (f"{truth} {truth} --scale 0", "positive"), (f"{other} --sequence {{street}}", "000077.png", "no frame of this number"),
            (f"{truth} {truth} --against {small}", "000001.png", "20x10", "320x96"), (f"{broken} {truth}", "000003.png"),
            (f"{truth} {truth} --flow {truth}", "000000.png", "optical flow"), (f"{same} {same} --plot-frames {{never}}.gif", "--plot-frames", ".svg"),
            (f"{same} {same} --plot-frames {{never}}.svg --variance {same} --plot-density {{never}}.svg", "are one file"),
            (f"{same} {same} --plot-density {{never}}.svg", "--plot-density", "belongs to --variance or --confidence"),
            (f"{same} {same} --next-truth {same}", "--next-truth", "belongs to --flow"),
            (f"{same} --sequence {plain} --mask {same}", "--mask", "belongs to --truth")), ["eval-video"])
        self.assertFalse((self.folder / "never.svg").exists())
