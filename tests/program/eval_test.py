# SPDX-License-Identifier: Apache-2.0
"""egosgm synth and eval."""
import json
import os
import shlex
import shutil
import signal

from program_case import FRAMES, ProgramTest, egosgm, grey_png


class Synth(ProgramTest):
    def test_moving_objects_have_masks(self):
        street = self.new_folder() / "street"
        self.assert_works("synth", "--out", street, "--frames", 2, "--width", 160, "--height", 64, "--moving-object")
        result = self.json_of("eval-flow", street / "truth", street)
        self.assertEqual([result["objects"][name] for name in ("found", "lost", "false", "median_shift_error_m")], [1, 0, 0, 0])
        self.assertAlmostEqual(result["objects"]["median_turn_error_deg"], 0, 3)
        figures = result["regions"]["moving"]
        self.assertEqual([(figures[name]["outliers_percent"], figures[name]["density_percent"]) for name in ("d1", "d2", "fl", "sf")], [(0, 100)] * 4)

    def test_objects_and_flow_of_a_run_are_those_of_the_street(self):
        street, out = self.new_folder() / "street", self.new_folder() / "out"
        self.assert_works("synth", "--out", street, "--frames", 5, "--width", 480, "--height", 180, "--seed", 3, "--moving-object", "--quiet")
        run = ["run", street, "--out", out, "--poses", street / "poses.txt", "--disparities", 64, "--write", "interpolated,flow,disp_1,objects", "--quiet"]
        self.assert_works(*run)
        for folder, frames in (("flow", 4), ("disp_1", 4), ("objects", 4), ("disparity", 5)):
            self.assertEqual([f.name for f in sorted((out / folder).iterdir())], [f"{i:06d}.png" for i in range(frames)], folder)
        rows = [line.split(",") for line in (out / "objects.csv").read_text().splitlines()]
        self.assertEqual(rows[0][:2] + rows[0][-5:], ["frame", "id", "age", "pixels", "sx_m", "sy_m", "sz_m"])
        self.assertEqual([row[-5] for row in rows[1:] if row[1] == rows[1][1]], ["1", "2", "3", "4"])  # one object stays itself
        result = self.json_of("eval-flow", out, street)
        self.assertLess(result["regions"]["all"]["sf"]["outliers_percent"], 8)
        self.assertLess(result["regions"]["moving"]["fl"]["outliers_percent"], 40)  # 100 by the camera's motion alone
        self.assertGreaterEqual(result["objects"]["found"], 4)
        self.assertLess(result["objects"]["median_shift_error_m"], 0.08)  # of 1 m a frame
        self.assertLess(result["objects"]["median_turn_error_deg"], 2)

        # A run that goes on makes them again.
        kept = {name: (out / name).read_bytes() for name in ("objects.csv", "flow/000002.png")}
        (out / "flow/000002.png").unlink()
        (out / "objects.csv").write_bytes(kept["objects.csv"][:len(kept["objects.csv"]) // 2])
        self.assert_works(*run, "--resume")
        for name, before in kept.items():
            self.assertEqual((out / name).read_bytes(), before, name)
        self.assert_refused(["run", street, "--out", self.folder / "never", "--temporal", "off", "--write", "flow"], "--write flow: temporal=false")

    def test_a_plain_street_has_a_sky(self):
        plain = self.new_folder() / "plain"
        self.assert_works("synth", "--out", plain, "--plain", "--frames", 1, "--width", 160, "--height", 64, "--quiet")
        for folder, sky in ((plain, True), (self.street, False)):
            truth = folder / "truth/left_disp_occ"
            result = self.json_of("eval", truth, truth)
            self.assertEqual(any(pair["counts"]["sky"] for pair in result["pairs"]), sky)
            self.assertEqual(result["pooled"]["wrong_of_all"], 0)

    def test_an_interrupt_leaves_whole_frames(self):
        street = self.new_folder() / "street"
        process = self.started("synth", "--out", street, "--frames", 40, "--width", 80, "--height", 40)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=900)
        self.assertEqual(process.returncode, 130, errors)
        self.assertRegex(errors, r"\Aegosgm: interrupted after [1-9]\d* of 40 frames, .*street\n\Z")
        frames = int(errors.split()[3])
        for folder in ("image_0", "image_1", "truth/left_disp_occ", "truth/left_disp_noc", "truth/right_disp_occ", "truth/right_disp_noc"):
            self.assertEqual(sorted(file.name for file in (street / folder).iterdir()), [f"{i:06d}.png" for i in range(frames)], folder)

    def test_the_command_that_it_names_can_be_pasted(self):
        street = self.new_folder() / "it's a street"
        said = self.assert_works("synth", "--out", street, "--frames", 1, "--width", 80, "--height", 40)
        command = said.splitlines()[-1].split(": ", 1)[1]
        self.assertEqual(shlex.split(command), ["egosgm", "run", "--odometry", str(street), "--out", "OUT"])


class Eval(ProgramTest):
    def test_an_estimate_against_itself_is_perfect(self):
        truth = self.street / "truth/left_disp_occ"
        result = self.json_of("eval", truth, truth)
        self.assertEqual(len(result["pairs"]), FRAMES)
        for key, value in {"bad_or_missing": 0, "bad_of_valid": 0, "density": 100, "interpolated": 0, "d1": 0,
                           "d1_interpolated": 0, "bad_1px": 0, "mae": 0, "mean_error": 0}.items():
            self.assertEqual(result["pooled"][key], value, key)
        table = self.assert_works("eval", "--estimate", truth, "--truth", truth)
        self.assertIn("pooled", table)
        self.assertIn("000003", table)

    def test_a_mask_limits_what_is_compared(self):
        everything, visible = self.street / "truth/left_disp_occ", self.street / "truth/left_disp_noc"

        def counts(*arguments):
            return [pair["truth_pixels"] for pair in self.json_of("eval", "--estimate", everything, *arguments)["pairs"]]

        masked = counts("--truth", everything, "--mask", visible)
        self.assertEqual(masked, counts("--truth", visible))
        self.assertLess(sum(masked), sum(counts("--truth", everything)))

    def test_refuses_what_cannot_be_compared(self):
        truth, empty, small, mask = self.street / "truth/left_disp_occ", self.new_folder(), self.new_folder() / "000000.png", self.new_folder() / "000000.png"
        small.write_bytes(grey_png(20, 10, depth=16))
        mask.write_bytes(grey_png(20, 10))
        self.assert_all_refused((
            (f"{small} {truth}/000000.png", small), (f"{{street}}/calib.txt {truth}/000000.png", "calib.txt"), (f"{empty} {truth}", empty), (f"nowhere {truth}", "nowhere"),
            (f"{truth} {truth} --frames 7:9", truth, "holds no map of the chosen frames"),
            (f"{truth} {truth} --mask {empty}", "000000.png"), (f"{truth} {truth} --mask {mask.parent}", "20x10")), ["eval"])


class EvalPoses(ProgramTest):
    def drift(self, *arguments):
        result = self.json_of("eval-poses", *arguments)
        return result["frames"], result["end_drift_m"]

    def test_a_camera_that_stands_has_no_drift_in_percent(self):
        poses = self.new_folder() / "poses.txt"
        poses.write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 3)
        self.assertIn("0.000 m = - %", self.assert_works("eval-poses", poses, poses))

    def test_a_file_that_is_compared_with_itself_is_told(self):
        truth, near = self.street / "poses.txt", self.new_folder() / "poses.txt"
        rows = truth.read_text().splitlines()
        near.write_text("\n".join([*rows[:-1], rows[-1].rsplit(" ", 1)[0] + " 9"]))
        for estimate, is_told in ((truth, True), (near, False)):
            self.assertEqual("is a file compared with itself" in self.assert_works("eval-poses", estimate, self.street), is_told)
            self.assertEqual("warnings" in json.loads(self.assert_works("eval-poses", estimate, self.street, "--json")), is_told)

    def test_a_part_of_the_sequence_against_the_whole_truth(self):
        truth = self.street / "poses.txt"
        out = self.ran(self.street, "--frames", "1:3", "--poses", truth, "--disparities", 48)
        alone = self.new_folder() / "alone.txt"
        alone.write_text((out / "poses.txt").read_text())
        for arguments in ((out, truth), (out, self.street), ("--estimate", out / "poses.txt", "--truth", truth), ("--estimate", out, self.street),
                          (alone, truth, "--frames", "1:3"), (alone, self.street, "--frames", "1:")):
            frames, drift = self.drift(*arguments)
            self.assertEqual(frames, 3)
            self.assertLess(drift, 1e-5, arguments)
        self.assertEqual(self.drift(out, truth, "--frames", "2:3")[0], 2)
        two = self.new_folder() / "two.txt"
        two.write_text("".join(truth.read_text().splitlines(True)[:2]))
        self.assert_all_refused((
            ([alone, truth], alone, "3 poses", f"{truth} {FRAMES}", "--frames FIRST:LAST"), ([out, truth, "--frames", 2], out / "poses.txt", truth, "--frames 2"),
            ([out], "no truth"), (["--estimate", out, "--truth", truth, "more"], "more"), ([out, two], two, "holds 2 poses", out / "poses.txt")), ["eval-poses"])

    def test_a_run_without_its_first_or_an_inner_pair_against_the_whole_truth(self):
        for broken in (0, 2):
            street, out = self.broken_street(), self.new_folder() / "out"
            os.truncate(street / f"image_0/{broken:06d}.png", 60)
            self.assertEqual(egosgm("run", street, "--poses", self.street / "poses.txt", "--disparities", 48, "--out", out, "--quiet").returncode, 0)
            for truth in (self.street / "poses.txt", street):
                frames, drift = self.drift(out, truth)
                self.assertEqual(frames, FRAMES - 1)
                self.assertLess(drift, 1e-5, truth)

    def renumbered(self, by):
        """The sequence with other numbers in its names."""
        street = self.broken_street()
        for side in (0, 1):
            for image in sorted((street / f"image_{side}").iterdir(), reverse=by > 0):
                image.rename(image.with_stem(f"{int(image.stem) + by:06d}"))
        return street

    def test_poses_of_other_frames_are_no_truth(self):
        for by in (100, 9000000):
            self.assert_refused(["eval-poses", self.ran(self.renumbered(by), "--disparities", 16), self.street], self.street / "poses.txt", f"frame {by}")
        out, other = self.ran(self.street, "--frames", "0:2", "--disparities", 16), self.renumbered(2)
        self.assert_refused(["eval-poses", out, other], other / "poses.txt", "frame 0")

    def test_the_largest_number_of_a_frame_is_one(self):
        street = self.broken_street()
        (street / "poses.txt").unlink()
        for side in (0, 1):
            for image in (street / f"image_{side}").iterdir():
                image.rename(image.with_stem(str(2**31 - 1 - int(image.stem))))
        out = self.ran(street, "--disparities", 16)
        self.assert_works("report", out)
        self.assert_works("eval-poses", out, out / "poses.txt")

    def test_a_report_that_was_edited_reads_no_pose_that_is_not_there(self):
        out = self.ran(self.street, "--disparities", 16)
        report = self.report(out)
        report["frames"][1]["frame"] = 900000000
        del report["sequence"]
        (out / "report.json").write_text(json.dumps(report))
        self.assert_refused(["eval-poses", out, self.street / "poses.txt"], "frame 900000000")
        self.assert_refused(["report", out, "--pictures", 0, "--poses", self.street / "poses.txt"], "frame 900000000")
        del report["frames"][2:]
        (out / "report.json").write_text(json.dumps(report))
        self.assert_refused(["eval-poses", out, self.street / "poses.txt"], "holds 4 poses", "lists 2 frames")
        self.assert_works("eval-poses", shutil.copy(out / "poses.txt", out / "others.txt"), self.street / "poses.txt")
