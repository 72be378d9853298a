# SPDX-License-Identifier: Apache-2.0
"""The same project of somebody else, against a package of Conan: conan create . --test-folder tests/consumer."""
from conan import ConanFile
from conan.tools.build import can_run
from conan.tools.cmake import CMake, CMakeToolchain, cmake_layout


class Consumer(ConanFile):
    settings = "os", "arch", "compiler", "build_type"

    def requirements(self):
        self.requires(self.tested_reference_str)

    def layout(self):
        self.conf.define("tools.cmake.cmake_layout:test_folder", "$TMP")  # nothing is built among the sources
        cmake_layout(self)

    def generate(self):
        toolchain = CMakeToolchain(self)
        toolchain.user_presets_path = False
        toolchain.cache_variables["VISION"] = bool(self.dependencies["egosgm"].options.vision)
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def test(self):
        if can_run(self):
            for program in ("core", "vision") if self.dependencies["egosgm"].options.vision else ("core",):
                self.run(f"{self.cpp.build.bindir}/{program}", env="conanrun")
