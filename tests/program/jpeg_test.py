# SPDX-License-Identifier: Apache-2.0
"""Sequences of JPEG images: the commands that read images take them as they take PNGs."""
import base64
import json
import re
import shutil

from program_case import FRAMES, ProgramTest


class Jpeg(ProgramTest):
    """The street as JPEGs, in the layout of KITTI odometry; a report of a run holds its left images as such."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.jpegs = cls.folder / "jpegs"
        for side in ("image_0", "image_1"):
            cls.write_jpegs(side)
        shutil.copy(cls.street / "calib.txt", cls.jpegs)

    @classmethod
    def write_jpegs(cls, side):
        shown, out = cls.folder / f"shown_{side}", cls.folder / f"out_{side}"
        for name in ("image_0", "image_1"):
            shutil.copytree(cls.street / side, shown / name)
        shutil.copy(cls.street / "calib.txt", shown)
        test = cls("id")
        test.assert_works("run", shown, "--out", out, "--quiet", "--disparities", 16)
        test.assert_works("report", out)
        page = (out / "report.html").read_text()
        pictures = json.loads(re.search(r'id="data"[^>]*>(.*?)</script>', page, re.DOTALL).group(1))["pictures"]
        (cls.jpegs / side).mkdir(parents=True)
        for picture in pictures:
            image = next(layer["picture"] for layer in picture["layers"] if layer["name"] == "left image")
            kind, content = image.split(";base64,")
            test.assertEqual(kind, "data:image/jpeg")
            (cls.jpegs / side / f"{picture['name']}.jpg").write_bytes(base64.b64decode(content, validate=True))
        test.assertEqual(len(list((cls.jpegs / side).iterdir())), FRAMES)

    def errors(self, *input):
        """Percent bad or missing of a run."""
        out = self.new_folder() / "out"
        self.assert_works("run", *input, "--out", out, "--quiet", "--disparities", 64)
        self.assertEqual(len(list((out / "disparity").iterdir())), FRAMES)
        return json.loads(self.assert_works("eval", out, self.street / "truth/left_disp_noc", "--json"))["pooled"]["bad_or_missing"]

    def test_run_and_eval_give_what_they_give_of_pngs(self):
        of_pngs = self.errors(self.street)
        patterns = ["--left", self.jpegs / "image_0/*.jpg", "--right", self.jpegs / "image_1/%06d.jpg", "--calib", self.jpegs / "calib.txt"]
        for input in ([self.jpegs], patterns):
            self.assertAlmostEqual(self.errors(*input), of_pngs, delta=1)

    def test_eval_finds_the_motion_in_them(self):
        truth = self.street / "truth/left_disp_noc"
        of_pngs, of_jpegs = (json.loads(self.assert_works("eval-video", truth, truth, "--sequence", sequence, "--json"))
                             for sequence in (self.street, self.jpegs))
        self.assertEqual(of_jpegs["motion"], "odometry")
        one, other = (video["figures"]["tae_vda_percent"] for video in (of_pngs, of_jpegs))
        self.assertAlmostEqual(one, other, delta=0.1 * one)
        self.assertNotEqual(one, other)

    def test_doctor_finds_nothing_wrong(self):
        findings = {finding["check"]: finding for finding in json.loads(self.assert_works("doctor", self.jpegs, "--json"))}
        self.assertTrue(findings["images"]["text"].startswith(f"{FRAMES} pairs of "), findings)
        self.assertEqual(findings["rows"]["verdict"], "ok")

    def test_one_that_is_cut_off_is_named(self):
        broken = self.new_folder() / "broken"
        shutil.copytree(self.jpegs, broken)
        file = broken / "image_1/000001.jpg"
        file.write_bytes(file.read_bytes()[:-200])
        self.assertIn(str(file), self.assert_works("run", broken, "--out", broken.parent / "out"))
        self.assert_refused(["odometry", broken, "--out", broken.parent / "poses.txt"], file)
