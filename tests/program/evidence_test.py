# SPDX-License-Identifier: Apache-2.0
"""bench/accuracy --evidence, on data of its own."""
import json
import shutil
import subprocess
import sys
import unittest

import numpy as np
from program_case import FRAMES, HAS_PACKAGE, HEIGHT, PROGRAM, SOURCE, WIDTH, ProgramTest


@unittest.skipUnless(HAS_PACKAGE, "built without the Python package")
class Evidence(ProgramTest):
    @classmethod
    def setUpClass(cls):
        """A street as "sky" and as "poles": nothing in the upper half of the truth, 10 px below, and a pole of each width."""
        super().setUpClass()
        cls.truth = np.full((HEIGHT, WIDTH), 10, np.float32)
        cls.truth[:HEIGHT // 2] = 0
        ids = np.zeros((HEIGHT, WIDTH), np.int16)
        ids[60:, 40:240] = 1 + np.arange(200) // 40
        for name in ("sky", "poles"):
            folder = cls.folder / "data/evidence" / name
            shutil.copytree(cls.street, folder)
            shutil.rmtree(folder / "truth")
            np.savez(folder / "truth.npz", *[cls.truth] * FRAMES)
        np.savez(cls.folder / "data/evidence/poles/ids.npz", *[ids] * FRAMES)
        cls.work = cls.folder / "work"
        done = subprocess.run([sys.executable, "-B", SOURCE / "bench/accuracy", "--evidence", "--egosgm", PROGRAM, "--only", "^sky$|^poles$|^fence$|web25",
                               "--data", cls.folder / "data", "--work", cls.work, "--json", cls.folder / "evidence.json"], capture_output=True, text=True)
        cls.code, cls.said = done.returncode, done.stderr
        cls.found = json.loads((cls.folder / "evidence.json").read_text())["evidence"]

    def measured(self, *arguments):
        return subprocess.run([sys.executable, "-B", SOURCE / "bench/accuracy", "--egosgm", PROGRAM, "--data", self.folder / "data", "--work", self.work, *arguments],
                              capture_output=True, text=True)

    def row(self, table, title):
        return next(row for row in self.found[table]["rows"] if row[0] == title)

    def evaluated(self, folder, *arguments):
        """Of the last frame."""
        frames = f"{FRAMES - 1}:{FRAMES - 1}"
        said = self.assert_works("eval-video", "--estimate", self.work / "evidence" / folder, "--truth", self.work / "evidence/truth_sky", "--frames", frames, *arguments, "--json")
        return json.loads(said)

    def test_what_is_missing_is_skipped(self):
        self.assertEqual(self.code, 3, self.said)
        self.assertIn("fence is not there", self.row("places", "fence")[1])
        self.assertIn("web25 is not there", self.row("repeated", "web25, first pair")[1])

    def test_what_fails_or_measures_nothing_is_no_success(self):
        broken = self.folder / "data/evidence/corridor"
        shutil.copytree(self.folder / "data/evidence/sky", broken)
        (broken / "calib.txt").write_text("none")
        for arguments, code, said in ((("--evidence", "--only", "^corridor$"), 1, "calib.txt"), (("--evidence", "--only", "no place"), 1, "nothing was measured"),
                                      (("--no-speed", "--only", "no group"), 1, "nothing was measured"), (("--ablation", "--inputs", "no input"), 1, "nothing was measured"),
                                      (("--ablation", "--inputs", "^2012"), 3, "2 rows skipped")):
            done = self.measured(*arguments)
            self.assertEqual(done.returncode, code, done.stderr)
            self.assertIn(said, done.stdout + done.stderr)

    def test_a_place_has_the_figures_of_eval(self):
        row = dict(zip(self.found["places"]["headings"], self.row("places", "sky")))
        video, single = self.evaluated("sky", "--against", self.work / "evidence/sky_temporal_off"), self.evaluated("sky_temporal_off")
        for name, heading in (("filled", "filled"), ("bad_of_valid", "bad of valid"), ("wrong_of_all", "wrong of all")):
            self.assertEqual(row[f"{heading}, last frame"], video["regions"]["all"][name])
            self.assertEqual(row[f"{heading}, single frame"], single["regions"]["all"][name])
        for name, heading in (("gained", "gained"), ("gained_right", "gained, right"), ("lost_right", "lost, right"), ("wrong_of_trusted", "wrong of trusted"),
                              ("trusted_of_wrong", "trusted of wrong")):
            self.assertEqual(row[heading], video["figures"][f"{name}_percent"], heading)
        self.assertEqual(row["bad of valid / single frame's"], row["bad of valid, last frame"] / row["bad of valid, single frame"])
        self.assertNotEqual(row["filled, first frame"], row["filled, last frame"])

    def test_a_truth_of_0_is_the_sky(self):
        sky = self.evaluated("sky")["regions"]["sky"]
        self.assertEqual(sky["truth_pixels"], WIDTH * HEIGHT // 2)
        self.assertGreater(sky["bad_of_valid"], 50)

    def test_the_last_row_is_the_median(self):
        *rows, last = self.found["places"]["rows"]
        self.assertEqual(last[0], "median of the ratios")
        self.assertAlmostEqual(last[-1], sum(row[-1] for row in rows if len(row) > 2) / 2)

    def test_a_pair_ten_times(self):
        _, filled, filled_again, bad, bad_again = self.row("repeated", "sky, first pair")
        frames = sorted((self.work / "evidence/repeated_sky/left").iterdir())
        self.assertEqual({frame.resolve() for frame in frames}, {(self.folder / "data/evidence/sky/image_0/000000.png").resolve()})
        self.assertEqual(len(frames), 10)
        for value in (filled, filled_again, bad, bad_again):
            self.assertTrue(0 < value <= 100, value)

    def test_poles_by_width(self):
        rows = self.found["poles"]["rows"]
        if "skipped" in str(rows[0][1]):
            self.skipTest(rows[0][1])
        self.assertEqual([row[0] for row in rows], ["3 px", "4 px", "6 px", "8 px", "14 px"])
        for _, video, single in rows:
            self.assertTrue(0 <= video <= 100 and 0 <= single <= 100)
