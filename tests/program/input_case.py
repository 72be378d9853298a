# SPDX-License-Identifier: Apache-2.0
"""What the tests of sequences and raw images share. Environment as for program_case.py."""
import json
import pathlib
import struct
import zlib

import numpy

from program_case import ProgramTest, egosgm, png


def read_grey(file):
    """An 8-bit grey PNG as an array."""
    content, at, body = pathlib.Path(file).read_bytes(), 8, b""
    while at < len(content):
        length, kind = struct.unpack(">I4s", content[at:at + 8])
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", content[at + 8:at + 18])
            assert (depth, colour) == (8, 0), file
        if kind == b"IDAT":
            body += content[at + 8:at + 8 + length]
        at += 12 + length
    rows = zlib.decompress(body)
    image = numpy.zeros((height + 1, width + 1), numpy.int32)  # a row above and a column to the left
    for y in range(height):
        start = y * (width + 1)
        method, row = rows[start], numpy.frombuffer(rows, numpy.uint8, width, start + 1).astype(numpy.int32)
        if method in (0, 2):
            image[y + 1, 1:] = row + (image[y, 1:] if method == 2 else 0) & 255
            continue
        for x in range(width):
            left, up, corner = image[y + 1, x], image[y, x + 1], image[y, x]
            if method == 1:
                guess = left
            elif method == 3:
                guess = (left + up) // 2
            else:
                guess = min((left, up, corner), key=lambda v: abs(left + up - corner - v))
            image[y + 1, x + 1] = (row[x] + guess) & 255
    return image[1:, 1:].astype(numpy.uint8)


def write_grey(file, image):
    rows = numpy.ascontiguousarray(image, numpy.uint8)
    pathlib.Path(file).write_bytes(png(image.shape[1], image.shape[0], 8, (row.tobytes() for row in rows)))


def sampled(image, x, y):
    """Bilinear, the border repeated."""
    x, y = numpy.clip(x, 0, image.shape[1] - 1.001), numpy.clip(y, 0, image.shape[0] - 1.001)
    u, v = x.astype(int), y.astype(int)
    a, b, image = x - u, y - v, image.astype(float)
    top = (1 - a) * image[v, u] + a * image[v, u + 1]
    bottom = (1 - a) * image[v + 1, u] + a * image[v + 1, u + 1]
    return numpy.rint((1 - b) * top + b * bottom).astype(numpy.uint8)


def rotation(axis, degrees):
    a = numpy.radians(degrees)
    x, y, z = numpy.asarray(axis, float)
    K = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return numpy.eye(3) + numpy.sin(a) * K + (1 - numpy.cos(a)) * K @ K


class InputTest(ProgramTest):
    def calibration(self):
        rows = dict(line.split(":") for line in (self.street / "calib.txt").read_text().splitlines())
        left, right = ([float(number) for number in rows[name].split()] for name in ("P0", "P1"))
        return left[0], left[2], left[6], (left[3] - right[3]) / left[0]  # f, cx, cy, baseline

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
