# SPDX-License-Identifier: Apache-2.0
"""egosgm compile and egosgm batch from outside: devices, shards, failures, kills. Environment as for program_case.py, and
EGOSGM_FAULT_LAYER: the OpenCL layer that fails."""
import fcntl
import json
import math
import os
import pathlib
import re
import shutil
import signal
import struct
import subprocess
import time
import unittest

from program_case import EXAMPLES, PROGRAM, SOURCE, ProgramTest, egosgm

LAYER = os.environ["EGOSGM_FAULT_LAYER"]
SEQUENCES = 4
METHOD = ("--disparities", 32)


class BatchTest(ProgramTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        for i in range(SEQUENCES):
            done = egosgm("synth", "--out", cls.folder / f"s{i}", "--frames", 3, "--width", 160, "--height", 64, "--seed", i, "--quiet")
            assert done.returncode == 0, done.stderr
        cls.list = cls.folder / "list.txt"
        lines = [f"street-{i} {cls.folder}/s{i}" for i in range(SEQUENCES)]
        lines[3] = lines[3].replace("street-3", "more/street-3")
        lines[1] += f" --poses '{cls.folder}/s1/poses.txt' --frames 1:2  # a comment"
        cls.list.write_text("# NAME INPUT\n\n" + "\n".join(lines) + "\n")
        cls.programs = cls.folder / "programs"  # quicker than compiling for each sequence
        done = egosgm("compile", "--device", "0", "--out", cls.programs, *METHOD)
        assert done.returncode == 0, done.stderr
        cls.expected = cls.folder / "expected"
        done = egosgm(*cls.batch(cls.expected, "--devices", "0"))
        assert done.returncode == 0, done.stderr

    @classmethod
    def batch(cls, out, *arguments):
        return ["batch", cls.list, "--out", out, "--programs", cls.programs, *METHOD, *arguments]

    def assert_same(self, out):
        """The report, and every map."""
        self.assertEqual((out / "batch.json").read_text(), (self.expected / "batch.json").read_text())
        maps = sorted(file.relative_to(self.expected) for file in self.expected.rglob("disparity/*"))
        self.assertEqual(maps, sorted(file.relative_to(out) for file in out.rglob("disparity/*")))
        for file in maps:
            self.assertEqual((out / file).read_bytes(), (self.expected / file).read_bytes(), file)

    def timing(self, out, name="timing"):
        return json.loads((out / f"{name}.json").read_text())

    def two_devices(self):
        """Compute units stand in for devices."""
        units = json.loads(self.assert_works("devices", "--json"))[0]["compute_units"]
        if units < 2:
            self.skipTest("the device has one compute unit")
        return "0/0,0/1"


class Compile(ProgramTest):
    def test_the_same_bits_as_compiling_and_refused_elsewhere(self):
        programs, compiled, loaded = self.new_folder() / "programs", self.new_folder(), self.new_folder()
        self.assertIn("programs for", self.assert_works("compile", "--out", programs, "--disparities", 32))
        manifest = json.loads((programs / "manifest.json").read_text())
        self.assertEqual(sorted(file.name for file in programs.iterdir()),
                         sorted(["manifest.json"] + [program["file"] for program in manifest["programs"]]))
        run = ["run", "--odometry", self.street, "--disparities", 32, "--quiet", "--out"]
        self.assert_works(*run, compiled)
        self.assert_works(*run, loaded, "--programs", programs)
        for file in compiled.glob("disparity/*"):
            self.assertEqual(file.read_bytes(), (loaded / "disparity" / file.name).read_bytes(), file.name)
        self.assert_refused([*run, self.new_folder(), "--programs", programs, "--paths", 8], "manifest.json", "-DPATHS=8", "egosgm compile")
        self.assert_refused([*run, self.new_folder(), "--programs", self.new_folder()], "manifest.json", "egosgm compile")
        (programs / "manifest.json").write_text(json.dumps(dict(manifest, driver="0.0")))
        self.assert_refused([*run, self.new_folder(), "--programs", programs], "driver", "0.0", manifest["driver"], "egosgm compile")
        (programs / "manifest.json").unlink()
        os.mkfifo(programs / "manifest.json")
        self.assert_refused([*run, self.new_folder(), "--programs", programs], "manifest.json", "is no file that can be read", "egosgm compile")

    def test_spirv_for_every_device_of_the_type_is_refused_where_it_is_not_taken(self):
        version = subprocess.run(["clang", "-dumpversion"], capture_output=True, text=True).stdout.split(".")[0] if shutil.which("clang") else ""
        translator = next(filter(shutil.which, (f"llvm-spirv-{version}", "llvm-spirv")), None)
        if not translator:
            self.skipTest("no clang, or no llvm-spirv of its version")
        programs = self.new_folder() / "programs"
        self.assert_refused(["compile", "--il", "--clang", "no-such-clang", "--out", programs], "no-such-clang", "--clang")
        self.assert_refused(["compile", "--il", "--llvm-spirv", "false", "--out", programs], "false failed")
        self.assertFalse(programs.exists())
        self.assertIn("that takes SPIR-V", self.assert_works("compile", "--il", "--llvm-spirv", translator, "--out", programs, *METHOD))
        manifest = json.loads((programs / "manifest.json").read_text())
        self.assertNotIn("driver", manifest)
        for program in manifest["programs"]:
            self.assertEqual((programs / program["file"]).read_bytes()[:4], b"\x03\x02\x23\x07", program["file"])
            self.assertNotIn("COUNTS_BITS", program["options"])
        run = ["run", "--odometry", self.street, "--out", self.new_folder(), "--programs", programs, *METHOD]
        done = egosgm(*run)
        if done.returncode != 0:  # the system's PoCL takes none; scripts/drivers runs them where they are taken
            self.assertIn("holds SPIR-V, which", done.stderr)
            return
        (programs / manifest["programs"][0]["file"]).write_bytes(b"\x03\x02\x23\x07")
        self.assert_refused([*run, "--overwrite"], "is not the file that its manifest speaks of")


class DeviceBuffers(ProgramTest):
    """examples/device_buffers.cpp: kernels of its own before and after the pipeline's."""

    def pfm(self, file):
        kind, size, scale, values = file.read_bytes().split(b"\n", 3)
        self.assertEqual((kind, float(scale)), (b"Pf", -1))
        width, height = map(int, size.split())
        return struct.unpack(f"<{width * height}f", values)

    def test_depth_is_that_of_runs_disparities(self):
        out, own = self.new_folder(), self.new_folder()
        self.assert_works("run", "--odometry", self.street, "--out", out, "--write", "pfm", "--quiet")
        subprocess.run([EXAMPLES / "egosgm_example_device_buffers", self.street], cwd=own, check=True, timeout=600)
        camera = self.report(out)["calibration"]
        single = lambda value: struct.unpack("<f", struct.pack("<f", value))[0]
        focal_times_baseline = single(camera["fx"] * camera["baseline_m"])
        self.assertEqual(camera["doffs_px"], 0)
        maps = sorted((out / "pfm").iterdir())
        self.assertEqual([file.name for file in maps], sorted(file.name for file in own.iterdir()))
        for file in maps:
            disparities = self.pfm(file)
            expected = [single(focal_times_baseline / d) if 0 < d < math.inf else math.inf for d in disparities]
            self.assertEqual(list(self.pfm(own / file.name)), expected, file.name)
            self.assertGreater(sum(depth < math.inf for depth in expected), len(expected) // 2)


class Batch(BatchTest):
    def test_gives_what_run_gives_and_pools_what_eval_counts(self):
        out = self.new_folder()
        self.assert_works("run", "--dataset", self.folder / "s2", "--out", out, *METHOD)
        for file in out.glob("disparity/*"):
            self.assertEqual(file.read_bytes(), (self.expected / "street-2/disparity" / file.name).read_bytes(), file.name)
        report = json.loads((self.expected / "batch.json").read_text())
        self.assertEqual([s["name"] for s in report["sequences"]], ["street-0", "street-1", "street-2", "more/street-3"])
        self.assertEqual([s["frames"] for s in report["sequences"]], [3, 2, 3, 3])
        bad = truth = 0
        for i, sequence in enumerate(report["sequences"]):
            text = self.assert_works("eval", "--estimate", self.expected / sequence["name"], "--truth",
                                     self.folder / f"s{i}/truth/left_disp_noc", "--json")
            pixels = sum(pair["truth_pixels"] for pair in json.loads(text)["pairs"])
            self.assertEqual(pixels, sequence["noc"]["truth"])
            bad += json.loads(text)["pooled"]["bad_or_missing"] * pixels
            truth += pixels
        self.assertAlmostEqual(report["pooled"]["noc"]["bad_or_missing"], bad / truth, places=9)

    def test_overwriting_a_part_with_other_options_mixes_nothing(self):
        out, other = self.new_folder(), ("--set", "p2=20", "--programs", self.new_folder() / "programs")
        self.assert_works("compile", "--device", "0", "--out", other[-1], *METHOD, "--set", "p2=20")
        self.assert_works(*self.batch(out))
        batch = ["batch", self.list, "--out", out, *METHOD, *other]
        self.assert_works(*batch, "--overwrite", "--shard", "0/2")
        self.assert_refused([*batch, "--merge"], "2 of 4 sequences are not done", "street-1", "with these options", code=1)
        self.assert_works(*batch, "--shard", "1/2")
        self.assert_works(*batch, "--merge")
        for i in range(SEQUENCES - 1):
            self.assertEqual(self.report(out / f"street-{i}")["options"]["p2"], 20)

    def test_a_range_beyond_kittis_png_loses_nothing(self):
        """Seen from the other side, all disparities are negative."""
        folder = self.new_folder()
        shutil.copytree(self.folder / "s0", folder / "seen")
        (folder / "seen/image_0").rename(folder / "left")
        (folder / "seen/image_1").rename(folder / "seen/image_0")
        (folder / "left").rename(folder / "seen/image_1")
        shutil.rmtree(folder / "seen/truth")
        (folder / "list.txt").write_text(f"seen {folder}/seen\n")
        method = ("--disparities", 40, "--min-disparity", -39)
        self.assert_works("batch", folder / "list.txt", "--out", folder / "out", *method, "--write", "right,interpolated")
        maps = {file.suffix for kind in ("disparity", "right", "interpolated") for file in (folder / f"out/seen/{kind}").iterdir()}
        self.assertEqual(maps, {".pfm"})
        text = self.assert_works("eval", folder / "out/seen", folder / "out/seen/disparity", "--json")
        self.assertGreater(sum(pair["truth_pixels"] for pair in json.loads(text)["pairs"]), 1000)
        self.assert_works("report", folder / "out/seen")

    def test_without_truth_there_are_no_metrics(self):
        plain, out, s0 = self.new_folder() / "list.txt", self.new_folder(), self.folder / "s0"
        plain.write_text(f"plain --left {s0}/image_0/%06d.png --right {s0}/image_1/%06d.png --calib {s0}/calib.txt --frames 0\n")
        text = self.assert_works("batch", plain, "--out", out, "--programs", self.programs, *METHOD)
        self.assertIn("\n1 sequence, 1 frame: ", text)

    def test_devices_share_the_sequences(self):
        out = self.new_folder()
        text = self.assert_works(*self.batch(out, "--devices", self.two_devices()))
        self.assertIn(f"[{SEQUENCES}/{SEQUENCES}]", text)
        self.assert_same(out)
        self.assertEqual([d["name"][-2:] for d in self.timing(out)["devices"]], ["/0", "/1"])
        self.assertEqual(sum(d["sequences"] for d in self.timing(out)["devices"]), SEQUENCES)
        timing = self.timing(out)
        self.assertEqual(timing["frames"], 11)
        self.assertAlmostEqual(timing["frames_per_second_per_compute_unit"] * 2, timing["frames_per_second"])
        for meter in ("cpu", "gpu"):  # where the machine has none, it says so
            joules = timing[f"{meter}_joules_per_frame"]
            self.assertIn(f"{meter.upper()} " + ("not told" if joules is None else f"{joules:.3f} J"), text)

    def test_shards_by_argument_slurm_and_kubernetes_merge_to_one_report(self):
        out = self.new_folder()
        merge = self.batch(out, "--merge", "--quiet")
        self.assert_works(*self.batch(out, "--shard", "1/4"))
        self.assertFalse((out / "batch.json").exists())
        done = egosgm(*merge)
        self.assertEqual(done.returncode, 1)
        self.assertIn("3 of 4 sequences are not done, the first is street-0", done.stderr)
        slurm = dict(os.environ, SLURM_ARRAY_TASK_ID="6", SLURM_ARRAY_TASK_MIN="2", SLURM_ARRAY_TASK_STEP="2",
                     SLURM_ARRAY_TASK_COUNT="4")
        self.assert_works(*self.batch(out), env=slurm)
        self.assertTrue((out / "timing-2-of-4.json").exists())
        kubernetes = dict(os.environ, JOB_COMPLETION_INDEX="0")
        self.assert_works(*self.batch(out, "--shards", 2), env=kubernetes)
        self.assertEqual(self.timing(out, "timing-0-of-2")["frames"], 3)  # street-2 was done
        self.assert_works(*self.batch(out, "--shard", "3/4"))
        self.assert_works(*merge)
        self.assert_same(out)

    def test_the_pods_of_the_kubernetes_manifest_merge_to_one_report(self):
        """Its command, once for each index, with the folder in the place of the volume."""
        manifest, out = (SOURCE / "examples/cluster/batch.yaml").read_text(), self.new_folder()
        pods = int(re.search(r"completions: (\d+)", manifest)[1])
        command = json.loads(re.search(r"command: (\[.*\])", manifest)[1])
        self.assertEqual(int(command[command.index("--shards") + 1]), pods)
        place = {"egosgm": PROGRAM, "/data/list.txt": str(self.list), "/data/results": str(out)}
        self.assertTrue(place.keys() <= set(command))
        for index in range(pods):
            done = subprocess.run([*(place.get(word, word) for word in command), "--programs", self.programs, *map(str, METHOD)],
                                  capture_output=True, text=True, timeout=600, env=dict(os.environ, JOB_COMPLETION_INDEX=str(index)))
            self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assert_works(*self.batch(out, "--merge", "--quiet"))
        self.assert_same(out)

    def test_what_is_done_is_not_done_again(self):
        out = self.new_folder()
        shutil.copytree(self.expected, out, dirs_exist_ok=True)
        (out / "more/street-3/done.json").unlink()
        self.assertIn("[1/1] more/street-3: 3 frames", self.assert_works(*self.batch(out)))
        self.assertNotIn("[1/", self.assert_works(*self.batch(out)))
        self.assert_same(out)

    def test_after_a_kill_or_an_interrupt_it_goes_on(self):
        for how, code in ((signal.SIGKILL, -signal.SIGKILL), (signal.SIGTERM, 130)):
            out = self.new_folder()
            process = self.started(*self.batch(out, "--devices", "0"))
            self.assertTrue((out / "street-0/done.json").exists())
            process.send_signal(how)
            process.communicate()
            self.assertEqual(process.returncode, code)
            self.assertFalse((out / "more/street-3/done.json").exists())
            self.assert_works(*self.batch(out, "--devices", "0"))
            self.assert_same(out)

    def flocked(self, path, how):
        """Whether another process lets it be locked now; it stays so until the descriptor is closed."""
        descriptor = os.open(path, os.O_RDONLY)
        self.addCleanup(os.close, descriptor)
        try:
            fcntl.flock(descriptor, how | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            return False

    def test_one_batch_at_a_time_has_the_folder(self):
        out = self.new_folder()
        shutil.copytree(self.expected, out, dirs_exist_ok=True)
        self.assertTrue(self.flocked(out, fcntl.LOCK_SH))  # as another shard
        self.assert_refused(self.batch(out), f"--out {out}", "another egosgm is writing there")
        self.assert_works(*self.batch(out, "--shard", "0/2"))
        self.assertTrue(self.flocked(out, fcntl.LOCK_UN))

        out = self.new_folder()
        process = self.started(*self.batch(out, "--devices", "0"))
        self.assertFalse((out / "more/street-3").exists())  # it waits for its lines to be read
        self.assertFalse(self.flocked(out, fcntl.LOCK_SH))
        (out / "more/street-3").mkdir(parents=True)
        (out / "more/street-3/files.part").touch()
        self.assertTrue(self.flocked(out / "more/street-3/files.part", fcntl.LOCK_EX))  # as the same shard once more
        _, errors = process.communicate(timeout=600)
        self.assertEqual(process.returncode, 2, errors)
        self.assertIn(f"{out}/more/street-3: another egosgm is writing there", errors)
        self.assertEqual(list(out.rglob("failed.json")), [])

    def test_a_device_that_fails_hands_its_sequence_to_another(self):
        out = self.new_folder()
        devices = self.two_devices()
        lost = dict(os.environ, OPENCL_LAYERS=LAYER, EGOSGM_FAILING_CONTEXT="0/80")  # after its first frame
        text = self.assert_works(*self.batch(out, "--devices", devices), env=lost)
        self.assertIn("handed to another device", text)
        self.assert_same(out)
        self.assertEqual(sorted(d["retired"] for d in self.timing(out)["devices"]), [False, True])
        self.assertEqual(list(out.rglob("failed.json")), [])

    def test_an_interrupt_is_no_failure_of_the_device(self):
        """PoCL's compiler takes the signal for itself, too, and fails by it; here the fault layer fails after it."""
        street, out = self.broken_street(), self.new_folder()
        pipe = street / "image_0/000003.png"
        image = pipe.read_bytes()
        pipe.unlink()
        os.mkfifo(pipe)
        (out / "list").write_text(f"a {street}\n")
        lost = dict(os.environ, OPENCL_LAYERS=LAYER, EGOSGM_FAILING_CONTEXT="0/0")
        for command in (["run", street, "--out", out / "run"], ["batch", out / "list", "--devices", "0", "--out", out / "batch"]):
            with subprocess.Popen([PROGRAM, *command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=lost) as process:
                writing = os.open(pipe, os.O_WRONLY)  # once it looks at the images' sizes
                process.send_signal(signal.SIGTERM)
                while "ShdPnd:\t0000000000000000" not in pathlib.Path(f"/proc/{process.pid}/status").read_text():
                    time.sleep(0.01)  # until a thread takes the signal
                os.write(writing, image)
                os.close(writing)
                errors = process.stderr.read()
            self.assertEqual(process.returncode, 130, errors)
            self.assertNotIn("egosgm: error", errors)
        self.assertEqual(list(out.rglob("failed.json")), [])

    def test_where_the_only_device_fails_the_others_sequences_go_on(self):
        out = self.new_folder()
        lost = dict(os.environ, OPENCL_LAYERS=LAYER, EGOSGM_FAILING_CONTEXT="1/0")
        self.assert_refused(self.batch(out, "--devices", "0"), "1 of 4 sequences are not done, the first is street-1",
                            "CL_DEVICE_NOT_AVAILABLE", code=1, env=lost)
        self.assertEqual(len(list(out.rglob("done.json"))), SEQUENCES - 1)
        self.assert_works(*self.batch(out, "--devices", "0"))
        self.assert_same(out)

    def test_a_broken_sequence_does_not_stop_the_others(self):
        out, image = self.new_folder(), self.folder / "s0/image_0/000001.png"
        whole = image.read_bytes()
        image.write_bytes(whole[:100])
        try:
            self.assert_refused(self.batch(out), "1 of 4 sequences are not done, the first is street-0", image, code=1)
        finally:
            image.write_bytes(whole)
        report = json.loads((out / "batch.json").read_text())
        self.assertEqual((report["sequences_done"], report["sequences_failed"]), (SEQUENCES - 1, 1))
        self.assertIn(str(image), report["sequences"][0]["failed"])
        self.assert_works(*self.batch(out))
        self.assert_same(out)

    def test_refuses_what_does_not_fit_together(self):
        out = self.new_folder()
        shutil.copytree(self.expected, out, dirs_exist_ok=True)
        self.assert_refused(["batch", self.list, "--out", out, "--disparities", 16], "disparities", "32", "16", "another --out")
        self.assert_refused(["batch", self.list, "--out", out, *METHOD, "--write", "variance"], "write", "another --out")
        other = self.new_folder() / "list.txt"
        other.write_text(f"street-0 {self.folder}/s1\n")
        self.assert_refused(["batch", other, "--out", out, *METHOD], "street-0", "choose another name")

    def test_refuses_a_device_that_is_not_there_and_one_that_comes_twice(self):
        out = self.new_folder() / "out"
        count = len(json.loads(self.assert_works("devices", "--json")))
        self.assert_refused(self.batch(out, "--devices", f"0,{count}"), f"no OpenCL device {count}: there ")
        self.assert_refused(self.batch(out, "--devices", "0,0"), "--devices 0,0", "once")
        self.assert_refused(self.batch(out, "--devices", "0,"), "--devices")
        parts = self.two_devices()
        for twice in ("0/0,0", "0,0/1", "0/each,0/1", "0/0-1,0/0"):
            self.assert_refused(self.batch(out, "--devices", twice), f"--devices {twice}", "share compute units")
        self.assertFalse(out.exists())
        self.assert_works(*self.batch(out, "--devices", parts.replace(",", " , ")))

    def test_refuses_wrong_arguments(self):
        out = self.new_folder() / "out"
        for arguments, named in ((["--devices", "no such device"], ["no such device"]), (["--devices", ","], ["--devices"]), (["--devices", "0,,0"], ["--devices"]),
                                 (["--devices", "0/99"], ["compute units 99"]), (["--shard", "4/4"], ["4 of 4", "from 0"]),
                                 (["--shard", "1"], ["K/N"]), (["--shard", "x/2"], ["\"x\""]), (["--shard", "0/0"], ["--shard"])):
            self.assert_refused(self.batch(out, *arguments), *named)
        alone = dict(os.environ, JOB_COMPLETION_INDEX="0")
        self.assert_refused(self.batch(out), "--shards N", env=alone)
        broken = self.new_folder() / "list.txt"
        for text, named in (("", ["names no sequence"]), ("a//b x\n", ["line 1", "a//b"]), ("a/../b x\n", ["line 1", "a/../b"]), ("/a x\n", ["line 1"]), ("a x\n\na y\n", ["line 3", "twice"]),
                            ("a --odometri x\n", ["line 1", "--odometri"]), (".a x\n", [".a"]), (f"a {self.folder}/s0\nb\n", ["line 2: no input"]),
                            (f"a {self.folder}/s0 --frames 9\n", ["line 1", "000009.png"]), (f"# a\nb {self.folder}/s9\n", ["line 2", "did you mean"]),
                            (f"a {self.folder}/s0 --poses {self.folder}/s0/pose.txt\n", ["line 1", "did you mean"])):
            broken.write_text(text)
            self.assert_refused(["batch", broken, "--out", out], "list.txt", *named)
        self.assert_refused(["batch", self.folder / "nowhere", "--out", out], "nowhere")


if __name__ == "__main__":
    unittest.main()
