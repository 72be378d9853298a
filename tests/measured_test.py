# SPDX-License-Identifier: Apache-2.0
"""The tables of bench/accuracy, and the page that scripts/write_measured.py makes of the benches' files. EGOSGM_PROGRAM names the program."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

SOURCE = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(SOURCE / "bench/accuracy"))
from tables import Missing, Table  # noqa: E402

MACHINE = {"device": "a CPU", "driver": "1.0", "version": "OpenCL 3.0", "compute_units": 2, "threads": 2, "commit": "0123456789",
           "date": "2026-01-02T03:04:05Z", "input": "a street"}
SHAPE = {"width": 320, "height": 96, "disparities": 32}
COMPARED = [{"name": "opencv_hh", **SHAPE, "median_ms": 20, "cpus": 1.0}, {"name": "opencv_hh_1t", **SHAPE, "median_ms": 22, "cpus": 1.0},
            {"name": "egosgm_banded_frame_1t", **SHAPE, "median_ms": 11, "cpus": 0.99, "search_fraction": 0.136}]
STAGES = [{"name": "Census", **SHAPE, "median_ms": 1.5, "device_ms": 1.25, "GB_s": 3.5}, {"name": "step_match", **SHAPE, "median_ms": 9.5}]

VIDEO = {"methods": {"headings": ["video", "method", "flicker [px]", "harm"],
                     "rows": [["street", "EgoSGM", 0.25, 12.5], ["street", "EgoSGM, single frame", 1.25, None], ["KITTI", "skipped: not there"]]},
         "pose_noise": {"headings": ["video", "each motion is off by", "bad"], "rows": [["street", "1 degree, 0 cm", 3.5]]},
         "dropped_frames": {"headings": ["video", "dropped", "bad"], "rows": [["street", "2", 4.5]]}}


class Tables(unittest.TestCase):
    def test_a_figure_of_accuracy_has_its_single_frames(self):
        table = Table()
        for figure in ("bad_or_missing", "interpolated", "d1_interpolated", "bad after interpolation", "bad_of_valid, frame 10"):
            with self.assertRaisesRegex(ValueError, "single frame"):
                table.add("street", figure, 1.0)
            table.add("street", figure, 1.0, single=2.0)
        table.add("street", "search", 1.0)

    def test_limits(self):
        table = Table()
        for value, passed in ((30, True), (30.01, False), (float("nan"), False), (None, False)):
            table.add("street", "bad_or_missing", value, single=0, limit="poles")
            self.assertEqual((table.rows[-1]["at_most"], table.rows[-1]["goal"], table.rows[-1]["passed"]), (30, 1, passed))

    def test_what_was_skipped_is_not_kept(self):
        def missing():
            raise Missing("it is not there")
        table = Table()
        table.add("street", "search", 1.0, at_most=2)
        self.assertEqual(table.exit_code(), 0)
        table.fill("2012", missing)
        self.assertEqual(table.exit_code(), 3)
        table.add("street", "search", 3.0, at_most=2)
        self.assertEqual(table.exit_code(), 1)

    def test_without_data_the_bench_says_so(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([sys.executable, "-B", SOURCE / "bench/accuracy", "--egosgm", os.environ["EGOSGM_PROGRAM"], "--no-speed", "--only", "2012",
                                   "--data", f"{folder}/none", "--work", folder], capture_output=True, text=True)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("2 rows skipped", done.stderr)
        self.assertIn(f"no data at {folder}/none", done.stderr)


class Page(unittest.TestCase):
    def setUp(self):
        holder = tempfile.TemporaryDirectory()
        self.addCleanup(holder.cleanup)
        self.docs = pathlib.Path(holder.name) / "docs"
        (self.docs / "understand").mkdir(parents=True)
        self.readme = self.docs.parent / "README.md"
        self.readme.write_text("# Before\n<!-- results: scripts/write_measured.py writes this -->\nold\n<!-- end of results -->\nbehind\n")

    def put(self, **changed):
        table = Table()
        table.add("street", "bad_or_missing", 1.25, single=2.5, at_most=1)
        table.add("2012 / 000151, frames 7 to 10", "bad_or_missing", 3.25, single=6.5)
        table.rows.append({"input": "2012", "figure": "skipped: not there", "skipped": True, "passed": None})
        content = {"accuracy": {"rows": table.rows}, "video": {"video": VIDEO}, "compare": {"rows": COMPARED}, "stages": {"rows": STAGES}}
        (self.docs / "measured").mkdir(exist_ok=True)
        for name in {**content, **changed}:
            (self.docs / f"measured/{name}.json").write_text(json.dumps({**MACHINE, **content.get(name, {}), **changed.get(name, {})}))

    def write(self, *arguments):
        return subprocess.run([sys.executable, "-B", SOURCE / "scripts/write_measured.py", "--docs", self.docs, *arguments], capture_output=True,
                              text=True).returncode

    def assert_page_holds(self, *texts):
        self.assertEqual(self.write(), 0)
        page = (self.docs / "understand/measured.md").read_text()
        for text in texts:
            self.assertIn(text, page)
        return page

    def test_holds_the_figures(self):
        self.put()
        page = self.assert_page_holds(
            "| street | bad_or_missing | 1.25 % | 2.50 | ≤ 1 **missed** |", "- 2012: skipped: not there", "a CPU", "driver 1.0", "0123456789", "2026-01-02",
            "| EgoSGM, steady frame, both views, motion given | 320×96, 32 | 1 | 0.990 | 11.00 ms | 0.500 | 13.6 % |",
            "| OpenCV MODE_HH, 8 paths, left view | 320×96, 32 | 2 | 1.00 | 20.00 ms | 1.00 |  |", "| Census | 320×96, 32 | 1.50 ms | 1.25 ms | 3.50 |",
            "| step_match | 320×96, 32 | 9.50 ms |  |  |", "| street | EgoSGM | 0.250 | 12.50 |", "| street | EgoSGM, single frame | 1.25 |  |",
            "- KITTI: skipped: not there", "| street | 1 degree, 0 cm | 3.50 |", "| street | 2 | 4.50 |")
        self.assertNotIn("without evidence", page)

    def test_figures_of_two_builds_or_of_no_build_make_no_page(self):
        dirty = dict.fromkeys(("accuracy", "video", "compare", "stages"), {"commit": "0123456789-dirty"})
        for changed in ({"compare": {"commit": "9876543210"}}, {"compare": {"device": "a GPU"}}, dirty, {"accuracy2": {}}):  # the last is of no page
            with self.subTest(changed):
                self.put(**changed)
                self.assertEqual(self.write(), 1)
        self.assertFalse((self.docs / "understand/measured.md").exists())

    def test_the_readme_has_a_few_rows(self):
        self.put()
        self.assertEqual(self.write(), 0)
        readme = self.readme.read_text()
        self.assertIn("| 3.25 % | 6.50 % |", readme)
        self.assertIn("| OpenCV MODE_HH, 8 paths, left view | 20.0 ms |", readme)
        self.assertTrue(readme.startswith("# Before\n") and readme.endswith("behind\n") and "old" not in readme)
        self.readme.write_text(readme.replace("3.25 %", "3.24 %"))
        self.assertEqual(self.write("--check"), 1)
        self.readme.write_text("no place\n")
        self.assertEqual(self.write(), 1)
        self.assertEqual(self.readme.read_text(), "no place\n")

    def test_other_drivers_are_of_a_commit_of_their_own(self):
        self.put()
        found = {"headings": ["driver", "tests", "commit"], "rows": [["PoCL 9", "11 pass", "9876543210"]]}
        file = self.docs / "measured/drivers.json"
        file.write_text(json.dumps(found))
        self.assert_page_holds("commit 0123456789", "| driver | tests | commit |\n| --- | --- | --- |\n| PoCL 9 | 11 pass | 9876543210 |")
        file.write_text(json.dumps({**found, "rows": [["PoCL 9", "11 pass", "9876543210-dirty"]]}))
        self.assertEqual(self.write("--check"), 1)

    def test_machines_that_sent_their_figures(self):
        self.put()
        sent = {**MACHINE, "device": "a GPU", "commit": "9876543210", "copy_gb_s": 250.5,
                "rows": [{"name": "steady_frame", "width": 1242, "height": 375, "disparities": 128, "median_ms": 1.75}]}
        folder = self.docs / "measured/devices"
        folder.mkdir()
        file = folder / "a-gpu.json"
        file.write_text(json.dumps(sent))
        self.assert_page_holds("| a GPU | 1.0 | 2 | 250.50 |  |  | 1.75 ms | 9876543210 | 2026-01-02 |", "| a CPU | 1.0 | 2 |  |")
        for broken in ({**sent, "commit": "9876543210-dirty"}, {"rows": []}):
            file.write_text(json.dumps(broken))
            self.assertEqual(self.write("--check"), 1)

    def test_places_without_evidence_where_they_were_measured(self):
        tables = {"places": {"headings": ["place", "filled", "ratio"], "rows": [["sky", 98.5, 7.5], ["fence", "skipped: not there"], ["median of the ratios", None, 7.5]]},
                  "repeated": {"headings": ["pair", "time 10"], "rows": [["sky, first pair", 94.5]]}, "poles": {"headings": ["width", "found"], "rows": [["3 px", 23.5]]},
                  "paper": {"headings": ["place", "wrong"], "rows": [["fence", 67.5]]}}
        ratios = {"headings": ["video", "ratio"], "rows": [["street", 1.5], ["median of the ratios", 1.25]]}
        changed = {"video": {"video": {**VIDEO, "ratios": ratios}}, "evidence": {"evidence": tables}}
        self.put(**changed)
        self.assert_page_holds("| sky | 98.50 | 7.50 |", "| median of the ratios |  | 7.50 |", "| sky, first pair | 94.50 |", "| 3 px | 23.50 |", "| fence | 67.50 |",
                               "- fence: skipped: not there", "| street | 1.50 |", "| median of the ratios | 1.25 |")
        changed["evidence"]["commit"] = "9876543210"  # the page would be the same
        self.put(**changed)
        self.assertEqual(self.write("--check"), 1)

    def test_check_tells_a_page_that_was_edited(self):
        self.assertEqual(self.write("--check"), 77)
        self.put()
        self.assertEqual(self.write("--check"), 1)
        self.write()
        self.assertEqual(self.write("--check"), 0)
        page = self.docs / "understand/measured.md"
        page.write_text(page.read_text().replace("1.25 %", "1.24 %"))
        self.assertEqual(self.write("--check"), 1)
