# SPDX-License-Identifier: Apache-2.0
"""What the tests of sequences and raw images share. Environment as for program_case.py."""
import json

import cv2
import numpy
import PIL.Image

from program_case import ProgramTest, egosgm


def read_grey(file):
    """An 8-bit grey PNG as an array."""
    image = PIL.Image.open(file)
    assert image.mode == "L", file
    return numpy.array(image)


def write_grey(file, image):
    PIL.Image.fromarray(numpy.ascontiguousarray(image, numpy.uint8)).save(file)


def write_grey16(file, image):
    PIL.Image.fromarray(numpy.ascontiguousarray(image, numpy.uint16)).save(file)


def sampled(image, x, y):
    """Bilinear, the border repeated."""
    return cv2.remap(image, x.astype(numpy.float32), y.astype(numpy.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def rotation(axis, degrees):
    return cv2.Rodrigues(numpy.radians(degrees) * numpy.asarray(axis, float))[0]


class InputTest(ProgramTest):
    def calibration(self):
        rows = dict(line.split(":") for line in (self.street / "calib.txt").read_text().splitlines())
        left, right = ([float(number) for number in rows[name].split()] for name in ("P0", "P1"))
        return left[0], left[2], left[6], (left[3] - right[3]) / left[0]  # f, cx, cy, baseline

    def calibrated(self, **changes):
        """calib.txt with values that are changed."""
        f, cx, cy, baseline = self.calibration()
        file = self.new_folder() / "calib.txt"
        values = {"fx": f, "fy": f, "cx": cx, "cy": cy, "baseline_m": baseline, **changes}
        file.write_text("".join(f"{name} = {value}\n" for name, value in values.items()))
        return file

    def changed_street(self, change, sides=("image_0", "image_1"), write=write_grey):
        """One whose images are `change` of what they were."""
        street = self.broken_street()
        for side in sides:
            for file in (street / side).iterdir():
                write(file, change(read_grey(file)))
        return street

    def examine(self, *arguments, code=0):
        """Verdicts by check."""
        done = self.run_doctor(*arguments, "--json")
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return {finding["check"]: finding for finding in json.loads(done.stdout)}

    def run_doctor(self, *arguments):
        return egosgm("doctor", *arguments)

    def assert_only_problem(self, check, *arguments):
        findings = self.examine(*arguments, code=2)
        self.assertEqual([name for name, finding in findings.items() if finding["verdict"] == "problem"], [check], findings)
        self.assertTrue(findings[check]["remedy"])
        return findings[check]
