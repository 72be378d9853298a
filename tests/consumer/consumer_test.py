# SPDX-License-Identifier: Apache-2.0
"""Installs the build into a prefix, moves it, and builds somebody else's project against it: CMake and pkg-config, shared and static.

EGOSGM_BUILD names the build folder, EGOSGM_CXX the compiler, EGOSGM_HAS_VISION is ON or OFF, EGOSGM_HAS_OPENCV says the same of OpenCV, EGOSGM_VERSION the version.
"""
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

SOURCE = pathlib.Path(__file__).resolve().parent
BUILD, CXX, VERSION = (os.environ[name] for name in ("EGOSGM_BUILD", "EGOSGM_CXX", "EGOSGM_VERSION"))
VISION = os.environ["EGOSGM_HAS_VISION"] == "ON"
OPENCV = VISION and os.environ["EGOSGM_HAS_OPENCV"] in ("ON", "1", "TRUE")
PROGRAMS = ["core"] + ["vision"] * VISION


def run(*command, **options):
    return subprocess.run([*map(str, command)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=240, **options)


class Installed(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.holder = tempfile.TemporaryDirectory(prefix="egosgm_consumer_")
        cls.folder = pathlib.Path(cls.holder.name)
        cls.prefix = cls.folder / "moved"
        done = run("cmake", "--install", BUILD, "--prefix", cls.folder / "first")
        assert done.returncode == 0, done.stdout
        (cls.folder / "first").rename(cls.prefix)  # nothing may remember where it was installed

    @classmethod
    def tearDownClass(cls):
        cls.holder.cleanup()

    def assert_runs(self, *command, **options):
        done = run(*command, **options)
        self.assertEqual(done.returncode, 0, done.stdout)
        return done.stdout

    def library_folder(self):
        return next(self.prefix.rglob("libegosgm.so")).parent

    def configure(self, *arguments, source=SOURCE):
        build = pathlib.Path(tempfile.mkdtemp(dir=self.folder))
        return build, run("cmake", "-S", source, "-B", build, f"-DCMAKE_PREFIX_PATH={self.prefix}", f"-DVISION={VISION}",
                          f"-DCMAKE_CXX_COMPILER={CXX}", "-DCMAKE_BUILD_TYPE=Debug", *arguments)

    def page_project(self):
        """The lines of docs/use/coming-from.md as a project."""
        page = (SOURCE.parents[1] / "docs/use/coming-from.md").read_text()
        (code, cmake), folder = re.findall(r"```c\w+\n(.*?)```", page, re.DOTALL), pathlib.Path(tempfile.mkdtemp(dir=self.folder))
        includes, _, lines = code.partition("\n\n")
        shutil.copy(SOURCE / "opencv.cpp", folder)
        (folder / "page_includes.h").write_text(includes + "\n")
        (folder / "page_lines.inc").write_text(lines)
        (folder / "CMakeLists.txt").write_text("cmake_minimum_required(VERSION 3.22)\nproject(page CXX)\nset(CMAKE_CXX_STANDARD 17)\nadd_executable(YOURS opencv.cpp)\n" + cmake)
        return folder

    def test_cmake_finds_both_kinds_of_library(self):
        projects = [(SOURCE, PROGRAMS)] + ([(self.page_project(), ["YOURS"])] if OPENCV else [])
        for kind, shared, source, programs in [(*of, *project) for of in (("shared", "ON"), ("static", "OFF")) for project in projects]:
            with self.subTest(kind, source=source):
                build, done = self.configure(f"-DBUILD_SHARED_LIBS={shared}", "-DCMAKE_CXX_FLAGS=-march=native", source=source)
                self.assertEqual(done.returncode, 0, done.stdout)
                self.assert_runs("cmake", "--build", build)
                for program in programs:
                    self.assert_runs(build / program, cwd=build)
                    needed = self.assert_runs("readelf", "-d", build / program)
                    self.assertEqual("[libegosgm" in needed, kind == "shared", needed)

    def test_a_wrong_component_and_a_wrong_version_are_refused(self):
        _, done = self.configure("-DWRONG_COMPONENT=ON")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("choose from core, vision", " ".join(done.stdout.split()))

    def test_pkg_config_and_what_programs_load(self):
        environment = dict(os.environ, PKG_CONFIG_PATH=str(self.library_folder() / "pkgconfig"),
                           LD_LIBRARY_PATH=str(self.library_folder()))
        self.assertEqual(self.assert_runs("pkg-config", "--modversion", "egosgm", env=environment).strip(), VERSION)
        for program in PROGRAMS:
            module = "egosgm" if program == "core" else "egosgm-vision"
            flags = self.assert_runs("pkg-config", "--cflags", "--libs", module, env=environment).split()
            self.assert_runs(CXX, "-std=c++17", SOURCE / f"{program}.cpp", *flags, "-o", self.folder / program)
            self.assert_runs(self.folder / program, env=environment, cwd=self.folder)
            needed = self.assert_runs("ldd", self.folder / program, env=environment)
            self.assertIn("libegosgm.so", needed)
            for library in ("opencv", *("libpng", "libjpeg", "libisal") * (program == "core")):
                self.assertNotIn(library, needed)

    def test_the_shared_libraries_show_only_what_is_public_and_carry_their_version(self):
        library = self.library_folder() / f"libegosgm.so.{VERSION}"
        soname = "libegosgm.so." + VERSION.rsplit(".", 1)[0]
        self.assertIn(f"[{soname}]", self.assert_runs("readelf", "-d", library))
        shown = self.assert_runs("nm", "-DC", "--defined-only", library)
        self.assertIn(" T egosgm::Pipeline::process", shown)
        self.assertNotIn("egosgm::ForwardWarp::", shown)
        self.assertNotIn("egosgm::ocl::", shown)

    @unittest.skipUnless(VISION, "no program without vision")
    def test_the_program_finds_its_libraries(self):
        environment = {name: value for name, value in os.environ.items() if name != "LD_LIBRARY_PATH"}
        self.assert_runs(self.prefix / "bin/egosgm", "--version", env=environment)
        self.assertNotIn("not found", self.assert_runs("ldd", self.prefix / "bin/egosgm", env=environment))
