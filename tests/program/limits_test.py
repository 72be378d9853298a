# SPDX-License-Identifier: Apache-2.0
"""egosgm run on devices that allow little, which PoCL can play."""
import os
import re

from program_case import ProgramTest, egosgm, grey_png


class Limits(ProgramTest):
    def run_with(self, *arguments, **environment):
        return self.ran(self.street, *arguments, env=dict(os.environ, **environment))

    def test_small_work_groups_give_the_same_bits(self):
        for scheduling in ("wavefront", "paths"):
            arguments = ("--frames", ":1", "--disparities", 32, "--set", f"constants.banded_sgm.scheduling={scheduling}")
            expected = self.run_with(*arguments)
            for size in ("1", "6"):
                with self.subTest(scheduling=scheduling, size=size):
                    self.assert_same_files(self.run_with(*arguments, POCL_MAX_WORK_GROUP_SIZE=size), expected, "disparity/*")

    def test_one_compute_unit_gives_the_same_bits(self):
        one = {"POCL_MAX_PTHREAD_COUNT": "1", "POCL_CPU_MAX_CU_COUNT": "1"}  # PoCL's name before version 5, and after it
        self.assert_same_files(self.run_with("--frames", ":1", **one), self.run_with("--frames", ":1"), "disparity/*")

    def test_a_range_that_does_not_fit_is_matched_in_stripes(self):
        folder = self.new_folder()
        for side in ("left", "right"):
            (folder / f"{side}.png").write_bytes(grey_png(640, 400))
        (folder / "calib.toml").write_text("fx = 400\nfy = 400\ncx = 320\ncy = 200\nbaseline_m = 0.5\n")
        pair = ["--left", folder / "left.png", "--right", folder / "right.png", "--calib", folder / "calib.toml"]
        gigabyte = dict(os.environ, POCL_MEMORY_LIMIT="1")
        told = self.assert_works("run", *pair, "--disparities", 4096, "--out", folder / "whole")
        self.assertIn(f"{self.report(folder / 'whole')['device_memory_bytes'] >> 20} MiB of the device are in use; --set max_memory_mib=N", told)
        self.assertNotIn("MiB of the device", self.assert_works("run", *pair, "--disparities", 2048, "--out", folder / "stripes", env=gigabyte))
        report = self.report(folder / "stripes")
        self.assertGreater(report["frames"][0]["stripes"], 1)
        self.assertLess(report["device_memory_bytes"], 1 << 30)
        # One that just fits, and leaves less than what is left to all else.
        report = self.report(self.ran(*pair, "--disparities", 352, "--set", "constants.banded_sgm.scheduling=paths", env=gigabyte))
        self.assertEqual(report["frames"][0]["stripes"], 1)
        self.assertGreater(report["device_memory_bytes"], 3 << 28)
        run = ["run", *pair, "--disparities", 64, "--out", self.folder / "never", "--set", "max_memory_mib=3"]
        self.assert_refused(run, "BandedSgm: a stripe of 96 rows needs", " MiB, max_memory_mib allows 3 MiB: raise it to", "fewer disparities")
        least = int(re.search(r"raise it to (\d+) or more", egosgm(*run).stderr)[1])
        self.ran(*pair, "--disparities", 64, "--set", f"max_memory_mib={least}")
        for name in ("a.png", "b.png"):
            (folder / name).write_bytes(grey_png(4096, 3000))
        self.assert_refused(["run", folder / "a.png", folder / "b.png", "--out", self.new_folder() / "out"],
                            "three quarters of the device are 768 MiB, of which maps of 4096x3000 leave 0 MiB", "a smaller image", code=1, env=gigabyte)

    def test_stripes_are_almost_as_good(self):
        street, bad = self.new_folder(), {}
        self.assert_works("synth", "--out", street, "--frames", 3, "--width", 320, "--height", 240, "--seed", 7, "--quiet")
        for name, arguments in (("whole", []), ("stripes", ["--set", "max_memory_mib=8"])):
            out = self.ran(street, "--disparities", 64, *arguments)
            self.assertTrue(all((frame["stripes"] > 1) == (name == "stripes") for frame in self.report(out)["frames"]))
            bad[name] = self.json_of("eval", out, street / "truth/left_disp_noc")["pooled"]["bad_or_missing"]
        self.assertLess(abs(bad["stripes"] - bad["whole"]), 1, bad)
