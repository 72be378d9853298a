# SPDX-License-Identifier: Apache-2.0
"""egosgm tune: what it keeps, and that runs use it."""
import json
import os
import re
import signal

from program_case import ProgramTest

TUNE = ("--width", 64, "--height", 24, "--disparities", 16, "--rounds", 2, "--stage")


class TuneFiles(ProgramTest):
    def test_an_interrupt_keeps_the_earlier_tuning(self):
        file = self.new_folder() / "tuning.json"
        self.assert_works("tune", "--file", file, *TUNE, "ForwardWarp")
        kept = json.loads(file.read_text())
        next(iter(kept.values())).update(tile_width=96, tile_height=8)
        file.write_text(json.dumps(kept))
        before = file.read_bytes()
        for lines in (1, 4):  # then the last one of six waits to be read
            process = self.started("tune", "--file", file, *TUNE, "ForwardWarp", lines=lines)
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=900)
            # PoCL's compiler says the first line where the interrupt meets it; nothing else may come.
            said = errors.removeprefix("1 error generated.\n")
            self.assertEqual((process.returncode, said), (130, f"egosgm: interrupted: nothing is kept, {file} is as it was\n"))
            self.assertEqual(file.read_bytes(), before)

    def test_one_stage_leaves_the_sizes_of_the_others(self):
        file = self.new_folder() / "tuning.json"
        tune = ["tune", "--file", file, *TUNE]
        self.assert_works(*tune, "ForwardWarp")
        kept = json.loads(file.read_text())
        sizes = next(iter(kept.values()))
        sizes.update(tile_width=96, tile_height=8, warp_band_rows=3)
        file.write_text(json.dumps(kept))
        self.assert_works(*tune, "ForwardWarp")
        after = next(iter(json.loads(file.read_text()).values()))
        self.assertNotEqual(after["warp_band_rows"], 3)
        self.assertEqual({**after, "warp_band_rows": 3}, sizes)
        before = file.read_bytes()
        for of_gpus in ("SearchBand", "VerticalAlignment"):
            self.assert_refused([*tune, of_gpus], f"--stage {of_gpus}", "CPU", "another stage")
        self.assertEqual(file.read_bytes(), before)

    def test_groups_that_a_gpu_has_not_are_left_out(self):
        gpu = dict(os.environ, OPENCL_LAYERS=os.environ["EGOSGM_GPU_LAYER"], POCL_MAX_WORK_GROUP_SIZE="64")
        told = self.assert_works("tune", "--file", self.new_folder() / "tuning.json", *TUNE, "SearchBand", env=gpu)
        self.assertEqual(re.findall(r"row_group (\d+) +not on this device", told), ["128", "256"])

    def test_it_keeps_sizes_that_run_uses_and_change_no_bit(self):
        folder = self.new_folder()
        plain, tuned, file = folder / "plain", folder / "tuned", folder / "egosgm/tuning.json"
        # With more compute units than sweeps each diagonal of tiles is a launch: so the sizes show.
        environment = dict(os.environ, XDG_CONFIG_HOME=str(folder), POCL_MAX_PTHREAD_COUNT="5", POCL_CPU_MAX_CU_COUNT="5")
        told = self.assert_works("tune", *TUNE, "SpeckleRemoval", env=environment)
        self.assertRegex(told, r"^SpeckleRemoval: ")
        self.assertNotIn(" 0.000 ms", told)  # though first frames alone have this stage
        (key, sizes), = json.loads(file.read_text()).items()
        self.assertIn("driver", key)
        self.assertIn("tile_width", sizes)
        sizes.update(tile_width=32, tile_height=8, warp_band_rows=5)
        file.write_text(json.dumps({"another device, driver 1": {"tile_width": "nonsense"}, key: sizes}))
        self.assert_works("run", "--odometry", self.street, "--out", tuned, "--trace", folder / "tuned.json", env=environment)
        self.assert_works("run", "--odometry", self.street, "--out", plain, "--tuning", "none", env=environment)
        self.assert_same_files(tuned, plain, "disparity/*")
        self.assertGreater(self.report(tuned)["frames"][2]["launches"], self.report(plain)["frames"][2]["launches"])  # more, smaller tiles
        self.assert_refused(["run", "--odometry", self.street, "--out", folder / "never", "--tuning", "/nonexistent"], "/nonexistent")
        self.assert_refused(["tune", "--file", "/proc/tuning.json"], "/proc/tuning.json", code=1)

    def test_a_file_that_is_no_tuning_file_stays(self):
        folder = self.new_folder()
        file, run = folder / "tuning.json", ["run", "--odometry", self.street, "--frames", "0", "--disparities", 16, "--quiet", "--tuning"]
        file.write_text('{"another, driver 1": {"tile_width": 96, "tile_height": 8}}')
        for _ in range(2):
            self.assert_works("tune", *TUNE, "ForwardWarp", "--file", file)
        stored = json.loads(file.read_text())
        self.assertEqual((len(stored), stored.pop("another, driver 1")), (2, {"tile_width": 96, "tile_height": 8}))
        self.assert_works(*run, file, "--out", self.new_folder())
        key, = stored
        for broken in ("", "mine", "{", "[]", {key: {"tile_width": 3, "tile_height": 3}}, {key: {"tiles": 3}}, {key: 7}, {key: {"tile_width": "wide"}},
                       {"a, driver b": {"hello": 3}}, {"a": 7}):
            file.write_text(broken if isinstance(broken, str) else json.dumps(broken))
            with self.subTest(broken):
                others = [device for device in broken if isinstance(broken, dict) and isinstance(broken[device], dict)]
                said = [f'of "{others[0]}"', "take that entry out"] if others else []
                self.assert_refused_and_untouched(folder, ["tune", *TUNE, "ForwardWarp", "--file", file], file, *said)
                if isinstance(broken, str) or key in broken:
                    self.assert_refused([*run, file, "--out", self.folder / "never"], file, "egosgm tune")
