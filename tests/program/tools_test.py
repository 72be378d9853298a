# SPDX-License-Identifier: Apache-2.0
"""What holds for every tool in Python: names that are no text, pipes, empty values, the standard output, interrupts. Environment as for program_case.py."""
import concurrent.futures
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import unittest

from program_case import FRAMES, HAS_PACKAGE, PACKAGE, PROGRAM, ProgramTest, egosgm

ODD = "b\udcff\n"  # a name of Latin-1, and of two lines


@unittest.skipUnless(HAS_PACKAGE, "built without the Python package")
class Tools(ProgramTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.out = cls.folder / "out"
        done = egosgm("run", cls.street, "--disparities", 16, "--write", "variance", "--out", cls.out, "--quiet")
        assert done.returncode == 0, done.stderr

    def odd(self, of, name=ODD):
        """A copy of a folder under an odd name."""
        copy = self.new_folder() / name
        shutil.copytree(of, copy)
        return copy

    def printed(self, *arguments):
        """Bytes, as a name need not be text."""
        done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, timeout=900)
        self.assertEqual((done.returncode, done.stderr), (0, b""), arguments)
        return done.stdout

    def test_folders_and_files_may_have_any_name(self):
        out, street = self.odd(self.out), self.odd(self.street)
        self.assertIn(b"4 frames", self.printed("eval-poses", out, street))
        self.assertIn(os.fsencode(out), self.printed("cloud", out))
        self.assertIn(os.fsencode(out), self.printed("report", out))
        self.assertIn(os.fsencode(street), self.printed("eval-video", out, "--sequence", street))
        maps = self.new_folder()
        for file in (self.out / "disparity").iterdir():
            shutil.copy(file, maps / f"\udcff_{file.name}")
        self.assertIn(b"3 pairs", self.printed("eval-video", maps, "--sequence", street))
        self.assertEqual(len(json.loads(self.printed("eval-video", maps, "--sequence", street, "--json"))["over_frames"]), FRAMES)
        self.assertIn("times.txt", json.loads(self.printed("doctor", street, "--disparities", 48, "--json"))[-1]["text"])
        rectified = self.new_folder() / ODD
        told = self.printed("rectify", *self.patterns(street), "--out", rectified)
        self.assertIn(b"4 pairs in " + os.fsencode(rectified), told)
        self.printed("rectify", *self.patterns(street), "--pair-by", "order", "--out", self.new_folder())

    def test_errors_name_what_is_no_text(self):
        gone = self.new_folder() / "b\udcffgone"
        shown = str(gone).replace("\udcff", " ")
        calib = ["--calib", self.street / "calib.txt", "--out", gone]
        self.assert_all_refused(((["cloud", self.out, "--out", gone / "x.ply"], shown), (["report", self.out, "--out", gone / "x.html"], shown)), code=1)
        self.assert_all_refused((
            (["cloud", gone], shown), (["report", gone], shown), (["eval-poses", gone, self.street], shown), (["eval-video", gone, self.street], shown),
            (["rectify", "--list", gone, *calib], shown), (["rectify", "--left", gone / "*", "--right", gone / "*", *calib], shown),
            *(([*arguments, "--frames", "\udcff"], "FIRST:LAST") for arguments in (["report", self.out], ["eval-poses", self.out, self.street], ["eval-video", self.out, self.street])),
            (["eval-video", self.out, "--sequence", self.street, "--scene", "\udcff"], "scene")))

    def test_empty_values_are_refused(self):
        out = self.out
        self.assert_all_refused((f"{command} {words}", "an argument" if words == "''" else words.split()[0].rstrip("="), "is empty")
                                for command, *all_words in ((f"eval-poses {out} {{street}}", "--frames ''"), (f"eval-video {out} {{street}}", "--frames ''", "--poses="),
                                                            (f"report {out}", "--out ''", "--poses="), (f"cloud {out}", "--out ''"), ("rectify", "--out ''"))
                                for words in (*all_words, "''"))

    def test_a_pipe_that_nobody_writes_to_ends_it(self):
        folder = self.new_folder()
        run = self.odd(self.out, "run")
        (run / "report.json").unlink()
        for pipe in (run / "report.json", folder / "list", folder / "000001.png", folder / "calib"):
            os.mkfifo(pipe)
        pairs = self.patterns()[:4]
        commands = {"report": ["report", run], "cloud": ["cloud", run], "flow": ["eval-video", self.out, self.street, "--flow", folder],
                    "list": ["rectify", "--list", folder / "list", "--calib", self.street / "calib.txt", "--out", folder / "new"],
                    "calib": ["rectify", *pairs, "--calib", folder / "calib", "--out", folder / "new"]}
        with concurrent.futures.ThreadPoolExecutor() as pool:
            for name, done in zip(commands, pool.map(lambda words: egosgm(*words), commands.values())):
                self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), f"{name}: {done.stderr}")
                self.assertIn("pipe", done.stderr, name)

    def test_the_standard_output_may_end_or_be_full(self):
        poses = self.new_folder() / "poses.txt"
        poses.write_text("".join(f"1 0 0 0 0 1 0 0 0 0 1 {i}\n" for i in range(400)))  # more than a buffer holds
        for arguments in (["eval-poses", poses, poses, "--json"], ["eval-poses", self.out, self.street, "--json"], ["cloud", self.out], ["report", "--help"]):
            for target, code, named in (("/dev/full", 1, "the standard output cannot be written"), (None, 0, "")):
                out = self.odd(self.out, "run")
                words = [PROGRAM, *(str(out) if word == self.out else str(word) for word in arguments)]
                reading, writing = (None, os.open(target, os.O_WRONLY)) if target else os.pipe()
                if reading is not None:
                    os.close(reading)
                done = subprocess.run(words, stdout=writing, stderr=subprocess.PIPE, text=True, timeout=900)
                os.close(writing)
                self.assertEqual((done.returncode, done.stderr.count("\n")), (code, code), f"{arguments}: {done.stderr}")
                self.assertIn(named, done.stderr)

    def test_a_standard_output_that_is_closed_becomes_no_file(self):
        out, folder = self.odd(self.out, "run"), self.new_folder()
        rectify = ["rectify", *self.patterns(), "--out", folder / "new", "--quiet"]
        for arguments, code in ((["eval-poses", out, self.street], 1), (["cloud", out], 1), (["report", "--help"], 1), (rectify, 0)):
            done = subprocess.run(["sh", "-c", 'exec "$@" >&- <&-', "sh", PROGRAM, *map(str, arguments)], stderr=subprocess.PIPE, text=True, timeout=900)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (code, code), f"{arguments}: {done.stderr}")
            self.assertIn("the standard output cannot be written: Bad file descriptor" if code else "", done.stderr)

    def test_tools_load_no_driver_which_would_take_their_interrupts(self):
        code = "import sys; from egosgm.program import run_tool; run_tool(sys.argv[1:]); sys.exit('pocl' in open('/proc/self/maps').read())"
        done = subprocess.run([sys.executable, "-B", "-c", code, "doctor", self.street], capture_output=True, text=True,
                              env=dict(os.environ, PYTHONPATH=str(PACKAGE)), timeout=900)
        self.assertEqual((done.returncode, done.stderr), (0, ""))

    def test_an_interrupt_while_the_package_is_loaded_ends_it(self):
        for module in ("numpy", "cv2"):
            folder = self.new_folder()
            (folder / f"{module}.py").write_text("import os, signal\ntry:\n    os.kill(os.getpid(), signal.SIGINT)\nexcept KeyboardInterrupt:\n    pass\n")
            done = egosgm("doctor", self.street, env=dict(os.environ, PYTHONPATH=str(folder)))
            self.assertEqual((done.returncode, done.stderr), (-signal.SIGINT, ""))

    def test_an_error_does_not_go_to_the_standard_output(self):
        for redirection in ("2>&-", "2>/dev/full"):
            words = ["sh", "-c", f'exec "$@" {redirection}', "sh", sys.executable, "-B", "-m", "egosgm", "report", self.new_folder()]
            done = subprocess.run([*map(str, words)], stdout=subprocess.PIPE, env=dict(os.environ, PYTHONPATH=str(PACKAGE)), timeout=900)
            self.assertEqual((done.returncode, done.stdout), (2, b""), redirection)


@unittest.skipUnless(HAS_PACKAGE, "built without the Python package")
class ReadCalibration(ProgramTest):
    """The command of the package hands the program what it read of a calibration that the program does not know."""

    def test_an_interrupt_ends_as_the_program_ends_it(self):
        package = pathlib.Path(PROGRAM).parents[1] / "python"
        street = self.broken_street()
        numbers = dict(part.split(":", 1) for part in (street / "calib.txt").read_text().splitlines() if ":" in part)
        self.assertIn("P1", numbers)
        fx, _, cx, tx, _, fy, cy, *_ = map(float, numbers["P1"].split())
        camera = {"camera_model": "pinhole", "intrinsics": [fx, fy, cx, cy], "distortion_model": "radtan", "distortion_coeffs": [0, 0, 0, 0]}
        second = {**camera, "T_cn_cnm1": [[1, 0, 0, tx / fx], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}
        (street / "chain.yaml").write_text(json.dumps({"cam0": camera, "cam1": second}))
        out, temporary = self.new_folder() / "out", self.new_folder()
        words = ["run", *self.patterns(street, street / "chain.yaml"), "--disparities", 16, "--out"]
        with self.subTest("whole"):
            environment = dict(os.environ, PYTHONPATH=str(package), TMPDIR=str(temporary))
            done = subprocess.run([sys.executable, "-B", "-m", "egosgm", *map(str, words), out], env=environment, capture_output=True, text=True, timeout=900)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertAlmostEqual(self.report(out)["calibration"]["fx"], fx, places=3)
        stopped = self.new_folder() / "out"
        process = self.started(*words, stopped, command=[sys.executable, "-B", "-m", "egosgm"], env=environment)
        process.send_signal(signal.SIGINT)  # as `timeout` and schedulers do, to this process alone
        _, errors = process.communicate(timeout=900)
        self.assertEqual((process.returncode, errors.count("\n")), (130, 1), errors)
        self.assertTrue(self.report(stopped)["frames"])
        self.assertEqual(list(temporary.iterdir()), [])
