# SPDX-License-Identifier: Apache-2.0
"""examples/, and what the documents promise."""
import re
import subprocess

from program_case import EXAMPLES, SOURCE, ProgramTest


class ExampleTest(ProgramTest):
    def run_example(self, name, *arguments, **options):
        return subprocess.run([EXAMPLES / f"egosgm_example_{name}", *arguments], capture_output=True, text=True, timeout=900, **options)

    def assert_gives_what_the_program_gives(self, example, options=(), arguments=()):
        own = self.new_folder()
        done = self.run_example(example, self.street, *arguments, cwd=own)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assert_same_files(own, self.ran(self.street, *options) / "disparity", "*")


class Example(ExampleTest):
    def test_minimal_gives_what_the_program_gives(self):
        self.assert_gives_what_the_program_gives("minimal")

    def test_own_poses_gives_what_the_program_gives(self):
        poses = self.street / "poses.txt"
        self.assert_gives_what_the_program_gives("own_poses", ["--poses", poses], [poses])

    def test_the_page_shows_it(self):
        shown = (SOURCE / "docs/use/cpp.md").read_text().split("```cpp\n")[1].split("```")[0]
        self.assertEqual(shown, re.sub("^//.*\n", "", (SOURCE / "examples/minimal.cpp").read_text(), flags=re.MULTILINE))

    def test_the_comparison_names_tests_that_exist(self):
        claims = (SOURCE / "docs/understand/comparison.md").read_text().split("## Each claim")[1]
        sources = "".join(file.read_text() for folder in ("tests", "bench") for kind in ("*.cpp", "*.py") for file in (SOURCE / folder).rglob(kind))
        named = [name for name in re.findall("`([A-Za-z_0-9.]+)`", claims) if "test_" in name or "." in name]
        self.assertGreater(len(named), 20)
        for name in named:
            suite, _, test = name.rpartition(".")
            if test.startswith("test_"):
                self.assertIn(f"def {test}(", sources)
            else:
                self.assertRegex(sources, rf"TEST(_F|_P)?\({suite}, {test}\)")


class ExampleWithOpenCv(ExampleTest):
    def test_opencv_types_gives_a_pair_in_kittis_format(self):
        out = self.new_folder()
        left, right = (self.street / f"image_{side}/000000.png" for side in (0, 1))
        done = self.run_example("opencv_types", left, right, out / "steps.png")
        self.assertEqual(done.returncode, 0, done.stderr)
        single = self.ran(self.street, "--frames", "0", "--temporal", "off") / "disparity/000000.png"
        steps, own = (self.json_of("eval", file, self.street / "truth/left_disp_noc/000000.png")["pooled"] for file in (out / "steps.png", single))
        self.assertAlmostEqual(steps["bad_of_valid"], own["bad_of_valid"], delta=1)
        self.assertGreater(steps["density"], 90)  # the sky's disparity rounds to no step
        self.assertNotEqual(self.run_example("opencv_types", left, self.street / "calib.txt", out / "no.png").returncode, 0)
