# SPDX-License-Identifier: Apache-2.0
"""Runs that go on where an earlier one was stopped, or leave it as it is."""
import json
import os
import pathlib
import shutil
import signal

from program_case import FRAMES
from stopped_run_test import LongRuns


class Resume(LongRuns):
    """An earlier run in OUT: in the way, replaced, or gone on with."""
    FRAMES = 12
    KINDS = ("--write", "variance,color,search")

    def assert_same_run(self, out, expected):
        mine, undisturbed = ({file.relative_to(folder): file.read_bytes() for file in folder.rglob("*") if file.is_file()} for folder in (out, expected))
        reports = [json.loads(files.pop(pathlib.Path("report.json"))) for files in (mine, undisturbed)]
        self.assertEqual(mine, undisturbed)
        for frame in reports[0]["frames"] + reports[1]["frames"]:
            del frame["ms"]
        self.assertEqual(*reports)

    def test_equals_an_undisturbed_run(self):
        """With what the user has put there. A new run says how to go on."""
        street, expected = self.street_of(self.FRAMES), self.new_folder()
        run = ["run", "--odometry", street, *self.KINDS, "--out"]
        self.assert_works(*run, expected)
        (expected / "notes.txt").write_text("mine")
        for stop, first in ((signal.SIGKILL, ()), (signal.SIGINT, ("--resume",))):
            out = self.new_folder()
            for lines, how in ((3, first), (5, ("--resume",))):
                process = self.start(street, out, *how, *self.KINDS, lines=lines)
                process.send_signal(stop)
                process.communicate()
                self.assertLess(self.assert_whole(out, at_least=lines), self.FRAMES)
                self.assertFalse(self.report(out)["finished"])
            (out / "notes.txt").write_text("mine")
            kept = {file: file.stat().st_ino for file in out.rglob("0*.*")}
            self.assertGreaterEqual(len(kept), 4 * 3)
            self.assert_refused_and_untouched(out, [*run, out], out, "is not empty", "--resume", "removed by hand")
            self.assert_works(*run, out, "--resume")
            self.assert_same_run(out, expected)
            for file, inode in kept.items():
                self.assertEqual(file.stat().st_ino, inode, f"{file} was there and was written again")

    def test_goes_on_only_with_what_it_would_make_itself(self):
        """Another image, or other poses in the same file, would make one sequence of two."""
        street = self.broken_street()
        poses = street.parent / "mine.txt"
        rows = (street / "poses.txt").read_text().splitlines()
        poses.write_text("\n".join(rows) + "\n")
        run = ["run", "--odometry", street, "--poses", poses, "--quiet", "--resume", "--out"]

        def broken(what):
            out = self.new_folder() / "out"
            self.assert_works(*run, out)
            (out / f"disparity/{FRAMES - 1:06d}.png").unlink()
            what()
            self.assert_refused_and_untouched(out / "disparity", [*run, out], "--resume", "disparity/000001.png", "another --out")

        broken(lambda: poses.write_text("\n".join([rows[0], rows[2], rows[1], rows[3]]) + "\n"))
        broken(lambda: shutil.copy(street / "image_0/000002.png", street / "image_0/000001.png"))

    def test_fewer_frames_leave_the_run_as_it_is(self):
        """Also where names are times."""
        folder = self.new_folder()
        for side, name in ((0, "left"), (1, "right")):
            (folder / name).mkdir()
            for i in range(FRAMES):
                shutil.copy(self.street / f"image_{side}/{i:06d}.png", folder / name / f"{1300 + i}.25.png")
        shutil.copy(self.street / "calib.txt", folder)
        for street, first_map in ((self.street, "000002.png"), (folder, "1302.25.png")):
            out = self.ran(street, "--disparities", 16)
            self.assert_refused_and_untouched(out, ["run", street, "--disparities", 16, "--out", out, "--frames", "0:1", "--resume"],
                                              "--resume", f"disparity/{first_map}", "give the frames", "another --out")

    def test_a_finished_run_stays_where_it_cannot_be_made_again(self):
        for broken in (FRAMES - 1, FRAMES - 2):  # the last frame alone; one on which the next rests, too
            street = self.broken_street()
            out, image = self.ran(street), street / f"image_1/{broken:06d}.png"
            os.truncate(image, 1000)
            self.assert_refused_and_untouched(out, ["run", street, "--out", out, "--resume"], "--resume", f"disparity/{broken:06d}.png", image, "another --out")

    def test_a_finished_run_that_left_a_pair_out_stays_too(self):
        street = self.broken_street()
        image = street / f"image_1/{FRAMES - 1:06d}.png"
        whole = image.read_bytes()
        os.truncate(image, 1000)
        out = self.ran(street)
        run = ["run", street, "--out", out, "--quiet"]
        image.write_bytes(whole)
        self.assert_refused_and_untouched(out, [*run, "--resume"], f"disparity/{FRAMES - 1:06d}.png", "left out", "another --out")
        os.truncate(image, 1000)
        os.truncate(street / "image_0/000000.png", 1000)
        self.assert_refused_and_untouched(out, [*run, "--resume"], "disparity/000000.png", "another --out")

    def test_a_run_that_lost_its_device_goes_on_there(self):
        """By a report that says so: another device than the one that is here cannot be had."""
        out = self.ran(self.street, "--frames", ":1")
        run = ["run", self.street, "--out", out]
        report = json.loads((out / "report.json").read_text())
        lost = report["device"]
        report["device"] = {**lost, "name": "another one"}
        (out / "report.json").write_text(json.dumps(report))
        self.assert_refused([*run, "--resume"], "device/name", "another one")
        report["fallback"] = {"from": lost, "why": "it is gone"}
        (out / "report.json").write_text(json.dumps(report))
        self.assert_works(*run, "--resume")
        self.assertEqual(self.assert_whole(out), FRAMES)

    def test_names_that_are_no_utf8(self):
        name = os.fsencode(self.new_folder()) + b"/b\xffseq"
        shutil.copytree(os.fsencode(self.street), name)
        sequence, out = os.fsdecode(name), self.new_folder() / "out"
        run = ["run", sequence, "--disparities", 16, "--out", out, "--quiet"]
        self.assert_works(*run)
        self.assert_works(*run, "--resume")
        self.assert_works("report", out)
        maps = os.fsdecode(name + b"/truth/left_disp_noc")
        self.assertEqual(len(self.json_of("eval", maps, maps)["pairs"]), FRAMES)

    def test_other_settings_cannot_go_on(self):
        out = self.ran(self.street, "--frames", ":1")
        run = ["run", self.street, "--out", out]
        self.assert_all_refused((("--set p2=99", "p2", "190", "99"), ("--poses {street}/poses.txt", "motion")), [*run, "--resume"])
        self.assert_works(*run, "--resume")
        self.assertEqual(self.assert_whole(out), FRAMES)
        (out / "report.json").write_text("[]")
        self.assert_refused([*run, "--resume"], out / "report.json")
        (out / "report.json").unlink()
        self.assert_refused([*run, "--resume"], out, "report.json", "another --out")
