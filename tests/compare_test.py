# SPDX-License-Identifier: Apache-2.0
"""egosgm_compare, which is named first: that it runs, and that the threads that it tells of are those at work."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv.pop(1)
OPENCV = {"opencv_hh", "opencv_hh4", "opencv_sgbm", "opencv_3way"}


class Compare(unittest.TestCase):
    def rows(self, threads):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "compare.json"
            done = subprocess.run([PROGRAM, "--size", "320x96", "--disparities", "32", "--rounds", "1", "--threads", str(threads), "--json", file],
                                  capture_output=True, text=True, timeout=900)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn(f"\n{threads} threads allowed\n", done.stdout)
            found = json.loads(file.read_text())
        self.assertEqual(found["threads"], threads)
        for row in found["rows"]:
            self.assertRegex(done.stdout, rf"(?m)^{row['name']} .* threads {row['threads']}\b")
        return {row["name"]: row for row in found["rows"]}, found["compute_units"]

    def test_rows_of_one_thread_stand_beside_those_of_all(self):
        rows, units = self.rows(2)
        if units < 2:
            self.skipTest("the device has one compute unit")
        names = {name for name in rows if not name.endswith("_1t")}
        self.assertLessEqual(OPENCV, names)
        self.assertEqual(set(rows), names | {f"{name}_1t" for name in names})
        for name, row in rows.items():
            self.assertEqual(row["threads"], 1 if name.endswith("_1t") else 2, name)
        for name in OPENCV:  # no thread works for more than all of the time
            self.assertLess(rows[f"{name}_1t"]["cpus"], 1.1)
            self.assertLess(rows[name]["cpus"], 2.2)

    def test_one_thread_alone(self):
        rows, _ = self.rows(1)
        self.assertFalse([name for name in rows if name.endswith("_1t")])
        for name in OPENCV:
            self.assertEqual(rows[name]["threads"], 1)
            self.assertLess(rows[name]["cpus"], 1.1)


if __name__ == "__main__":
    unittest.main()
