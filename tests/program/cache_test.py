# SPDX-License-Identifier: Apache-2.0
"""Programs that are kept on the disk, by EGOSGM_CACHE and by PoCL: processes side by side, and folders that do not do."""
import os
import shutil
import signal
import subprocess

from program_case import FEW_KERNELS, PROGRAM, ProgramTest, as_nobody, egosgm, with_small_disk


class ProgramCaches(ProgramTest):
    @classmethod
    def run_command(cls, out):
        return ["run", "--quiet", "--tuning", "none", "--odometry", cls.street, "--frames", "0:2", "--disparities", "32", *FEW_KERNELS, "--out", out]

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.expected = cls.folder / "without a cache"
        done = egosgm(*cls.run_command(cls.expected), env=dict(os.environ, EGOSGM_CACHE="off"))
        assert done.returncode == 0, done.stderr

    def test_processes_at_once(self):
        cache, outs = self.new_folder() / "kept", [self.new_folder() for _ in range(4)]
        environment = dict(os.environ, EGOSGM_CACHE=str(cache))
        for _ in range(2):  # into an empty folder, and from a full one
            started = [subprocess.Popen([PROGRAM, *map(str, self.run_command(out))], env=environment) for out in outs]
            self.assertEqual([process.wait(timeout=900) for process in started], [0] * len(outs))
            for out in outs:
                self.assert_same_files(out, self.expected, "disparity/*")
                shutil.rmtree(out)
        names = [file.name for file in cache.iterdir()]
        self.assertTrue(names)
        for name in names:
            self.assertRegex(name, "^[0-9a-f]{16}[.]egosgm$")  # nothing that is half written stays

    def test_an_option_goes_before_the_variable(self):
        named, option, out = self.new_folder(), self.new_folder(), self.new_folder()
        environment = dict(os.environ, EGOSGM_CACHE=str(named))
        self.assert_works(*self.run_command(out), "--cache", option, env=environment)
        self.assert_same_files(out, self.expected, "disparity/*")
        self.assertTrue(list(option.iterdir()))
        self.assert_works(*self.run_command(self.new_folder()), "--cache", "off", env=environment)
        self.assertEqual(list(named.iterdir()), [])

    def test_a_folder_that_may_not_be_written(self):
        cache, own = self.new_folder(), self.new_folder()
        for folder in (self.folder, cache):
            folder.chmod(0o755)
        self.assert_works(*self.run_command(own / "result"), **as_nobody(own, EGOSGM_CACHE=str(cache)))
        self.assert_same_files(own / "result", self.expected, "disparity/*")
        self.assertEqual(list(cache.iterdir()), [])

    def test_a_full_disk(self):
        cache, out = self.new_folder(), self.new_folder()
        inside = f"\"$@\" && ls -A '{cache}'"
        done = subprocess.run([*with_small_disk(cache, "size=8k"), "sh", "-c", inside, "sh", PROGRAM, *map(str, self.run_command(out))],
                              capture_output=True, text=True, timeout=900, env=dict(os.environ, EGOSGM_CACHE=str(cache)))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assert_same_files(out, self.expected, "disparity/*")
        self.assertEqual(done.stdout, "", "a file that found no room stays")

    def test_a_cut_file_of_pocls_own_cache_is_told_of_with_its_remedy(self):
        cache = self.new_folder()
        environment = dict(os.environ, POCL_CACHE_DIR=str(cache), EGOSGM_CACHE="off")
        self.assert_works(*self.run_command(self.new_folder()), env=environment)
        made = list(cache.rglob("*.so"))
        if not made:
            self.skipTest("a driver that needs no such cache")
        for file in made:
            os.truncate(file, 100)
        done = egosgm(*self.run_command(self.new_folder()), env=environment)
        self.assertIn(done.returncode, (1, -signal.SIGABRT))
        last = done.stderr.splitlines()[-1]
        self.assertTrue(last.startswith("egosgm: error: "), done.stderr)
        self.assertIn("delete the cache", last)
        self.assertIn("POCL_CACHE_DIR", last)
