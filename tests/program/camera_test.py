# SPDX-License-Identifier: Apache-2.0
"""The example of a live camera, on videos. Environment as for program_case.py."""
import os
import subprocess

import numpy

from input_case import InputTest, read_grey
from program_case import EXAMPLES, FRAMES, HEIGHT, WIDTH


class Camera(InputTest):
    """examples/camera.cpp, on a video in place of a camera."""

    def video(self, rate, repeat=1, frames=FRAMES):
        """Both views side by side, uncompressed (YUV4MPEG2, grey)."""
        file = self.new_folder() / "street.y4m"
        pictures = []
        for i in range(frames):
            left, right = (read_grey(self.street / f"image_{side}/00000{i}.png") for side in (0, 1))
            pictures.append(b"FRAME\n" + numpy.hstack([left, right]).tobytes())
        file.write_bytes(f"YUV4MPEG2 W{2 * WIDTH} H{HEIGHT} F{rate}:1 Ip A1:1 Cmono\n".encode() + b"".join(pictures * repeat))
        return file

    def run_camera(self, *arguments, **display):
        headless = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
        return subprocess.run([EXAMPLES / "egosgm_example_camera", *map(str, arguments)], capture_output=True, text=True, timeout=900,
                              env={**headless, **display})

    def test_frames_are_dropped_rather_than_late(self):
        frames = 25 * FRAMES
        done = self.run_camera(self.video(1000, repeat=25), self.street / "calib.txt", 64)  # faster than any matcher
        self.assertEqual(done.returncode, 0, done.stderr)
        *lines, last = done.stdout.splitlines()
        matched, dropped = (int(word) for word in last.replace(",", "").split()[::2])
        self.assertEqual(matched + dropped, frames)
        self.assertEqual(len(lines), matched)
        self.assertGreater(dropped, 0)
        self.assertRegex(lines[0], r"^frame 1  [0-9.]+ frames/s  \d+ dropped$")

    def test_a_single_frame_is_not_dropped(self):
        done = self.run_camera(self.video(1, frames=1), self.street / "calib.txt", 32)
        self.assertIn("1 matched, 0 dropped", done.stdout, done.stderr)

    def test_a_video_is_a_side_by_side_source_of_rectify_too(self):
        out = self.new_folder() / "out"
        self.assert_works("rectify", "--side-by-side", self.video(8), "--calib", self.street / "calib.txt", "--out", out)
        self.assertEqual([float(row) for row in (out / "times.txt").read_text().split()], [i / 8 for i in range(FRAMES)])
        self.assertEqual(len(list((out / "image_3").iterdir())), FRAMES)  # OpenCV gives a video in colour
        self.assertEqual(self.examine(out)["rows"]["verdict"], "ok")

    def test_what_cannot_be_opened_is_refused(self):
        for arguments in ((), ("nothing.mp4", self.street / "calib.txt"), (self.video(1), self.street / "times.txt"), (99, self.street / "calib.txt")):
            done = self.run_camera(*arguments)
            self.assertNotEqual(done.returncode, 0, arguments)
            self.assertTrue(done.stderr)

    def test_a_number_that_is_none_is_named(self):
        for source, disparities, named in ((self.video(1), "many", '"many" is not a whole number'), (10**20, "64", f"{10**20}: no camera")):
            self.assertIn(named, self.run_camera(source, self.street / "calib.txt", disparities).stderr)
