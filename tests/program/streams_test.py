# SPDX-License-Identifier: Apache-2.0
"""The standard error closed, full or at an end: the work, its files and its exit code are the same. Environment as for program_case.py."""
import contextlib
import os
import signal
import subprocess

from program_case import FEW_KERNELS, HAS_PACKAGE, PROGRAM, ProgramTest


@contextlib.contextmanager
def ended_pipe():
    reading, writing = os.pipe()
    os.close(reading)
    yield writing
    os.close(writing)


class StandardError(ProgramTest):
    """Each in a shell's words. A pair that cannot be read is told there, and that kernels are compiled where the driver's cache is empty."""

    def code_of(self, arguments, redirection, **options):
        """Of the program, whose standard error is led by the shell's `redirection`."""
        with ended_pipe() as ended:
            words = ["sh", "-c", f'exec "$@" {redirection.replace("ENDED", str(ended))}', "sh", PROGRAM, *map(str, arguments)]
            return subprocess.run(words, stdout=subprocess.PIPE, pass_fds=[ended], timeout=900, **options).returncode

    REDIRECTIONS = "2>&ENDED", "2>/dev/full", "2>&-", "2>&- <&-"

    def test_a_first_run_is_like_any_other(self):
        street, expected = self.broken_street(), self.new_folder()
        os.truncate(street / "image_1/000002.png", 60)
        run = ["run", "--odometry", street, "--frames", "0:2", "--disparities", 16, *FEW_KERNELS, "--quiet", "--out"]
        self.assertEqual(self.code_of([*run, expected], f"2>{expected.parent}/told"), 0)
        self.assertIn("1 of 3 pairs could not be read", (expected.parent / "told").read_text())
        cold = dict(os.environ, POCL_CACHE_DIR=str(self.new_folder()))
        for redirection, environment in ((self.REDIRECTIONS[0], cold), *((redirection, None) for redirection in self.REDIRECTIONS)):
            out, words = self.new_folder(), [word for word in run if environment is None or word != "--quiet"]
            with self.subTest(redirection):
                self.assertEqual(self.code_of([*words, out], redirection, env=environment), 0)
                self.assertTrue(self.report(out)["finished"])
                for name in ("disparity/000000.png", "disparity/000001.png", "poses.txt"):
                    self.assertEqual((out / name).read_bytes(), (expected / name).read_bytes())

    def test_an_interrupt_is_told_by_the_code(self):
        rectify = ["rectify", *self.patterns(), "--out"]
        for arguments in (["run", self.street, "--disparities", 16, "--out"], ["odometry", self.street, "--out"], *[rectify] * HAS_PACKAGE):
            with ended_pipe() as ended:
                process = self.started(*arguments, self.new_folder() / "out", stderr=ended)
            process.send_signal(signal.SIGINT)
            process.stdout.read()
            self.assertEqual(process.wait(600), 130, arguments)
            process.stdout.close()

    def test_an_error_that_no_one_reads_ends_the_program_as_any_other(self):
        for redirection in self.REDIRECTIONS:
            self.assertEqual(self.code_of(["run", "nowhere", "--out", self.folder / "never"], redirection), 2, redirection)

    def test_a_message_does_not_go_into_a_file(self):
        out = self.new_folder() / "poses.txt"
        self.assertEqual(self.code_of(["odometry", self.street, "--out", out], "2>&-"), 0)
        self.assertEqual(len(out.read_text().splitlines()), 4)
