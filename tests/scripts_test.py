# SPDX-License-Identifier: Apache-2.0
"""Every script explains itself by --help, and refuses what it does not know with one line, before it does anything."""
import contextlib
import importlib.util
import io
import json
import os
import pathlib
import re
import runpy
import shutil
import subprocess
import sys
import tempfile
import unittest
import unittest.mock

SCRIPTS = pathlib.Path(__file__).resolve().parents[1] / "scripts"
SHARED = ("usage.sh", "usage.py", "old_glibc.sh")


def explanation(script):
    """The first words of the comment, or of the text, at its head."""
    lines = [line for line in script.read_text().splitlines() if not line.startswith(("#!", "# SPDX-"))]
    return " ".join(re.findall(r"[\w-]+", lines[0])[:5])


class Scripts(unittest.TestCase):
    def setUp(self):
        # Should a script begin with its work, it finds no tool for it.
        self.folder = tempfile.TemporaryDirectory(prefix="egosgm_scripts_")
        self.addCleanup(self.folder.cleanup)
        for tool in ("apt-get", "sudo", "dpkg-query", "cmake", "debootstrap", "pip", "git"):
            stub = pathlib.Path(self.folder.name, tool)
            stub.write_text(f"#!/bin/sh\necho 'the script began to work: {tool}' >&2\nexit 99\n")
            stub.chmod(0o755)
        self.scripts = sorted(script for script in SCRIPTS.iterdir() if script.is_file() and script.name not in SHARED)
        self.assertGreater(len(self.scripts), 20)

    def called(self, script, *arguments):
        words = [script] if os.access(script, os.X_OK) else [sys.executable, script]
        environment = dict(os.environ, PATH=f"{self.folder.name}:{os.environ['PATH']}", PYTHONDONTWRITEBYTECODE="1", COLUMNS="200")
        return subprocess.run([*words, *arguments], env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=900)

    def test_help_is_the_comment_at_the_head(self):
        for script in self.scripts:
            for option in ("--help", "-h"):
                with self.subTest(script=script.name, option=option):
                    done = self.called(script, option)
                    self.assertEqual((done.returncode, done.stderr), (0, ""))
                    self.assertIn(explanation(script), " ".join(re.findall(r"[\w-]+", done.stdout)))

    def test_unknown_arguments_and_a_word_too_many_are_one_line_of_error(self):
        rows = [(script, arguments, arguments[0]) for script in self.scripts
                for arguments in (["--progam"], ["--progam=1"], ["-q"])]
        rows += [(SCRIPTS / name, words, words[-1]) for name, *words in (
            ("install-dependencies", "--program", "again"), ("tidy", "host/nowhere.cpp"), ("mutants", "no such text"), ("test", "Census"), ("test", "--all", "Census"), ("test", "-R", "Census", "Sgm"), ("format", "--check", "all"), ("measure", "--build", "b", "c"), ("build-site", "now"),
            ("try-arm", "now"), ("lanes", "asan", "usan"), ("build-wheel", "python9.9"), ("bench-device", "--all", "stages"))]
        for script, arguments, named in rows:
            with self.subTest(script=script.name, arguments=arguments):
                done = self.called(script, *arguments)
                self.assertEqual((done.returncode, done.stdout), (2, ""), done.stderr)
                self.assertRegex(done.stderr, r"\A[^\n]+\n\Z")
                self.assertIn(named, done.stderr)

    def test_same_bits_names_what_differs_is_missing_or_came(self):
        with unittest.mock.patch.object(sys, "path", [str(SCRIPTS), *sys.path]):
            differences = runpy.run_path(str(SCRIPTS / "same-bits"))["differences"]
        before = {"images": {"street": {"image_0": ["a"]}}, "runs": {"default": {"disparity": ["a", "b", "c"], "pfm": ["d"]}}}
        for change, named in (({"disparity": ["a", "b", "c"], "pfm": ["d"]}, []), ({"disparity": ["a", "x", "c"], "pfm": ["d"]}, ["default: disparity of frame 1"]),
                              ({"disparity": ["a"], "pfm": ["d"]}, ["default: disparity of frame 1, 2"]), ({"disparity": ["a", "b", "c"]}, ["default: pfm of frame 0"]),
                              ({"disparity": ["a", "b", "c", "e"], "pfm": ["d"], "right": ["f"]}, ["default: disparity of frame 3", "default: right of frame 0"])):
            self.assertEqual(differences(before, {"images": before["images"], "runs": {"default": change, "new": {"pfm": ["g"]}}}), named)

    def test_same_bits_looks_for_its_files_before_it_runs(self):
        for words, named in ((("--check", "nowhere.json", "--program", "true"), "nowhere.json: there is no such file"),
                             (("--record", f"{self.folder.name}/now.json", "--program", "nowhere/egosgm"), "nowhere/egosgm: there is no such program")):
            done = self.called(SCRIPTS / "same-bits", *words)
            self.assertEqual((done.returncode, done.stdout, done.stderr.count("\n")), (2, "", 1), done.stderr)
            self.assertIn(named, done.stderr)

    def test_same_bits_begins_no_run_after_its_time(self):
        with unittest.mock.patch.object(sys, "path", [str(SCRIPTS), *sys.path]):
            same_bits = runpy.run_path(str(SCRIPTS / "same-bits"))
        begun = []
        record = same_bits["record"]
        with unittest.mock.patch.dict(record.__globals__, render=lambda *_: None, checksums=lambda _: {}, call=lambda *words: begun.append(words)):
            now, late = record("program", None, re.compile("^default"), seconds=-1)
            self.assertEqual((now["runs"], late, begun), ({}, ["default", "default_paths", "default_16_bits"], []))
            now, late = record("program", None, re.compile("^default"))
        self.assertEqual((list(now["runs"]), late, len(begun)), (["default", "default_paths", "default_16_bits"], [], 3))

    def test_the_core_asks_for_few_packages(self):
        done = self.called(SCRIPTS / "install-dependencies", "--core")
        asked = re.search(r"(?:Installing|missing):((?: [a-z][a-z0-9.+-]+)+)", done.stdout + done.stderr)[1].split()
        self.assertEqual(asked, "build-essential cmake ninja-build python3 ocl-icd-opencl-dev opencl-headers opencl-clhpp-headers pocl-opencl-icd libeigen3-dev "
                                "nlohmann-json3-dev libgtest-dev libfmt-dev".split())


    def measured_by(self, programs):
        """A checkout whose build makes these programs, by file: bench-device and what it calls, without CMake."""
        root = pathlib.Path(self.folder.name, "source")
        copied = {name: (SCRIPTS.parent / name).read_text() for name in ("scripts/bench-device", "scripts/usage.sh", "bench/device.py")}
        for name, text in {**copied, **programs}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text)
            (root / name).chmod(0o755)
        pathlib.Path(self.folder.name, "cmake").write_text("#!/bin/sh\n")
        return root

    def test_figures_of_an_earlier_run_are_not_those_of_one_that_crashed(self):
        """With tests that pass, and benchmarks that end by a signal before they write."""
        root = self.measured_by({"build-device/tests/egosgm_stage_test": "#!/bin/sh\n", "build-device/bench/egosgm_stages": "#!/bin/sh\nkill -SEGV $$\n",
                                 "build-device/stages.json": "{}", "mine.json": "{}"})
        for arguments in ([], ["--json", root / "mine.json"]):
            done = self.called(root / "scripts/bench-device", *arguments)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertNotIn("Written", done.stdout)
            self.assertIn("ended without figures", done.stderr)
        self.assertFalse((root / "build-device/stages.json").exists())
        self.assertTrue((root / "mine.json").exists())

    PARTS = ("stage tests", "stages", "same-bits", "kernels", "stream", "tuner")
    # Each writes what follows --json or --file in its arguments.
    WRITES = '#!/bin/sh\nuntil [ "$1" = --json ] || [ "$1" = --file ]; do shift; done\n'
    HEAD = {"device": "a GPU", "driver": "1", "version": "OpenCL 3.0", "compute_units": 9, "threads": 2, "commit": "abc", "date": "today", "input": "a street"}
    DEVICE = {
        "build-device/tests/egosgm_stage_test": "#!/bin/sh\ncase $1 in --gtest_list_tests) echo A.; echo '  B'; echo '  C' ;; *) echo '[       OK ] A.B (3 ms)' ;; esac\n",
        "build-device/bench/egosgm_stages": WRITES + f"echo '{json.dumps({**HEAD, 'copy_gb_s': 3, 'rows': [1]})}' >$2\n",
        "build-device/bench/egosgm_kernels": "",
        "build-device/bench/egosgm_offload": WRITES + f"echo '{json.dumps({**HEAD, 'rows': [2]})}' >$2\n",
        "build-device/apps/egosgm": WRITES + "echo '  row_group 32   0.5 ms'; echo Kept for a GPU: $2; echo '{\"kept\": 5}' >$2\n",
        "bench/kernels.py": f"import pathlib, sys\npathlib.Path(sys.argv[sys.argv.index('--json') + 1]).write_text('{json.dumps({**HEAD, 'kernels': [3]})}')\n",
        "scripts/same-bits": "print('the same to the bit: 1 runs')\nprint('/home/somebody')\n",
    }

    def test_every_part_of_a_device_is_in_one_file(self):
        root = self.measured_by(self.DEVICE)
        done = self.called(root / "scripts/bench-device", "--all", "--size", "16x9")
        self.assertEqual(done.returncode, 0, done.stderr)
        found = json.loads((root / "build-device/stages.json").read_text())
        self.assertEqual({name: found[name] for name in ("device", "copy_gb_s", "rows", "stream", "same_bits")},
                         {"device": "a GPU", "copy_gb_s": 3, "rows": [1], "stream": [2], "same_bits": ["the same to the bit: 1 runs"]})
        self.assertEqual(found["kernels"]["kernels"], [3])
        self.assertEqual(found["tuning"], {"tried": ["  row_group 32   0.5 ms"], "kept": {"kept": 5}})
        self.assertEqual((found["tests"]["failed"], found["tests"]["of"]), (0, 2))
        self.assertEqual({name: part["end"] for name, part in found["parts"].items()}, dict.fromkeys(self.PARTS, "passed"))
        self.assertNotIn(str(root), json.dumps(found))

    def test_a_part_that_fails_or_lacks_its_program_takes_no_other_with_it(self):
        crashed = "#!/bin/sh\necho '[  FAILED  ] A.C (1 ms)'\nkill -SEGV $$\n"
        left_out = "left out: the program's libraries are missing"
        for broken, ends, code in (({"build-device/tests/egosgm_stage_test": crashed}, {"stage tests": "failed"}, 1),
                                   ({"build-device/bench/egosgm_stages": "#!/bin/sh\nkill -SEGV $$\n"}, {"stages": "failed"}, 1),
                                   ({"scripts/same-bits": "print('differs: default')\nraise SystemExit(1)\n"}, {"same-bits": "failed"}, 1),
                                   ({"build-device/apps/egosgm": None}, {"same-bits": left_out, "tuner": left_out}, 0)):
            with self.subTest(broken=list(broken)):
                shutil.rmtree(pathlib.Path(self.folder.name, "source"), ignore_errors=True)
                root = self.measured_by({name: text for name, text in {**self.DEVICE, **broken}.items() if text is not None})
                done = self.called(root / "scripts/bench-device", "--all", "--seconds", "0")
                self.assertEqual(done.returncode, code, done.stderr)
                found = json.loads((root / "build-device/stages.json").read_text())
                self.assertEqual({name: part["end"] for name, part in found["parts"].items()}, {**dict.fromkeys(self.PARTS, "passed"), **ends})
                for name, end in ends.items():
                    self.assertIn(f"{name}: {end}", done.stdout)
                self.assertEqual((found["device"], found["stream"], found["rows"]), ("a GPU", [2], [] if "stages" in ends else [1]))

    def test_a_part_that_is_late_is_stopped_with_what_it_started(self):
        root = self.measured_by({**self.DEVICE, "build-device/bench/egosgm_stages": "#!/bin/sh\nsleep 3000 & wait\n"})
        spec = importlib.util.spec_from_file_location("device", root / "bench/device.py")
        device = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(device)
        device.ALL.update({**dict.fromkeys(self.PARTS, 900), "stages": 0.1})
        arguments = ["device.py", "--programs", str(root / "build-device"), "--out", str(root / "build-device"), "--json", str(root / "all.json"), "--all"]
        said = io.StringIO()
        with unittest.mock.patch.object(sys, "argv", arguments), unittest.mock.patch.dict(os.environ), contextlib.redirect_stdout(said):
            self.assertEqual(device.main(), 0)
        found = json.loads((root / "all.json").read_text())
        self.assertEqual({name: part["end"] for name, part in found["parts"].items()}, {**dict.fromkeys(self.PARTS, "passed"), "stages": "stopped after 0.1 s"})
        self.assertIn("stages: stopped after 0.1 s", said.getvalue())
        self.assertEqual((found["device"], found["rows"], found["stream"]), ("a GPU", [], [2]))

    def test_a_pack_builds_nothing_and_knows_its_processor(self):
        packed = {name.replace("build-device/", "packed/"): text.replace("#!/bin/sh\n", "#!/bin/sh\n[ -n \"${PYOPENCL_HOME+set}\" ] || kill -SEGV $$\n")
                  for name, text in self.DEVICE.items()}
        root = self.measured_by({**packed, "packed/arch": f"{os.uname().machine}\n"})
        pathlib.Path(self.folder.name, "cmake").write_text("#!/bin/sh\necho 'no cmake' >&2\nexit 99\n")
        done = self.called(root / "scripts/bench-device", "--all")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual({part["end"] for part in json.loads((root / "build-device/stages.json").read_text())["parts"].values()}, {"passed"})
        (root / "packed/arch").write_text("pdp11\n")
        done = self.called(root / "scripts/bench-device", "--all")
        self.assertEqual((done.returncode, done.stdout), (1, ""))
        self.assertIn("packed for pdp11, and this machine is", done.stderr)

    def test_a_path_with_a_blank_and_a_comma_is_one_path_or_refused(self):
        root = pathlib.Path(self.folder.name, "a b, c")
        shutil.copytree(SCRIPTS, root / "scripts", ignore=shutil.ignore_patterns("__pycache__"))
        pathlib.Path(self.folder.name, "apt-get").write_text("#!/bin/sh\necho \"$@\" >&2\ncat \"$APT_CONFIG\" >&2\nexit 1\n")
        pathlib.Path(self.folder.name, "apt-get").chmod(0o755)
        done = self.called(root / "scripts/install-dependencies", "--arm")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(f'-qq update\nDir::State "{root}/build-arm/host.apt/state";\n', done.stderr)
        done = self.called(root / "scripts/try-arm")
        self.assertEqual((done.returncode, done.stdout), (2, ""))
        self.assertIn(f"try-arm: {root}: an overlay of file systems takes no path with a blank", done.stderr)

    def test_a_link_to_the_scripts_leads_to_the_project(self):
        link = pathlib.Path(self.folder.name, "link")
        link.symlink_to(SCRIPTS)
        self.assertIn(" census ", self.called(link / "check", "nope").stderr)
        for script in self.scripts:
            for line in script.read_text().splitlines():
                self.assertNotRegex(line, r'\bcd "\$(\(dirname "\$0"\)/\.\.|folder)"', script.name)

    def test_the_notice_of_each_library_goes_with_a_wheel_and_a_pack(self):
        script = (SCRIPTS / "old_glibc.sh").read_text()
        notices = "set -eu\n" + script[script.index("mkdir \"$root/licenses\""):]
        root, packages = pathlib.Path(self.folder.name, "a b, c"), ["zlib1g-dev", "libjpeg62-turbo-dev"]
        for package in re.search(r"share/doc/\{(.*)\}-dev", notices)[1].replace("*", "-turbo8").split(","):
            packages.append(f"{package}-dev")
        for package in packages:
            (root / "share/doc" / package).mkdir(parents=True, exist_ok=True)
            (root / "share/doc" / package / "copyright").write_text(f"of {package}")
        subprocess.run(["bash", "-c", notices], env=dict(os.environ, root=str(root), libraries=str(root)), check=True)
        self.assertEqual({file.name: file.read_text() for file in (root / "licenses").iterdir()}, {package: f"of {package}" for package in packages})
        self.assertLess({"libpng-dev", "libisal-dev", "zlib1g-dev", "ocl-icd-opencl-dev"}, set(packages))
        for name in ("build-wheel", "bench-device"):
            self.assertIn("/licenses", (SCRIPTS / name).read_text())

    def test_the_lane_of_threads_names_tests_that_there_are(self):
        names = re.search(r"^threaded='\^\((.*)\)'$", (SCRIPTS / "lanes").read_text(), re.MULTILINE)[1]
        outer, programs = re.fullmatch(r"(.*)\|program\\\.\((.*)\)\$", names).groups()
        tests = "\n".join(file.read_text() for file in SCRIPTS.parent.glob("tests/**/*") if file.suffix in (".cpp", ".py"))
        for name in outer.split("|"):
            self.assertRegex(tests, rf"(TEST|TEST_[FP]|INSTANTIATE_TEST_SUITE_P)\({name.rstrip('/')}")
        for name in programs.split("|"):
            self.assertRegex(tests, rf"class {name}\(")


class InAnyOrder(unittest.TestCase):
    """The README's commands share build/: each configures it as if it came first. Nothing is compiled here."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="egosgm_orders_")
        self.addCleanup(folder.cleanup)
        self.checkout = pathlib.Path(folder.name, "a b, c")
        made = shutil.ignore_patterns(".git", "build", "build-*", "out")

        def ignored(folder, names):
            return made(folder, names) if pathlib.Path(folder) == SCRIPTS.parent else [name for name in names if name == "__pycache__"]

        shutil.copytree(SCRIPTS.parent, self.checkout, ignore=ignored)
        # CMake configures, and builds nothing: so a script ends here.
        stub = pathlib.Path(folder.name, "bin", "cmake")
        stub.parent.mkdir()
        stub.write_text(f"#!/bin/sh\n[ \"$1\" != --build ] || {{ shift 2; echo \"would build: $*\"; exit 99; }}\nexec {shutil.which('cmake')} \"$@\"\n")
        stub.chmod(0o755)
        self.environment = dict(os.environ, PATH=f"{stub.parent}:{os.environ['PATH']}", PYTHONDONTWRITEBYTECODE="1")

    def test_the_core_is_configured_without_what_only_others_need(self):
        """What `install-dependencies --core` leaves out."""
        absent = [f"-DCMAKE_DISABLE_FIND_PACKAGE_{name}=ON" for name in ("OpenCV", "benchmark", "PNG", "JPEG", "ZLIB", "CLI11", "pybind11", "ISAL")]
        done = subprocess.run(["cmake", "-S", self.checkout, "-B", self.checkout / "build-device", "-DEGOSGM_VISION=OFF", *absent], env=self.environment,
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_a_wheel_installs_its_package_alone(self):
        done = subprocess.run(["cmake", "-S", self.checkout, "-B", self.checkout / "build-python", "-DSKBUILD=2", "-DEGOSGM_VISION=OFF", "-DEGOSGM_TESTS=OFF",
                               "-DEGOSGM_BENCH=OFF"], env=self.environment, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("share/doc", (self.checkout / "build-python/cmake_install.cmake").read_text())

    def configured(self, script, *arguments):
        """What the cache says after a call of a script that came as far as building."""
        done = subprocess.run([self.checkout / "scripts" / script, *arguments], env=self.environment, stdin=subprocess.DEVNULL, capture_output=True, text=True)
        self.assertIn("would build:", done.stdout + done.stderr, f"{script} {arguments}: {done.stderr}")
        return dict(re.findall(r"^(EGOSGM_\w+):BOOL=(\w+)$", (self.checkout / "build/CMakeCache.txt").read_text(), re.MULTILINE))

    def test_no_call_leaves_its_options_to_the_next(self):
        for script in ("check", "demo", "build", "demo", "check", "test", "build"):
            with self.subTest(script=script):
                options = self.configured(script, *(["kalman_update"] if script == "check" else []))
                self.assertEqual((options["EGOSGM_TESTS"], options["EGOSGM_BENCH"]), ("OFF", "OFF") if script == "demo" else ("ON", "ON"))
                self.assertEqual(options["EGOSGM_WERROR"], "ON" if script == "test" else "OFF")
        self.assertEqual(self.configured("build", "-DEGOSGM_WERROR=ON")["EGOSGM_WERROR"], "ON")
        self.assertEqual(self.configured("build")["EGOSGM_WERROR"], "OFF")
        # A path with a comma is one file among those that are embedded.
        subprocess.run(["cmake", "--build", self.checkout / "build", "--target", "kernels.cpp"], check=True, capture_output=True)
        self.assertIn("kalman_update.cl", (self.checkout / "build/kernels.cpp").read_text())
