# SPDX-License-Identifier: Apache-2.0
"""Runs that end early: full disks, interrupts, lost devices."""
import json
import os
import resource
import shutil
import signal
import subprocess
import time

from program_case import FEW_KERNELS, FRAMES, HAS_PACKAGE, HEIGHT, PROGRAM, WIDTH, ProgramTest, as_nobody, egosgm, grey_png, with_small_disk, without_waiting


class LongRuns(ProgramTest):
    """What tests of stopped runs are made of."""
    LONG = 20

    def street_of(self, frames):
        """The sequence forth and back, again and again."""
        street = self.broken_street()
        there_and_back = [*range(FRAMES), *range(FRAMES - 2, 0, -1)]
        for side in (0, 1):
            for i in range(FRAMES, frames):
                source = self.street / f"image_{side}/{there_and_back[i % len(there_and_back)]:06d}.png"
                shutil.copyfile(source, street / f"image_{side}/{i:06d}.png")
        return street

    def long_street(self):
        """A sequence that takes a while."""
        return self.street_of(self.LONG)

    def start(self, street, out, *arguments, **options):
        """A run that has reported `lines` frames, one without a word."""
        return self.started("run", "--odometry", street, "--out", out, *arguments, **options)


class Disk(LongRuns):
    def test_output_folders_that_cannot_be_written(self):
        file = self.new_folder() / "file"
        file.touch()
        self.assert_all_refused(((f"{command} --out {file}/out", file) for command in ("run {street}", "synth", "odometry {street}")), code=1)

    def test_a_full_disk_leaves_whole_files(self):
        street, out = self.long_street(), self.new_folder()
        process = self.start(street, out, lines=3)  # by then the driver has written its kernel cache
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (4096, 4096))  # EFBIG: ENOSPC without a file system of its own
        _, errors = process.communicate(timeout=900)
        self.assertEqual(process.returncode, 1, errors)
        self.assertRegex(errors, r"^egosgm: error: .*disparity/\d{6}\.png.*\n$")
        self.assert_whole(out, at_least=3)

    def test_an_interrupt_ends_cleanly(self):
        street = self.long_street()
        for stop in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            out = self.new_folder()
            process = self.start(street, out)
            process.send_signal(stop)
            _, errors = process.communicate(timeout=900)
            self.assertEqual(process.returncode, 130, errors)
            self.assertIn("interrupted", errors)
            report = self.report(out)
            self.assertFalse(report["finished"])
            self.assertTrue(1 <= len(report["frames"]) < self.LONG)
            self.assertEqual(len((out / "poses.txt").read_text().splitlines()), len(report["frames"]))

    def test_a_signal_that_the_leader_of_the_group_sends_twice_is_one_interrupt(self):
        """As `timeout` does; here a shell. That it sleeps lets the two signals be two to the kernel: where they are one, there is less to see."""
        twice = '"$@" & read line; kill -TERM $!; sleep 0.1; kill -TERM $!; sleep 0.1; echo sent >&2; wait $!'
        street, out = self.long_street(), self.new_folder()
        process = self.start(street, out, command=("sh", "-c", twice, "sh", PROGRAM), stdin=subprocess.PIPE, start_new_session=True)
        process.stdin.write("\n")
        process.stdin.flush()
        while "sent" not in (line := process.stderr.readline()):  # the program waits to be read
            self.assertTrue(line)
        _, errors = process.communicate(timeout=900)
        self.assertEqual(process.returncode, 130, errors)
        self.assertTrue(self.report(out)["frames"])

    def test_a_second_signal_of_others_ends_the_program_at_once(self):
        street = self.broken_street()
        pipe = street / "image_0/000003.png"
        pipe.unlink()
        os.mkfifo(pipe)
        process = subprocess.Popen([PROGRAM, "run", street, "--out", self.new_folder() / "waits"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        writing = os.open(pipe, os.O_WRONLY)  # once it looks at the images' sizes: it waits for this one
        while process.poll() is None:
            process.send_signal(signal.SIGTERM)
            time.sleep(0.01)  # two that come together are one to the kernel
        self.assertEqual(process.returncode, -signal.SIGTERM)
        os.close(writing)

    def test_an_interrupt_loses_no_frame_that_was_only_read(self):
        """On a GPU the next frame is read while this one is told of; here by a layer that names the device so. The interrupt breaks off a write to
        a reader that waits, once a compiler has run, as here with an empty cache."""
        frames, out = FRAMES + 1, self.new_folder()
        gpu = dict(os.environ, OPENCL_LAYERS=os.environ["EGOSGM_GPU_LAYER"], POCL_CACHE_DIR=str(self.new_folder()))
        process = self.start(self.street_of(frames), out, "--disparities", 16, *FEW_KERNELS, env=gpu)
        while not (out / "disparity/000002.png").exists():  # after which its line finds no room
            self.assertIsNone(process.poll())
            time.sleep(0.01)
        time.sleep(0.2)  # until it waits, which a busy machine may do later: then there is less to see
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=900)
        self.assertEqual(process.returncode, 130, errors)
        report = self.report(out)
        self.assertEqual((report["finished"], len(report["frames"]), report["device"]["type"]), (False, frames - 1, "GPU"))

    def test_an_interrupt_is_no_error_of_a_pipe_that_is_waited_for(self):
        pipe, out, writer = self.new_folder() / "pipe", self.folder / "never", None
        os.mkfifo(pipe)
        process = subprocess.Popen([PROGRAM, "run", "--odometry", self.street, "--poses", pipe, "--out", out], stderr=subprocess.PIPE, text=True)
        while writer is None:
            try:
                writer = os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
            except OSError:  # nobody reads it yet
                self.assertIsNone(process.poll())
                time.sleep(0.01)
        time.sleep(0.1)  # until it has seen the writer, which a busy machine may do later: then it waits for another one
        process.send_signal(signal.SIGINT)
        os.close(writer)
        _, errors = process.communicate(timeout=900)
        self.assertEqual((process.returncode, errors), (130, "egosgm: interrupted\n"))
        self.assertFalse(out.exists())

    def test_what_others_put_there_while_it_runs_stays(self):
        street = self.long_street()
        for name in ("poses.txt", f"disparity/{self.LONG - 1:06d}.png"):
            out = self.new_folder()
            process = self.start(street, out)
            (out / name).write_text("mine")
            _, errors = process.communicate(timeout=900)
            self.assertEqual(process.returncode, 1, errors)
            self.assertIn(f"{name}: has come there while the run wrote, and stays", errors)
            self.assertEqual((out / name).read_text(), "mine")
            report = self.report(out)
            self.assertIn(name, report["stopped_by"])
            self.assert_refused(["run", "--odometry", street, "--out", out, "--resume"], name, code=2)
            self.assertEqual((out / name).read_text(), "mine")

    def test_of_two_runs_that_begin_together_in_one_folder_the_second_leaves_the_first(self):
        pipe, out = self.new_folder() / "pipe", self.new_folder() / "out"
        os.mkfifo(pipe)
        process = subprocess.Popen([PROGRAM, "run", self.street, "--poses", pipe, "--out", out], stderr=subprocess.PIPE, text=True)
        with open(pipe, "w") as writer:  # once the second has looked at the folder, and waits for its poses
            self.assert_works("run", "--odometry", self.street, "--out", out)
            files = {file: file.read_bytes() for file in out.rglob("*") if file.is_file()}
            writer.write((self.street / "poses.txt").read_text())
        _, errors = process.communicate(timeout=900)
        self.assertEqual((process.returncode, without_waiting(errors)), (1, f"egosgm: error: --out {out}: another run has begun there meanwhile: choose another folder\n"))
        self.assertEqual({file: file.read_bytes() for file in out.rglob("*") if file.is_file()}, files)

    def test_files_that_vanish_change_size_or_are_cut(self):
        """The last ones of a long sequence, while it runs."""
        street, out = self.long_street(), self.new_folder()
        last = [street / f"image_0/{i:06d}.png" for i in range(self.LONG - 3, self.LONG)]
        process = self.start(street, out, lines=2)
        last[0].unlink()
        last[1].write_bytes(grey_png(WIDTH, HEIGHT + 1))
        os.truncate(last[2], 1000)
        _, errors = process.communicate(timeout=900)
        self.assertEqual((process.returncode, errors), (0, ""))
        report = self.report(out)
        self.assertTrue(report["finished"])
        self.assertEqual([one["frame"] for one in report["left_out"]], list(range(self.LONG - 3, self.LONG)))
        for one, file, words in zip(report["left_out"], last, ("cannot be read", f"{WIDTH}x{HEIGHT + 1}", "truncated"), strict=True):
            self.assertIn(str(file), one["why"])
            self.assertIn(words, one["why"])
        self.assertEqual((self.assert_whole(out), len(report["frames"])), (self.LONG - 3, self.LONG - 3))

    def cut_short(self, *arguments, lines=1):
        """The program's exit code and standard error where the reader of its standard output goes after some lines."""
        with subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            for _ in range(lines):
                process.stdout.readline()
            process.stdout.close()
            errors = process.stderr.read()
        return process.returncode, without_waiting(errors)

    def test_a_reader_that_goes_ends_the_printing_not_the_work(self):
        folder, street = self.new_folder(), self.street
        out = folder / "run"
        self.assertEqual(self.cut_short("run", "--odometry", self.long_street(), "--out", out, lines=2), (0, ""))
        self.assertTrue(self.report(out)["finished"])
        self.assertEqual(self.assert_whole(out), self.LONG)
        self.assertEqual(len((out / "poses.txt").read_text().splitlines()), self.LONG)
        self.assertEqual(self.cut_short("odometry", street, "--out", folder / "poses.txt"), (0, ""))
        self.assertEqual(len((folder / "poses.txt").read_text().splitlines()), FRAMES)
        self.assertEqual(self.cut_short("synth", "--out", folder / "synth", "--frames", 3, "--width", 64, "--height", 48), (0, ""))
        self.assertTrue((folder / "synth/poses.txt").exists())
        if HAS_PACKAGE:
            self.assertEqual(self.cut_short("rectify", *self.patterns(), "--out", folder / "rectified"), (0, ""))
            self.assertEqual(len(list((folder / "rectified/image_0").iterdir())), FRAMES)
            self.assertTrue((folder / "rectified/calib.txt").exists())
        for command in (["eval", "--estimate", out, "--truth", self.street / "truth/left_disp_noc"], ["run", "--help"], ["devices"]):
            self.assertEqual(self.cut_short(*command, lines=0), (0, ""))

    def test_a_full_disk_under_the_standard_output_ends_the_printing_too(self):
        out = self.new_folder()
        with open("/dev/full", "w") as full:
            done = subprocess.run([PROGRAM, "run", "--odometry", self.long_street(), "--out", out], stdout=full, stderr=subprocess.PIPE,
                                  text=True, timeout=900)
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, r"^(egosgm: compiling .*\n)?egosgm: error: the standard output cannot be written: No space left on device\n$")
        self.assertTrue(self.report(out)["finished"])
        self.assertEqual(self.assert_whole(out), self.LONG)

    def test_a_file_system_without_room(self):
        out = self.new_folder()
        inside = f"'{PROGRAM}' run --odometry '{self.long_street()}' --out '{out}'; echo code $?; ls -A '{out}/disparity'; cat '{out}/report.json'"
        done = subprocess.run([*with_small_disk(out, "size=96k"), "sh", "-c", inside], capture_output=True, text=True, timeout=900)
        self.assertIn("code 1\n", done.stdout)
        self.assertRegex(done.stderr, r"^(egosgm: compiling .*\n)?egosgm: error: .*disparity/\d{6}\.png.*No space left on device.*\n$")
        left = done.stdout.split("code 1\n")[1]
        self.assertNotIn(".part", left)
        self.assertFalse(json.loads(left[left.index("{"):])["finished"])

    def test_a_folder_without_rights(self):
        out, cache = self.new_folder(), self.new_folder()
        for folder in (self.folder, out):
            folder.chmod(0o755)
        self.assert_refused(["run", "--odometry", self.street, "--out", out, *FEW_KERNELS], out, "Permission denied", code=1, **as_nobody(cache))
        self.assertEqual(list(out.iterdir()), [])


class Fallback(LongRuns):
    """A device that is lost while a run is under way, by the fault layer: the run's first context, from some command on."""

    def lost_at(self, command):
        return dict(os.environ, OPENCL_LAYERS=os.environ["EGOSGM_FAULT_LAYER"], EGOSGM_FAILING_CONTEXT=f"0/{command}")

    def commands_of_a_run(self, run):
        """The first command whose loss no run of this kind sees, to within a frame."""
        least, most = 0, 4096
        while most - least > 32:
            middle = (least + most) // 2
            worked = egosgm(*run, self.new_folder(), env=self.lost_at(middle)).returncode == 0
            least, most = (least, middle) if worked else (middle, most)
        return least

    def test_another_device_goes_on_with_the_same_bits(self):
        run = ["run", "--odometry", self.street, "--disparities", 32, "--write", "variance", "--quiet", "--out"]
        expected = self.ran(*run[1:-1])
        last = self.commands_of_a_run(run)
        for command in (0, last // 2, last * 3 // 4, last):
            out, trace = self.new_folder(), self.new_folder() / "trace.json"
            failed = egosgm(*run, self.new_folder(), env=self.lost_at(command))
            self.assertEqual(failed.returncode, 1)
            self.assertIn("CL_DEVICE_NOT_AVAILABLE", failed.stderr)
            done = egosgm(*run, out, "--fallback", "cpu", "--trace", trace, env=self.lost_at(command))
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertRegex(done.stderr, r"^egosgm: .* failed \(.*CL_DEVICE_NOT_AVAILABLE.*\): .* goes on\n$")
            self.assert_same_files(out, expected, "**/0*.*", "poses.txt")
            report = self.report(out)
            self.assertTrue(report["finished"])
            self.assertEqual(report["fallback"]["from"], report["device"])
            self.assertIn("CL_DEVICE_NOT_AVAILABLE", report["fallback"]["why"])
            self.assertEqual([frame["frame"] for frame in report["frames"]], list(range(FRAMES)))
        self.assertNotIn("fallback", self.report(expected))

    def test_a_device_that_is_not_there_is_refused_before_the_first_frame(self):
        out = self.new_folder() / "out"
        self.assert_refused(["run", self.street, "--out", out, "--fallback", "no such device"], "no such device")
        self.assertFalse(out.exists())
