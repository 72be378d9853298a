# SPDX-License-Identifier: Apache-2.0
"""Tests whose tool is missing are in ctest's list and reported as skipped. EGOSGM_CMAKE and EGOSGM_CTEST name the two programs."""
import os
import pathlib
import subprocess
import tempfile
import unittest

SOURCE = pathlib.Path(__file__).resolve().parents[1]
WITHOUT = ("EGOSGM_CLANG", "EGOSGM_OCLGRIND", "EGOSGM_DOXYGEN", "EGOSGM_PYTHON", "EGOSGM_BENCH")
EXPECTED = ("kernels.lint", "kernels.fpga", "egosgm.races.0", "egosgm.races.1", "egosgm.races.2", "docs.api")
WITH_OPENCV = ("ImageIo", "Matcher", "Video", "OpenCv", "StereoOdometry", "fuzz.png", "program.ExampleWithOpenCv", "program.Camera")


class Skipped(unittest.TestCase):
    def test_without_their_tools(self):
        vision = os.environ["EGOSGM_HAS_VISION"]
        expected = EXPECTED + (WITH_OPENCV if vision == "ON" else ())
        with tempfile.TemporaryDirectory(prefix="egosgm_skipped_") as build:
            subprocess.run([os.environ["EGOSGM_CMAKE"], "-S", SOURCE, "-B", build, *(f"-D{name}=OFF" for name in WITHOUT),
                            f"-DEGOSGM_VISION={vision}", "-DCMAKE_DISABLE_FIND_PACKAGE_OpenCV=ON"], check=True,
                           capture_output=True)
            names = "|".join(expected).replace(".", r"\.")
            done = subprocess.run([os.environ["EGOSGM_CTEST"], "--test-dir", build, "-R", f"^({names})$"], capture_output=True, text=True)
        for name in expected:
            self.assertRegex(done.stdout, rf"{name} \.+\*\*\*Skipped")
