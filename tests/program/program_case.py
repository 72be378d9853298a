# SPDX-License-Identifier: Apache-2.0
"""What the tests of the program from outside share.

EGOSGM_PROGRAM names the program, EGOSGM_EXAMPLES the folder of the examples; EGOSGM_DATA the folder of real data (tests that need it are skipped
without).
"""
import contextlib
import fcntl
import io
import json
import os
import pathlib
import re
import shlex
import shutil
import signal
import stat
import struct
import subprocess
import sys
import tempfile
import threading
import unittest
import warnings
import zlib

PROGRAM = os.environ["EGOSGM_PROGRAM"]
EXAMPLES = pathlib.Path(os.environ.get("EGOSGM_EXAMPLES", ""))
SOURCE = pathlib.Path(__file__).resolve().parents[2]
DATA = os.environ.get("EGOSGM_DATA", "")
WIDTH, HEIGHT, FRAMES = 320, 96, 4
FEW_KERNELS = ("--temporal", "off", "--set", "constants.evidence.enabled=false", "--paths", 4)  # soon compiled where the driver's cache is empty
F_SETPIPE_SZ = 1031  # fcntl has it since Python 3.10
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it, and so do programs that it starts


def without_waiting(errors):
    """Without the line that comes where compiling takes a while: on a busy machine, or where the driver's cache is empty."""
    return "".join(line for line in errors.splitlines(True) if not line.startswith("egosgm: compiling the kernels for "))


PACKAGE = pathlib.Path(PROGRAM).parents[1] / "python"  # beside the program, where it was built with it
TOOLS = json.loads((SOURCE / "python/egosgm/tools.json").read_text()) if (PACKAGE / "egosgm/program.py").exists() else {}
HAS_PACKAGE = bool(TOOLS)  # not in builds with a sanitizer


def in_this_process(arguments, cwd):
    """A tool of the package without a process of its own, whose start takes longer than most of what tools are asked for. None: this Python does
    not load the package."""
    if str(PACKAGE) not in sys.path:
        sys.path.insert(0, str(PACKAGE))
    try:
        from egosgm.program import run_tool
    except ImportError:
        return None
    before, out, errors = os.getcwd(), io.StringIO(), io.StringIO()
    os.chdir(cwd or before)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors), warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # as outside of unittest
            code = run_tool(arguments)
    finally:
        os.chdir(before)
    return subprocess.CompletedProcess(arguments, code, out.getvalue(), errors.getvalue())


def egosgm(*arguments, cwd=None, **options):
    """Runs the program. Its errors are without_waiting."""
    arguments = [*map(str, arguments)]
    if arguments and arguments[0] in TOOLS and not options and threading.current_thread() is threading.main_thread():
        if done := in_this_process(arguments, cwd):
            return done
    done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, timeout=900, cwd=cwd, **options)
    if isinstance(done.stderr, str):
        done.stderr = without_waiting(done.stderr)
        if "needs the Python package egosgm, which" in done.stderr and not TOOLS:
            raise unittest.SkipTest("built without the Python package, which has this tool")
    return done


class Started(subprocess.Popen):
    """The program while it runs. What it says is without_waiting."""

    def communicate(self, *arguments, **options):
        printed, errors = super().communicate(*arguments, **options)
        return printed, errors if errors is None else without_waiting(errors)


def needs_package(test, arguments):
    """Skips a test of a command that the Python package has, where the build is without it."""
    if arguments and arguments[0] in ("eval-video", "eval-flow", "eval-poses") and not TOOLS:
        test.skipTest(f"no Python package beside the program, which has {arguments[0]}")


def with_small_disk(folder, options):
    """The start of a command that has a file system of these options at the folder. Skips the test where none can be mounted."""
    start = ["unshare", "--map-root-user", "--mount", "sh", "-c", f"mount -t tmpfs -o {options} tmpfs '{folder}' && exec \"$@\"", "sh"]
    if shutil.which("unshare") is None or subprocess.run([*start, "true"], capture_output=True).returncode:
        raise unittest.SkipTest("no small file system can be mounted here")
    return start


def as_nobody(cache, **variables):
    """How the program is run by a user who may write in nothing but the driver's cache. Skips the test where that cannot be."""
    if os.geteuid():
        raise unittest.SkipTest("rights are taken from another user: needs root")
    shutil.chown(cache, "nobody")
    options = {"user": "nobody", "env": dict(os.environ, POCL_CACHE_DIR=str(cache), HOME=str(cache), **variables)}
    try:
        egosgm("--version", **options)
    except PermissionError:
        raise unittest.SkipTest("another user cannot run the program where it lies") from None
    return options


def png(width, height, depth, rows, palette=b""):
    """A PNG of rows of bytes, grey, or of a palette."""
    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", width, height, depth, 3 if palette else 0, 0, 0, 0)
    body = zlib.compress(b"".join(b"\0" + row for row in rows), 9)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + (chunk(b"PLTE", palette) if palette else b"") + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def grey_png(width, height, depth=8, frame=0):
    """A textured PNG, built here so that sizes and depths are free; frames differ."""
    return png(width, height, depth, (bytes((x * 7 + y * 13 + x * y + frame) % 256 for x in range(width * depth // 8)) for y in range(height)))


def state(folder):
    """Every file and link below `folder`, with its bytes and mode."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_symlink():
            found[path] = os.readlink(path)
        elif path.is_file():
            found[path] = (path.read_bytes(), stat.S_IMODE(path.stat().st_mode))
    return found


class ProgramTest(unittest.TestCase):
    """A folder with a small synthetic sequence for each class, and a copy of it for each test that breaks it."""

    @classmethod
    def setUpClass(cls):
        cls.folder_holder = tempfile.TemporaryDirectory(prefix="egosgm_program_")
        cls.folder = pathlib.Path(cls.folder_holder.name)
        cls.street = cls.folder / "street"
        done = egosgm("synth", "--out", cls.street, "--frames", FRAMES, "--width", WIDTH, "--height", HEIGHT, "--seed", 7, "--quiet")
        assert done.returncode == 0, done.stderr

    @classmethod
    def tearDownClass(cls):
        cls.folder_holder.cleanup()

    def new_folder(self):
        return pathlib.Path(tempfile.mkdtemp(dir=self.folder))

    def broken_street(self):
        copy = self.new_folder() / "street"
        shutil.copytree(self.street, copy)
        return copy

    def patterns(self, street=None, calib=None):
        """The images of a sequence by their patterns, with a calibration: the sequence's own, unless another one is named."""
        street = street or self.street
        return ["--left", street / "image_0/%06d.png", "--right", street / "image_1/%06d.png", "--calib", calib or street / "calib.txt"]

    def without_package(self):
        """A copy of the program beside which there is no package, and the environment that it runs in."""
        loaded = subprocess.run([PROGRAM], env={**os.environ, "LD_TRACE_LOADED_OBJECTS": "1"}, capture_output=True, text=True, check=True).stdout
        folders = {os.path.dirname(path) for path in re.findall(r"=> (/\S*libegosgm\S*)", loaded)}
        environment = {"PATH": os.environ["PATH"], "LD_LIBRARY_PATH": ":".join(folders), "PYTHONNOUSERSITE": "1"}
        return shutil.copy(PROGRAM, self.new_folder() / "egosgm"), environment

    def started(self, *words, lines=1, stderr=subprocess.PIPE, command=(PROGRAM,), **options):
        """A command that has printed so many lines and waits to be read before it goes on, however busy the machine is."""
        reading, writing = os.pipe2(os.O_CLOEXEC | os.O_DIRECT)
        fcntl.fcntl(writing, F_SETPIPE_SZ, 4096)  # room for one line: with O_DIRECT, each takes a page
        process = Started([*command, *map(str, words)], stdout=writing, stderr=stderr, text=True, **options)
        os.close(writing)
        process.stdout = os.fdopen(reading)
        for _ in range(lines):
            process.stdout.readline()
        return process

    def assert_works(self, *arguments, **options):
        needs_package(self, arguments)
        done = egosgm(*arguments, **options)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stderr, "")
        return done.stdout

    def ran(self, *arguments, **options):
        """The new folder of a run, which works."""
        out = self.new_folder() / "out"
        self.assert_works("run", *arguments, "--out", out, **options)
        return out

    def json_of(self, *arguments):
        return json.loads(self.assert_works(*arguments, "--json"))

    def assert_same_files(self, folder, expected, *patterns):
        """All files of `expected` that the patterns name are in `folder`, with the same bytes."""
        for pattern in patterns:
            files = sorted(expected.glob(pattern))
            self.assertTrue(files, pattern)
            for file in files:
                self.assertEqual((folder / file.relative_to(expected)).read_bytes(), file.read_bytes(), file.name)

    def assert_refused(self, arguments, *named, code=2, **options):
        """One line on the standard error that holds every text of `named`, and the exit code."""
        needs_package(self, arguments)
        done = egosgm(*arguments, **options)
        lines = [line for line in done.stderr.splitlines() if line]
        self.assertEqual(done.returncode, code, f"{arguments}: {done.stdout}{done.stderr}")
        self.assertEqual(len(lines), 1, done.stderr)
        self.assertTrue(lines[0].startswith("egosgm: error: "), lines[0])
        for text in named:
            self.assertIn(str(text), lines[0])

    def assert_all_refused(self, rows, start=(), end=(), **options):
        """Rows of a command line's words, as a list or as text, and of what the refusal says. {street} is the sequence, {never} a folder that is
        not there before and after."""
        places = {"street": self.street, "never": self.folder / "never"}
        for words, *named in rows:
            words = shlex.split(words.format(**places)) if isinstance(words, str) else words
            with self.subTest(" ".join(map(str, words))):
                self.assert_refused([*start, *words, *end], *(str(text).format(**places) for text in named), **options)
                self.assertFalse(places["never"].exists(), "refused, but wrote")

    def assert_refused_and_untouched(self, folder, arguments, *named, code=2, **options):
        before = state(folder)
        self.assert_refused(arguments, *named, code=code, **options)
        self.assertEqual(state(folder), before, arguments)

    def report(self, out):
        return json.loads((out / "report.json").read_text())

    def assert_whole(self, out, at_least=0):
        """Everything in `out` can be read, and nothing temporary is left."""
        maps = sorted((out / "disparity").glob("*"))
        self.assertGreaterEqual(len(maps), at_least)
        for file in maps:
            self.assertRegex(file.name, r"^\d{6}\.(png|pfm)$")
        if maps:
            self.assert_works("eval", "--estimate", out / "disparity", "--truth", out / "disparity")
        return len(maps)
