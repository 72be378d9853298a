# SPDX-License-Identifier: Apache-2.0
"""Tests whose tool is missing are in ctest's list and reported as skipped. EGOSGM_CMAKE and EGOSGM_CTEST name the two programs."""
import os
import pathlib
import subprocess
import tempfile
import unittest

SOURCE = pathlib.Path(__file__).resolve().parents[1]
WITHOUT = ("EGOSGM_CLANG", "EGOSGM_OCLGRIND", "EGOSGM_DOXYGEN", "EGOSGM_VISION", "EGOSGM_PYTHON", "EGOSGM_BENCH")
EXPECTED = ("kernels.lint", "kernels.fpga", "egosgm.races.0", "egosgm.races.1", "egosgm.races.2", "docs.api")


class Skipped(unittest.TestCase):
    def test_without_their_tools(self):
        with tempfile.TemporaryDirectory(prefix="egosgm_skipped_") as build:
            subprocess.run([os.environ["EGOSGM_CMAKE"], "-S", SOURCE, "-B", build, *(f"-D{name}=OFF" for name in WITHOUT)], check=True,
                           capture_output=True)
            names = "|".join(EXPECTED).replace(".", r"\.")
            done = subprocess.run([os.environ["EGOSGM_CTEST"], "--test-dir", build, "-R", f"^({names})$"], capture_output=True, text=True)
        for name in EXPECTED:
            self.assertRegex(done.stdout, rf"{name} \.+\*\*\*Skipped")
