# SPDX-License-Identifier: Apache-2.0
"""Help and devices: what the program says of itself, and what the README and docs/ say of it."""
import json
import os
import pathlib
import subprocess
import sys

from program_case import HAS_PACKAGE, PROGRAM, SOURCE, ProgramTest, egosgm, with_small_disk

COMMANDS = ("run", "eval", "devices", "compile", "synth", "odometry", "eval-video", "eval-flow", "eval-poses", "tune", "report", "doctor", "rectify", "calibrate", "live")


class Help(ProgramTest):
    def test_every_subcommand_explains_itself_and_has_its_place_on_the_page(self):
        page, all_help = (SOURCE / "docs/use/program.md").read_text(), self.assert_works("--help")
        self.assertIn("130", page)
        for command in COMMANDS:
            with self.subTest(command):
                text = self.assert_works(command, "--help")
                self.assertIn("--help", text)
                self.assertNotRegex(text, r"\(\d+x\)|\[\w+\.\.\.\]|\[\[")
                self.assertIn(command, all_help)
                self.assertIn(f"`{command}`", page)
                if command.startswith("eval"):
                    self.assertIn(f"egosgm {command} [OPTIONS] [ESTIMATE] [TRUTH]\n", text)

    def test_run_lists_the_options_of_the_method(self):
        text = self.assert_works("run", "--help")
        for words in ("--set", "p2 = 190", "gate_px = 3", "Raise it if near objects are cut off"):
            self.assertIn(words, text)

    def test_version(self):
        self.assertRegex(self.assert_works("--version"), r"^egosgm \d+\.\d+\.\d+\n$")

    def test_starts_without_the_libraries_that_read_videos(self):
        loaded = subprocess.run([PROGRAM], env={**os.environ, "LD_TRACE_LOADED_OBJECTS": "1"}, capture_output=True, text=True, check=True).stdout
        if "libegosgm_vision" not in loaded:
            self.skipTest("the program is linked with static libraries")
        self.assertNotRegex(loaded, "opencv_(highgui|imgcodecs|videoio)")

    def test_what_the_python_package_has_is_named(self):
        self.assert_refused(["view", self.street], "the Python package", "run --show", "--write overview")

    def test_a_tool_in_python_names_the_package_where_it_is_not_there(self):
        """By a copy of the program, beside which there is none."""
        folder, (copy, environment) = self.new_folder(), self.without_package()
        for path, code, named in ((str(folder), 1, "python3 cannot be started"), (os.environ["PATH"], 1, "needs the Python package egosgm, which")):
            done = subprocess.run([copy, "run", "--bag", "drive.mcap", "--out", folder / "out"], capture_output=True, text=True, timeout=900,
                                  env={**environment, "PATH": path})
            if path != str(folder) and "drive.mcap" in done.stderr.split("egosgm")[-1]:
                self.skipTest("the package is installed here")
            self.assertEqual(done.returncode, code, done.stderr)
            self.assertRegex(done.stderr, r"^egosgm: error: run: [^\n]*pip install[^\n]*\n$")
            self.assertIn(named, done.stderr)

    def test_a_tool_in_python_is_the_one_beside_the_program(self):
        """Whatever lies in the current folder, and with the exit code and the messages of Python's."""
        folder = self.new_folder()
        for name in ("egosgm.py", "numpy.py", "json.py"):
            (folder / name).write_text("raise SystemExit(77)")
        if not HAS_PACKAGE:
            self.skipTest("built without the Python package")
        self.assert_refused(["run", "--bag"], "--bag: 1 required BAG missing", cwd=folder)
        self.assertIn("--left-topic", self.assert_works("run", "--bag=x", "--help", cwd=folder))
        with open("/dev/full", "w") as full:
            done = subprocess.run([PROGRAM, "run", "--bag=x", "--help"], stdout=full, stderr=subprocess.PIPE, text=True, timeout=900)
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, r"^egosgm: error: [^\n]*No space left on device\n$")
        package = pathlib.Path(PROGRAM).parents[1] / "python"
        module = [sys.executable, "-m", "egosgm"]
        if subprocess.run([sys.executable, "-c", "import egosgm"], capture_output=True, cwd=package).returncode:
            self.skipTest("the package is of another Python")
        for arguments in (["--help"], ["run", "--bag=x", "--help"], ["rnu"]):
            done = subprocess.run([*module, *arguments], capture_output=True, text=True, timeout=900, cwd=package)
            own = egosgm(*arguments)
            self.assertEqual((done.returncode, done.stdout, done.stderr), (own.returncode, own.stdout, own.stderr), arguments)

    def test_devices_names_the_default_and_why(self):
        text = self.assert_works("devices")
        self.assertIn("* 0", text)
        self.assertIn("is taken by default", text)
        devices = json.loads(self.assert_works("devices", "--json"))
        self.assertEqual(sum(device["default"] for device in devices), 1)

    def test_without_a_device_it_says_how_to_install_one(self):
        nothing = dict(os.environ, OCL_ICD_VENDORS="/nonexistent")
        self.assert_refused(["devices"], "pocl-opencl-icd", env=nothing)
        self.assert_refused(["run", "--odometry", self.street, "--out", self.new_folder()], "pocl-opencl-icd", 'OCL_ICD_VENDORS is set to "/nonexistent"', env=nothing)

    def test_a_platform_without_a_device_is_told_from_none(self):
        """PoCL has no device where it cannot make its cache."""
        for name in ("/proc/nowhere", self.street / "calib.txt/below"):
            done = egosgm("devices", env=dict(os.environ, POCL_CACHE_DIR=str(name)))
            if done.returncode == 0:
                self.skipTest("a driver that needs no cache, or another one")
            self.assertEqual(done.returncode, 2)
            self.assertRegex(done.stderr, r"^egosgm: error: no OpenCL device: the platform .* is there, but has no device: .*POCL_CACHE_DIR.*HOME.*\n$")
            self.assertNotIn("apt install", done.stderr)

    def test_a_variable_that_hides_devices_is_named(self):
        done = egosgm("devices", env=dict(os.environ, POCL_DEVICES="no such driver"))
        if done.returncode == 0:
            self.skipTest("a driver that does not ask this variable")
        self.assertIn('POCL_DEVICES is set to "no such driver", which may hide one: unset it', done.stderr)

    def test_a_cache_that_cannot_be_written_is_told_of_where_a_kernel_does_not_build(self):
        out, cache = self.new_folder() / "out", self.new_folder()

        def run_with(options):
            command = [*with_small_disk(cache, "size=100k" + options), PROGRAM, "run", "--odometry", self.street, "--out", out]
            return subprocess.run(command, capture_output=True, text=True, timeout=900, env=dict(os.environ, POCL_CACHE_DIR=str(cache)))

        if run_with("").returncode == 0:
            self.skipTest("the driver needs no cache")
        for options in ("", ",ro"):
            done = run_with(options)
            self.assertEqual(done.returncode, 1, done.stderr)
            last = done.stderr.splitlines()[-1]
            self.assertTrue(last.startswith("egosgm: error: "), done.stderr)
            self.assertIn("POCL_CACHE_DIR", last)
