# SPDX-License-Identifier: Apache-2.0
"""What the program may write: it removes nothing, and replaces only report and poses of a run that goes on. Environment as for program_case.py."""
import json
import os
import shutil
import stat
import subprocess
import threading
import unittest

from program_case import PROGRAM, ProgramTest, egosgm, grey_png, state

METHOD = ("--disparities", 16, "--quiet")
TUNE = ("--width", 64, "--height", 24, "--disparities", 16, "--rounds", 2, "--stage")
CALIBRATION = "fx = 100\nfy = 100\ncx = 32\ncy = 15\nbaseline_m = 0.5\n"


class FilesTest(ProgramTest):
    def user_folder(self):
        """left, right, calib.toml, poses.txt, config.toml: what a user has."""
        folder = self.new_folder() / "user"
        for side in ("left", "right"):
            (folder / side).mkdir(parents=True)
            for i in range(2):
                (folder / side / f"{i:06d}.png").write_bytes(grey_png(64, 32, frame=i))
        (folder / "calib.toml").write_text(CALIBRATION)
        (folder / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * 2)
        (folder / "config.toml").write_text("disparities = 16\n")
        return folder

    @staticmethod
    def pair(folder):
        return ["--left", folder / "left/%06d.png", "--right", folder / "right/%06d.png", "--calib", folder / "calib.toml", *METHOD]

    def run_into(self, out, *arguments):
        self.assert_works("run", "--odometry", self.street, "--out", out, "--frames", "0:1", *METHOD, *arguments)


class InputFiles(FilesTest):
    """--out is new or empty, so it never is or holds what is read, whatever it is called."""

    def test_the_folder_of_the_images_is_no_output(self):
        """By some of its names; RandomCommands draws many more."""
        user, links = self.user_folder(), self.new_folder()
        (links / "to_left").symlink_to(user / "left")
        for how, named in (([], "is not empty"), (["--resume"], "report.json")):
            for out in (user, user / "left/../right", user.parent, links / "to_left"):
                self.assert_refused_and_untouched(user, ["run", *self.pair(user), "--out", out, *how], named)
            self.assert_refused_and_untouched(user, ["run", "--left", "left/%06d.png", "--right", "right/%06d.png", "--calib", "calib.toml",
                                                     "--out", ".", *how], named, cwd=user)

    def test_a_home_folder_that_cannot_be_looked_into(self):
        env = {name: value for name, value in os.environ.items() if not name.startswith("XDG_")}
        kept = os.path.join(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "pocl/kcache")  # PoCL's own place
        env.update(HOME="/" + 300 * "x", POCL_CACHE_DIR=os.environ.get("POCL_CACHE_DIR", kept))
        done = egosgm("run", self.street, "--out", self.new_folder() / "out", *METHOD, env=env)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_a_sequence_keeps_its_truth_and_may_hold_results(self):
        street = self.broken_street()
        before = state(street)
        self.assert_all_refused((
            *((f"run {street} --out {out}", "is not empty: give a new folder") for out in (street, street / "truth", street / "image_0")),
            *((f"odometry {street} --out {street}/{file}", file, "is there already") for file in ("poses.txt", "image_0/000000.png"))))
        self.assertEqual(state(street), before)
        self.assert_works("run", "--odometry", street, "--out", street / "results", "--frames", "0", *METHOD)
        self.assertLess(before.items(), state(street).items())
        self.assertTrue(self.report(street / "results")["finished"])

    def test_what_comes_through_a_pipe_is_read(self):
        user = self.user_folder()
        run = ["run", *self.pair(user), "--out"]
        for arguments, name in (([*run, user.parent / "a", "--poses"], "poses.txt"), ([*run, user.parent / "b", "--config"], "config.toml")):
            reading, writing = os.pipe()
            os.write(writing, (user / name).read_bytes())
            os.close(writing)
            self.assert_works(*arguments, f"/dev/fd/{reading}", pass_fds=[reading])
            os.close(reading)
        self.assertEqual(self.report(user.parent / "a")["motion"].split("/")[0], "poses of ")

    def test_other_commands(self):
        user = self.user_folder()
        for command in (["rectify", *self.pair(user)[:6]], ["compile"], ["synth", "--frames", 1]):
            self.assert_refused_and_untouched(user, [*command, "--out", user], "not empty")
            self.assert_refused_and_untouched(user, [*command, "--out", ""], "--out", cwd=user)

    def test_named_files_replace_none(self):
        user, folder = self.user_folder(), self.new_folder()
        self.run_into(folder / "out")
        image, poses, config = user / "left/000000.png", user / "poses.txt", user / "config.toml"
        (user / "page.html").write_text("<html></html>")
        (user / "path.svg").write_text("<svg/>")
        (user / "json.json").write_text('{"a, driver b": 7}')
        (user / "link").symlink_to(image)
        shutil.copy(poses, user / "more.txt")
        run = ["run", *self.pair(user), "--out", folder / "new"]
        for arguments in ([*run, "--trace", image], [*run, "--save-config", image], [*run, "--config", config, "--save-config", config],
                          [*run, "--trace", user / "link"], ["odometry", self.street, "--out", user / "more.txt"],
                          ["eval-poses", "--estimate", poses, "--truth", poses, "--plot", user / "path.svg"],
                          ["eval-poses", "--estimate", poses, "--truth", poses, "--plot", image],
                          ["report", folder / "out", "--out", image],
                          ["report", folder / "out", "--out", user / "page.html"], ["tune", "--file", image], ["tune", "--file", user / "json.json"],
                          ["compile", "--out", folder / "programs", "--save-config", config]):
            with self.subTest(arguments=arguments):
                self.assert_refused_and_untouched(user, arguments)
        self.assertFalse((folder / "new").exists())
        self.assertFalse((folder / "programs").exists())


class CameMeanwhile(FilesTest):
    def test_what_others_put_there_while_a_command_works_stays(self):
        for name, command in (("", ["odometry", self.street]), ("image_0/000008.png", ["synth", "--frames", 9, "--width", 32, "--height", 16])):
            out = self.new_folder() / "out"
            process = self.started(*command, "--out", out)
            (out / name).write_text("mine")
            _, errors = process.communicate(timeout=900)
            with self.subTest(command[0]):
                self.assertEqual((process.returncode, (out / name).read_text()), (1, "mine"), errors)
                self.assertIn(f"{out / name}: has come there meanwhile, and stays", errors)
                self.assertEqual(list(out.parent.iterdir()), [out])


class OwnFiles(FilesTest):
    """What lies in --out stays."""

    def test_what_was_edited_since_stays(self):
        for name in ("poses.txt", "disparity/000000.png", "variance/000001.pfm"):
            out = self.new_folder()
            self.run_into(out, "--write", "variance")
            mine = (out / name).read_bytes()
            mine = mine[:-40] + bytes([mine[-40] ^ 1]) + mine[-39:]
            (out / name).write_bytes(mine)
            with self.subTest(name=name):
                self.assert_refused(["run", "--odometry", self.street, "--frames", "0:1", "--write", "variance", *METHOD, "--out", out, "--resume"],
                                    name, "is not what this run makes")
                self.assertEqual((out / name).read_bytes(), mine)

    def test_a_report_of_no_run_leads_nowhere(self):
        out = self.new_folder()
        self.run_into(out)
        whole = (out / "report.json").read_text()
        for broken in (whole[:len(whole) // 2], "", "{}", "[]", whole.replace("egosgm", "EGOSGM", 1), '{"program": "egosgm"}', "[" * 200000):
            (out / "report.json").write_text(broken)
            self.assert_refused_and_untouched(out, ["run", "--odometry", self.street, "--frames", "0:1", *METHOD, "--out", out, "--resume"], "--resume" if
                                              "program" in broken and "EGO" not in broken and broken != whole[:len(whole) // 2] else "report.json")

    def test_links_in_out_are_not_followed(self):
        user, out = self.user_folder(), self.new_folder()
        self.run_into(out)
        resume = ["run", "--odometry", self.street, "--frames", "0:1", *METHOD, "--out", out, "--resume"]
        poses = (out / "poses.txt").read_text()
        (out / "poses.txt").unlink()
        (out / "poses.txt").symlink_to(user / "poses.txt")
        self.assert_refused_and_untouched(user, resume, "poses.txt is a link")
        (out / "poses.txt").unlink()
        (out / "poses.txt").write_text(poses)
        (out / "disparity/000001.png").unlink()
        (out / "disparity/000001.png").symlink_to(user / "right/new.png")
        self.assert_refused_and_untouched(user, resume, "000001.png is a link")
        shutil.rmtree(out / "disparity")
        (out / "disparity").symlink_to(user / "right")
        self.assert_refused_and_untouched(user, resume, "a link")

    def test_named_files_in_out_are_new(self):
        out = self.new_folder() / "out"
        run = ["run", "--odometry", self.street, "--frames", "0:1", *METHOD, "--out", out]
        self.assert_works(*run, "--trace", out / "trace.json", "--save-config", out / "used.toml")
        self.assertIn("traceEvents", json.loads((out / "trace.json").read_text()))
        for option, name in (("--trace", "trace.json"), ("--save-config", "used.toml")):
            self.assert_refused_and_untouched(out, [*run, "--resume", option, out / name], name, "is there already")
        self.assert_works(*run, "--resume", "--trace", out / "second.json")
        self.assertIn("traceEvents", json.loads((out / "second.json").read_text()))

    def test_named_files_that_the_run_writes_anyway(self):
        for name in ("report.json", "poses.txt", "disparity", "disparity/000000.png"):
            for option in ("--trace", "--save-config"):
                out = self.new_folder()
                with self.subTest(name=name, option=option):
                    self.assert_refused_and_untouched(out, ["run", "--odometry", self.street, *METHOD, "--out", out, option, out / name], option)
        out = self.new_folder()
        rows = [(f"run {{street}} --out {{never}}/out {option} {{never}}{name}", "is a folder")
                for option in ("--trace", "--save-config") for name in ("", "/out", "/./out", "/out/../out")]
        rows += [(f"{command} {{never}}/", "is a folder: give the name of a file") for command in ("odometry {street} --out", f"compile --out {out} --save-config", "tune --file")]
        rows += [(f"compile --out {{never}}/out --save-config {{never}}{name}", "or is that folder") for name in ("", "/out")]
        rows += [(f"compile --out {out} --save-config {out}/manifest.json", "lies in"),
                 (f"run {{street}} --out {out} --trace {out}/a --save-config {out}/./a", "another option")]
        self.assert_all_refused(rows)
        self.assertEqual(list(out.iterdir()), [])

    def test_a_page_is_not_replaced(self):
        out = self.ran(self.street, "--frames", 0, *METHOD)
        self.assert_works("report", out)
        self.assert_refused_and_untouched(out, ["report", out], "report.html", "is there already")


class Streams(FilesTest):
    """Pipes, devices, links, modes."""

    def test_a_pipe_takes_the_bytes_and_stays(self):
        pipe, read = self.new_folder() / "pipe", []
        os.mkfifo(pipe)
        reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
        reader.start()
        self.assert_works("run", "--odometry", self.street, "--out", self.new_folder(), "--frames", "0", *METHOD, "--trace", pipe)
        reader.join()
        self.assertTrue(stat.S_ISFIFO(pipe.lstat().st_mode))
        self.assertIn("traceEvents", json.loads(read[0]))

    def test_a_pipe_that_nobody_reads_costs_the_trace_alone(self):
        pipe, out = self.new_folder() / "pipe", self.new_folder()
        os.mkfifo(pipe)
        self.assert_refused(["run", "--odometry", self.street, "--out", out, *METHOD, "--trace", pipe], pipe, "nobody reads", code=1)
        report = self.report(out)
        self.assertIn("nobody reads", report["stopped_by"])
        self.assertEqual(len(report["frames"]), self.assert_whole(out))
        self.assertEqual([file.name for file in sorted(out.iterdir())], ["disparity", "poses.txt", "report.json"])

    def test_standard_output_takes_the_bytes(self):
        for target in ("/dev/stdout", "/dev/fd/1"):
            out = self.new_folder()
            text = self.assert_works("run", "--odometry", self.street, "--out", out, "--frames", "0", *METHOD, "--save-config", target)
            self.assertIn("\ndisparities = 16\n", text)
        with open(out / "saved.toml", "w") as saved:
            subprocess.run([PROGRAM, "run", "--odometry", self.street, "--out", out / "more", "--frames", "0", *map(str, METHOD), "--save-config", "/dev/stdout"],
                           stdout=saved, check=True, timeout=900)
        self.assertIn("\ndisparities = 16\n", (out / "saved.toml").read_text())
        poses = self.assert_works("odometry", self.street, "--out", "/dev/stdout")
        self.assertEqual({len(row.split()) for row in poses.splitlines()}, {12})

    @unittest.skipUnless(os.geteuid() == 0, "devices are made by root alone")
    def test_a_device_stays_one(self):
        device = self.new_folder() / "null"
        try:
            os.mknod(device, 0o600 | stat.S_IFCHR, os.makedev(1, 3))
            with open(device, "w"):
                pass
        except OSError:
            self.skipTest("no device can be made or opened here")
        self.assert_works("odometry", self.street, "--out", device, "--quiet")
        self.assertTrue(stat.S_ISCHR(device.lstat().st_mode))
