# SPDX-License-Identifier: Apache-2.0
"""A package for Conan 2, of the system's own OpenCV, OpenCL and other libraries, which are Debian's: scripts/install-dependencies.

conan create . --test-folder tests/consumer -s compiler.cppstd=20
"""
import re

from conan import ConanFile
from conan.tools.build import check_min_cppstd
from conan.tools.cmake import CMake, CMakeToolchain, cmake_layout
from conan.tools.files import copy, load
from conan.tools.system.package_manager import Apt


class Egosgm(ConanFile):
    name = "egosgm"
    description = "Dense disparity from stereo video on OpenCL devices"
    license = "Apache-2.0"
    package_type = "static-library"  # shared ones are beside them: find_package's COMPONENTS choose
    settings = "os", "arch", "compiler", "build_type"
    options = {"vision": [True, False]}
    default_options = {"vision": True}
    exports_sources = "CMakeLists.txt", "LICENSE", "apps/*", "cmake/*", "host/*", "include/*", "kernels/*", "vision/*"

    def set_version(self):
        self.version = re.search(r"project\(egosgm VERSION ([\d.]+)", load(self, f"{self.recipe_folder}/CMakeLists.txt"))[1]

    def layout(self):
        cmake_layout(self)

    def validate(self):
        check_min_cppstd(self, 20)

    def system_requirements(self):
        packages = ["ocl-icd-opencl-dev", "opencl-headers", "opencl-clhpp-headers", "libeigen3-dev", "nlohmann-json3-dev"]
        if self.options.vision:
            packages += ["libopencv-dev", "libpng-dev", "libjpeg-dev", "libisal-dev", "libcli11-dev", "libfmt-dev"]
        Apt(self).install(packages)

    def generate(self):
        toolchain = CMakeToolchain(self)
        toolchain.cache_variables.update(EGOSGM_VISION=bool(self.options.vision), EGOSGM_PYTHON=False, EGOSGM_TESTS=False,
                                         EGOSGM_BENCH=False)
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        copy(self, "LICENSE", self.source_folder, f"{self.package_folder}/licenses")
        CMake(self).install()

    def package_info(self):
        # The package's own files are what find_package finds.
        self.cpp_info.set_property("cmake_find_mode", "none")
        self.cpp_info.builddirs = ["lib/cmake/egosgm"]
