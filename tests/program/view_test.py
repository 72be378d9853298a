# SPDX-License-Identifier: Apache-2.0
"""egosgm view: pictures, videos, the window."""
import os
import pathlib
import resource
import shutil
import signal
import struct
import subprocess
import time
import unittest

from program_case import FRAMES, HEIGHT, PROGRAM, WIDTH, ProgramTest


class View(ProgramTest):
    """A smaller sequence, since what is looked at is the same."""

    def png_size(self, file):
        return struct.unpack(">II", file.read_bytes()[16:24])

    def test_pictures_and_a_video_without_a_display(self):
        out = self.new_folder()
        headless = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
        video = ["--video", out / "street.avi"]  # OpenCV writes it without FFmpeg
        text = self.assert_works("view", "--odometry", self.street, "--pictures", out / "pictures", *video, "--cell-width", 200,
                                 env=headless)
        self.assertIn("frame 000003", text)
        pictures = sorted((out / "pictures").iterdir())
        self.assertEqual([file.name for file in pictures], [f"00000{i}.png" for i in range(FRAMES)])
        width, height = self.png_size(pictures[0])
        self.assertEqual(width, 404)  # two panels and a gap
        self.assertGreater(height, 3 * HEIGHT * 200 / WIDTH)  # three rows, the last one for the error
        self.assertEqual([file.name for file in out.iterdir() if file.is_file()], ["street.avi"])
        content = (out / "street.avi").read_bytes()
        self.assertEqual((content[:4], content[8:12]), (b"RIFF", b"AVI "))
        self.assertEqual(content.count(b"00dc") // 2, FRAMES)  # each frame stands in the stream and in the index

    def test_a_full_disk_under_a_video_is_an_error(self):
        folder = self.new_folder()
        for name in ("street.avi", "street.mp4"):
            process = self.started("view", self.street, "--video", folder / name)
            resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (4096, 4096))
            _, errors = process.communicate(timeout=600)
            self.assertEqual(process.returncode, 1, errors)
            self.assertRegex(errors, rf"^egosgm: error: .*/{name}: cannot be written: of 4 frames only \d could be read back.*\n$")
        self.assertEqual(list(folder.iterdir()), [])

    def street_with_a_gap(self):
        street = self.broken_street()
        for side in ("image_0", "image_1"):
            (street / side / "000001.png").unlink()
        return street

    NOTE = "frame numbers 0..3"

    def test_a_gap_is_told_of_once_before_the_frames(self):
        street = self.street_with_a_gap()
        view = ["view", street, "--pictures", street.parent / "pictures", "--cell-width", 100]
        text = self.assert_works(*view)
        self.assertEqual(text.count(self.NOTE), 1, text)
        self.assertLess(text.index(self.NOTE), text.index("frame 000000"))
        quiet = ["view", street, "--pictures", street.parent / "more", "--cell-width", 100, "--quiet"]
        self.assertEqual(self.assert_works(*quiet), "")

    def test_without_truth_there_is_no_error_panel(self):
        street, heights = self.broken_street(), []
        for name in ("with", "without"):
            pictures = street.parent / name
            self.assert_works("view", "--odometry", street, "--pictures", pictures, "--frames", "0", "--quiet")
            heights.append(self.png_size(pictures / "000000.png")[1])
            shutil.rmtree(street / "truth", ignore_errors=True)
        self.assertGreater(heights[0], heights[1])

    def test_what_cannot_be_shown_is_refused(self):
        headless = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
        view = ["view", "--odometry", self.street]
        self.assert_refused(view, "--video", "--pictures", env=headless)
        for name in ("DISPLAY", "WAYLAND_DISPLAY"):  # a display that is not there
            self.assert_refused(view, f":77777 ({name})", "--video", "--pictures", env={**headless, name: ":77777"})
        self.assert_refused([*view, "--video", self.folder / "street.mkv"], ".mp4 or .avi")
        self.assert_refused([*view, "--pictures", self.folder / "p", "--fps", 0], "--fps 0")
        for width in (0, 16385):
            self.assert_refused([*view, "--pictures", self.folder / "p", "--cell-width", width], f"--cell-width {width}", "1 to 16384")
        file = self.new_folder() / "file"
        file.touch()
        self.assert_refused([*view, "--pictures", file / "p"], file, code=1)

    @unittest.skipUnless(shutil.which("Xvfb"), "no Xvfb")
    def test_the_window_plays_until_it_is_told_to_stop(self):
        # A number of its own: those that Xvfb finds free may be taken in another root folder on this machine.
        display = f":{1000 + os.getpid() % 50000}"
        with subprocess.Popen(["Xvfb", display, "-nolisten", "tcp"], stderr=subprocess.DEVNULL) as screen:
            try:
                self.wait_until(pathlib.Path(f"/tmp/.X11-unix/X{display[1:]}").exists)
                process = subprocess.Popen([PROGRAM, "view", self.street_with_a_gap()], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                           env=dict(os.environ, DISPLAY=display))
                first = process.stdout.readline()  # the kernels are built, however long that took
                with self.assertRaises(subprocess.TimeoutExpired):  # it stays open after the last frame
                    process.wait(timeout=8)
                process.send_signal(signal.SIGINT)
                text, errors = process.communicate(timeout=60)
                self.assertEqual(process.returncode, 130, errors)
                self.assertNotIn("egosgm: error", errors)
                self.assertEqual((first + text).count(self.NOTE), 1, text)
            finally:
                screen.terminate()

    def wait_until(self, is_so):
        while not is_so():  # ctest ends it where that never comes
            time.sleep(0.1)


if __name__ == "__main__":
    unittest.main()
