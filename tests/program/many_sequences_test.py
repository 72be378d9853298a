# SPDX-License-Identifier: Apache-2.0
"""egosgm compile, device buffers, and a list of sequences by examples/cluster/run_line. Environment as for program_case.py, and
EGOSGM_FAULT_LAYER: the OpenCL layer that fails."""
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

from program_case import EXAMPLES, PROGRAM, SOURCE, ProgramTest, egosgm

LAYER = os.environ["EGOSGM_FAULT_LAYER"]
METHOD = ("--disparities", 32)


class Compile(ProgramTest):
    def test_an_interrupt_leaves_nothing(self):
        """It comes while a compiler runs, which may end by it, too, or have done its part."""
        tools, scratch, out = self.new_folder(), self.new_folder(), self.folder / "never"
        compiler = tools / "compiler"
        for code in (0, 1):
            compiler.write_text(f"#!/bin/sh\nkill -INT $PPID\nfor file; do :; done\necho >> {tools}/calls\ntouch $file\nexit {code}\n")
            compiler.chmod(0o755)
            done = egosgm("compile", "--il", "--clang", compiler, "--llvm-spirv", compiler, "--out", out, *METHOD, env=dict(os.environ, TMPDIR=str(scratch)))
            self.assertEqual((done.returncode, done.stdout, done.stderr), (130, "", "egosgm: interrupted\n"))
            self.assertFalse(out.exists())
            self.assertEqual(list(scratch.iterdir()), [])
        self.assertEqual(len((tools / "calls").read_text()), 2)  # once each time

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
        run[run.index("--out") + 1] = self.new_folder()
        self.assert_refused(run, "is not the file that its manifest speaks of")


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
        subprocess.run([EXAMPLES / "egosgm_example_device_buffers", self.street], cwd=own, check=True, timeout=900)
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


class ManySequences(ProgramTest):
    SEQUENCES = 4

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        for i in range(cls.SEQUENCES):
            done = egosgm("synth", "--out", cls.folder / f"s {i}", "--frames", 3, "--width", 160, "--height", 64, "--seed", i, "--quiet")
            assert done.returncode == 0, done.stderr
        cls.list = cls.folder / "list.txt"
        cls.names = ["street-0", "street-1", "street-2", "more/street-3"]
        lines = [f"{name} '{cls.folder}/s {i}'" for i, name in enumerate(cls.names)]
        lines[1] += f" --poses '{cls.folder}/s 1/poses.txt' --frames 1:2  # a comment"
        cls.list.write_bytes("\r\n".join(["# NAME INPUT", "", *lines, ""]).encode())  # as some editors write

    def run_line(self, index, out, *arguments, code=0):
        done = subprocess.run([SOURCE / "examples/cluster/run_line", self.list, str(index), out, *map(str, METHOD), "--quiet", *arguments],
                              capture_output=True, text=True, timeout=900, env=dict(os.environ, EGOSGM=PROGRAM))
        self.assertEqual(done.returncode, code, done.stderr)
        return done.stderr

    def test_a_line_gives_what_run_gives(self):
        out, own = self.new_folder(), self.new_folder()
        self.run_line(1, out)
        self.assert_works("run", self.folder / "s 1", "--poses", self.folder / "s 1/poses.txt", "--frames", "1:2", *METHOD, "--out", own)
        for file in own.glob("disparity/*"):
            self.assertEqual(file.read_bytes(), (out / "street-1/disparity" / file.name).read_bytes(), file.name)
        self.assertEqual(len(list(out.glob("street-1/disparity/*"))), 2)
        self.assertIn("has no line 4", self.run_line(self.SEQUENCES, out, code=2))
        for index in ("", "x", "-1"):  # as of a job that is no array's
            self.assertIn("give the number of a line", self.run_line(index, out, code=2))
        whole = self.list.read_text()
        try:
            for text, said in (("# none\n", "has no line 0"), (f"name '{self.folder}/s 1' --set \"p1=5\n", "a quote without an end"),
                               (f"../name '{self.folder}/s 1'\n", "leads out of"), (f"'a' '{self.folder}/s 1'\na '{self.folder}/s 2'\n", 'lines 0 and 1 of')):
                self.list.write_text(text)
                self.assertIn(said, self.run_line(0, out, code=2))
        finally:
            self.list.write_text(whole)

    def test_a_stopped_sequence_goes_on_and_a_finished_one_is_left_alone(self):
        out = self.new_folder()
        self.run_line(0, out)
        report, last = out / "street-0/report.json", out / "street-0/disparity/000002.png"
        times = report.stat().st_mtime_ns
        self.run_line(0, out)
        self.assertEqual(report.stat().st_mtime_ns, times)
        self.assertIn("is finished, and was made of", self.run_line(0, out, "--set", "p2=100", code=2))
        whole = last.read_bytes()
        stopped, images = self.new_folder(), [self.folder / f"s 0/image_0/00000{i}.png" for i in (1, 2)]
        pixels = [image.read_bytes() for image in images]
        for image in images:
            os.truncate(image, 500)
        try:
            self.assertIn("000001.png", self.run_line(0, stopped, code=2))
            self.assertFalse(self.report(stopped / "street-0")["finished"])
        finally:
            for image, whole_image in zip(images, pixels):
                image.write_bytes(whole_image)
        self.run_line(0, stopped)
        self.assertEqual((stopped / "street-0/disparity/000002.png").read_bytes(), whole)
        self.assertTrue(self.report(stopped / "street-0")["finished"])

    def test_the_pods_of_the_kubernetes_manifest_do_the_list(self):
        """Its command, once for each index, with the folder in the place of the volume; the figures of all are pooled."""
        manifest, out, tools = (SOURCE / "examples/cluster/sequences.yaml").read_text(), self.new_folder(), self.new_folder()
        self.assertEqual(int(re.search(r"completions: (\d+)", manifest)[1]), self.SEQUENCES)
        command = json.loads(re.search(r"command: (\[.*\])", manifest)[1])
        command[2] = command[2].replace("/data/list.txt", f"'{self.list}'").replace("/data/results", f"'{out}'") + " --disparities 32 --quiet"
        (tools / "run_line").symlink_to(SOURCE / "examples/cluster/run_line")
        reports, pixels, bad = [], 0, 0
        for index, name in enumerate(self.names):
            done = subprocess.run(command, capture_output=True, text=True, timeout=900,
                                  env=dict(os.environ, JOB_COMPLETION_INDEX=str(index), EGOSGM=PROGRAM, PATH=f"{tools}:{os.environ['PATH']}"))
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            reports.append(out / f"{index}.json")
            reports[-1].write_text(self.assert_works("eval", out / name, self.folder / f"s {index}/truth/left_disp_noc", "--json"))
            one = json.loads(reports[-1].read_text())
            of_one = sum(pair["truth_pixels"] for pair in one["pairs"])
            pixels, bad = pixels + of_one, bad + of_one * one["pooled"]["bad_or_missing"]
        merged = json.loads(self.assert_works("eval", "--merge", *reports, "--json"))
        self.assertEqual((merged["reports"], merged["pairs"]), (self.SEQUENCES, 3 + 2 + 3 + 3))
        self.assertAlmostEqual(merged["pooled"]["bad_or_missing"], bad / pixels, places=9)
        self.assertEqual(json.loads(self.assert_works("eval", "--merge", reports[0], "--json"))["pooled"], json.loads(reports[0].read_text())["pooled"])
        self.assertIn("pooled", self.assert_works("eval", "--merge", *reports))
        text = reports[0].read_text()
        wrong = [("truth", count) for count in ("-5", "1", "1.5", "1e300", "true")]
        wrong += [("d1", -1), ("d1_interpolated", -1), ("sky_valid", -1), ("absolute_error_px", -1), ("signed_error_px", "1e9"), ("signed_error_px", "-1e9")]
        for broken in ('{"pairs": [{}]}', '{"pairs": []}', *(re.sub(rf'("{name}":) [-.\d]+', rf"\1 {count}", text, count=1) for name, count in wrong)):
            (out / "no.json").write_text(broken)
            self.assert_refused(["eval", "--merge", reports[1], out / "no.json"], "no.json", "egosgm eval --json")
        part, first = self.new_folder() / "part.json", json.loads(text)
        part.write_text(json.dumps(first | {"pairs": first["pairs"][1:]}))
        for again in (out / f"../{out.name}/0.json", part):
            self.assert_refused(["eval", "--merge", *reports, again], again, f"holds pairs of {reports[0]}", "once")
        part.write_text(re.sub(r'("signed_error_px":) -?', r"\1 -", text))  # estimates that look too far
        self.assertLess(json.loads(self.assert_works("eval", "--merge", part, "--json"))["pooled"]["mean_error"], 0)
        part.write_text(json.dumps(first | {"warnings": ["another scale?"]}))
        self.assertIn(f"{part}: another scale?", self.assert_works("eval", "--merge", part))
        self.assertEqual(json.loads(self.assert_works("eval", "--merge", part, "--json"))["warnings"], [f"{part}: another scale?"])
        self.assert_refused(["eval", "--merge", reports[0], "--mask", reports[1]], "--merge")
        self.assert_refused(["eval", out / "street-0", "--merge", reports[0]], "--merge")

    def test_a_task_of_slurm_goes_back_into_the_queue_where_it_may_pass(self):
        """The script of the job array, with commands in the place of run_line and scontrol."""
        tools = self.new_folder()
        for name, body in (("run_line", 'echo "$@"; exit $CODE'), ("scontrol", 'echo "scontrol $@"')):
            (tools / name).write_text(f"#!/bin/sh\n{body}\n")
            (tools / name).chmod(0o755)
        again = "exit code 1: task 3 goes back into the queue\nscontrol requeue 7_3\n"
        for code, restarts, said in ((0, 0, ""), (1, 2, again), (1, 3, ""), (2, 0, "")):
            slurm = dict(SLURM_ARRAY_JOB_ID="7", SLURM_ARRAY_TASK_ID="3", SLURM_RESTART_COUNT=str(restarts))
            done = subprocess.run(["bash", SOURCE / "examples/cluster/sequences.sbatch", "list", "out", "--quiet"], capture_output=True, text=True, timeout=60,
                                  env=dict(os.environ, **slurm, CODE=str(code), RUN_LINE=str(tools / "run_line"), PATH=f"{tools}:{os.environ['PATH']}"))
            self.assertEqual((done.returncode, done.stdout), (code, "list 3 out --quiet\n" + said))

    def test_a_range_beyond_kittis_png_loses_nothing(self):
        """Seen from the other side, all disparities are negative."""
        folder = self.new_folder()
        shutil.copytree(self.folder / "s 0", folder / "seen")
        (folder / "seen/image_0").rename(folder / "left")
        (folder / "seen/image_1").rename(folder / "seen/image_0")
        (folder / "left").rename(folder / "seen/image_1")
        shutil.rmtree(folder / "seen/truth")
        method = ("--disparities", 40, "--min-disparity", -39)
        self.assert_works("run", folder / "seen", "--out", folder / "out", *method, "--write", "right,interpolated")
        maps = {file.suffix for kind in ("disparity", "right", "interpolated") for file in (folder / f"out/{kind}").iterdir()}
        self.assertEqual(maps, {".pfm"})
        text = self.assert_works("eval", folder / "out", folder / "out/disparity", "--json")
        self.assertGreater(sum(pair["truth_pixels"] for pair in json.loads(text)["pairs"]), 1000)
        self.assert_works("report", folder / "out")

    def test_an_interrupt_is_no_failure_of_the_device(self):
        """PoCL's compiler takes the signal for itself, too, and fails by it; here the fault layer fails after it."""
        street, out = self.broken_street(), self.new_folder()
        pipe = street / "image_0/000003.png"
        image = pipe.read_bytes()
        pipe.unlink()
        os.mkfifo(pipe)
        lost = dict(os.environ, OPENCL_LAYERS=LAYER, EGOSGM_FAILING_CONTEXT="0/0")
        with subprocess.Popen([PROGRAM, "run", street, "--out", out / "run"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=lost) as process:
            writing = os.open(pipe, os.O_WRONLY)  # once it looks at the images' sizes
            process.send_signal(signal.SIGTERM)
            while "ShdPnd:\t0000000000000000" not in pathlib.Path(f"/proc/{process.pid}/status").read_text():
                self.assertIsNone(process.poll(), "the signal ended it")
                time.sleep(0.01)  # until a thread takes the signal
            os.write(writing, image)
            os.close(writing)
            errors = process.stderr.read()
        self.assertEqual(process.returncode, 130, errors)
        self.assertNotIn("egosgm: error", errors)
