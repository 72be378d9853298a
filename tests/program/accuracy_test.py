# SPDX-License-Identifier: Apache-2.0
"""How good the maps and the odometry of egosgm run are, on synthetic and on real data."""
import pathlib
import unittest

from program_case import DATA, ProgramTest


class Accuracy(ProgramTest):
    def of_later_frames(self, street, temporal, *arguments):
        """The pooled figures from frame 3 on, and the largest share of the cells that a frame of them searched."""
        out = self.ran(street, "--poses", street / "poses.txt", "--temporal", temporal, *arguments)
        for i in range(3):
            (out / f"disparity/00000{i}.png").unlink()
        result = self.json_of("eval", out, street / "truth/left_disp_noc")
        frames = self.report(out)["frames"][3:]
        self.assertEqual(len(result["pairs"]), len(frames))
        self.assertEqual(len(result["without_estimate"]), 3)
        return result["pooled"], max(frame["search_fraction"] for frame in frames)

    def test_synthetic_sequence_with_true_poses(self):
        street = self.new_folder()
        self.assert_works("synth", "--out", street, "--frames", 20, "--quiet")
        method, search = self.of_later_frames(street, "on")
        single, _ = self.of_later_frames(street, "off")
        self.assertLessEqual(method["bad_or_missing"], 2.0)
        self.assertLessEqual(method["bad_or_missing"], 1.5 * single["bad_or_missing"])  # the matcher alone does well here
        self.assertLess(search, 0.25)

    def test_beats_the_single_frame_where_images_are_noisy(self):
        names = ("bad_or_missing", "interpolated", "bad_of_valid", "density")
        sums = {way: dict.fromkeys(names, 0.0) for way in ("on", "off")}
        for seed in (3, 4, 5):
            street = self.new_folder()
            self.assert_works("synth", "--out", street, "--frames", 8, "--width", 320, "--height", 120, "--seed", seed, "--noise", 12, "--quiet")
            for way, of_way in sums.items():
                figures, search = self.of_later_frames(street, way, "--disparities", 64)
                for name in names:
                    of_way[name] += figures[name]
                if way == "on":
                    self.assertLess(search, 0.6)
        method, single = sums["on"], sums["off"]
        self.assertLess(method["bad_or_missing"], 0.6 * single["bad_or_missing"])
        self.assertLess(method["interpolated"], 0.75 * single["interpolated"])
        self.assertLess(method["bad_of_valid"], single["bad_of_valid"])  # which leaves out what is not sure
        self.assertGreater(method["density"], single["density"])

    def test_odometry_of_a_synthetic_sequence(self):
        street, poses = self.new_folder(), self.new_folder() / "poses.txt"
        self.assert_works("synth", "--out", street, "--frames", 8, "--quiet")
        self.assert_works("odometry", street, "--out", poses)
        drift = self.json_of("eval-poses", "--estimate", poses, "--truth", street / "poses.txt")
        self.assertEqual(drift["frames"], 8)
        self.assertEqual(len(drift["motions"]), 7)
        self.assertLess(drift["end_drift_percent"], 0.5)
        folder = self.new_folder()
        self.assert_works("eval-poses", "--estimate", poses, "--truth", street / "poses.txt", "--plot", folder / "path.svg", "--plot",
                          folder / "path.png")
        self.assertIn("<svg", (folder / "path.svg").read_text())
        self.assertTrue((folder / "path.png").read_bytes().startswith(b"\x89PNG"))

    def test_bounds_on_the_motion(self):
        told = self.assert_works("odometry", self.street, "--out", self.new_folder() / "poses.txt", "--max-translation", 0.5)
        self.assertIn("exceeds the bound of 0.50 m", told)


@unittest.skipUnless(pathlib.Path(DATA, "README.md").is_file(), f"no real data: EGOSGM_DATA is '{DATA}'")
class RealData(ProgramTest):
    data = pathlib.Path(DATA)

    def test_kitti_2012_beats_the_single_frame(self):
        training = self.data / "kitti2012/training"
        figures = {}
        for temporal in ("on", "off"):
            out = self.ran("--kitti", training, "--scene", "000151", "--frames", "7:10", "--temporal", temporal)
            figures[temporal] = self.json_of("eval", out / "disparity/000010.png", training / "disp_noc/000151_10.png")["pooled"]
            if temporal == "on":
                self.assertLessEqual(self.report(out)["frames"][-1]["search_fraction"], 0.16)
        self.assertLessEqual(figures["on"]["bad_or_missing"], 5.0)
        self.assertLessEqual(figures["on"]["interpolated"], 4.0)
        self.assertLessEqual(figures["off"]["bad_or_missing"], 11.0)
        self.assertLess(figures["on"]["interpolated"], figures["off"]["interpolated"])

    def test_kitti_2015_in_colour(self):
        self.assertEqual(self.assert_whole(self.ran("--kitti", self.data / "kitti2015/training", "--scene", "2", "--frames", "10:11")), 2)

    def test_middlebury_has_an_offset(self):
        self.assertGreater(self.report(self.ran("--dataset", self.data / "middlebury/Motorcycle"))["calibration"]["doffs_px"], 1)
