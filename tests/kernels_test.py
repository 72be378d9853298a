# SPDX-License-Identifier: Apache-2.0
"""The ruler of kernels: bench/kernels.py on egosgm_kernels, which is named first. Its formulas are held against a run that counts, by Oclgrind."""
import copy
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM = sys.argv.pop(1)
SOURCE = pathlib.Path(__file__).resolve().parents[1]
SIZE = ("--size", "96x64", "--disparities", "16", "--rounds", "1")
sys.path.insert(0, str(SOURCE / "bench"))
import kernels  # noqa: E402

LANES = 16  # of a vector of the kernels for CPUs
VECTOR = re.compile(r"call _Z\d+\w+?Dv(\d+)_")  # a function of vectors
OF_MEMORY = re.compile(r"call _Z\d+v(?:load|store)(\d+)\w*PU3AS1K?([a-z])")  # of global memory; Oclgrind counts no bytes of it
BYTES = {"h": 1, "c": 1, "t": 2, "s": 2, "j": 4, "i": 4, "f": 4, "m": 8, "l": 8}
ARITHMETIC = re.compile(r"f(add|sub|mul|div|cmp)|and|or|xor|shl|[al]shr|select")  # without what counts places and turns, too


def ruler(*arguments):
    return subprocess.run([sys.executable, "-B", SOURCE / "bench/kernels.py", "--program", PROGRAM, *arguments], capture_output=True, text=True, timeout=900)


def expect(test, schema, value, where="file"):
    """What bench/kernels.schema.json uses of JSON Schema."""
    kinds = {"object": dict, "array": list, "string": str, "integer": int, "number": (int, float)}
    if "type" in schema:
        test.assertIsInstance(value, kinds[schema["type"]], where)
    test.assertIn(value, schema.get("enum", [value]), where)
    if "minimum" in schema:
        test.assertGreaterEqual(value, schema["minimum"], where)
    for item in value if "items" in schema else []:
        expect(test, schema["items"], item, f"{where}[]")
    if isinstance(value, dict):
        test.assertLessEqual(set(schema.get("required", ())), set(value), where)
        for name, inner in value.items():
            found = schema.get("properties", {}).get(name, schema.get("additionalProperties", True))
            test.assertTrue(found, f"{where}.{name} is not in the schema")
            expect(test, found if isinstance(found, dict) else {}, inner, f"{where}.{name}")


class Ruler(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.file = cls.folder / "found.json"
        done = ruler(*SIZE, "--json", cls.file)
        assert done.returncode == 0, done.stderr
        cls.table, cls.found = done.stdout, json.loads(cls.file.read_text())

    def test_the_file_has_the_form_of_the_schema(self):
        expect(self, json.loads((SOURCE / "bench/kernels.schema.json").read_text()), self.found)
        for name in ("copy_gb_s", "min_add_g_s", "popcount_g_s", "launch_us"):
            self.assertGreater(self.found["roofs"][name], 0)

    def test_every_kernel_of_both_frames_has_costs_and_a_row(self):
        for row in self.found["kernels"]:
            self.assertIn("bytes", row, f"{row['stage']}.{row['kernel']}: kernels/costs.json has no bytes for it")
            self.assertIn(f"| {row['stage']}.{row['kernel']} |", self.table)
        for frame in ("full", "steady"):
            self.assertIn("BandedSgm", {row["stage"] for row in self.found["kernels"] if row["frame"] == frame})

    def test_what_got_slower_than_the_spread_is_named(self):
        before = copy.deepcopy(self.found)
        slow = before["kernels"][0]
        slow["upper_ms"] = self.found["kernels"][0]["lower_ms"] / 2
        old = self.folder / "before.json"
        old.write_text(json.dumps(before))
        done = ruler("--read", self.file, "--against", old)
        self.assertEqual(done.returncode, 1)
        self.assertEqual(re.findall("(?m)^slower: (.*?):", done.stdout), [f"{slow['frame']} {slow['stage']}.{slow['kernel']}"])
        self.assertEqual(ruler("--read", self.file, "--against", self.file).returncode, 0)
        old.write_text(json.dumps({**before, "width": 97}))
        self.assertIn("measure both alike", ruler("--read", self.file, "--against", old).stderr)

    def test_the_picture(self):
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            self.skipTest("no matplotlib")
        done = ruler("--read", self.file, "--picture", self.folder / "roofs.png")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((self.folder / "roofs.png").read_bytes()[:4], b"\x89PNG")


def counts(program, arguments):
    """By frame and kernel: bytes that work-items asked for, and operations: functions of vectors, logic and floating point, of each
    value. Integer additions and comparisons are left out, as most are of places in memory."""
    done = subprocess.run(["oclgrind", "--build-options", "-cl-opt-disable", "--inst-counts", program, *arguments, "--count"], capture_output=True, text=True,
                          timeout=900)
    if done.returncode != 0:
        raise AssertionError(done.stdout + done.stderr)
    found, launches = {}, []
    for line in done.stdout.splitlines():
        if begins := re.match("Instructions executed for kernel '(.*)':", line):
            launches.append((begins[1], {"bytes": 0, "ops": 0}))
        elif counted := re.match(r" *(\d+) - (.*?)(?: \((\d+) bytes\))?$", line):
            _, sums = launches[-1]
            sums["bytes"] += int(counted[3]) if counted[2].endswith(" global") else 0
            if memory := OF_MEMORY.match(counted[2]):
                sums["bytes"] += int(counted[1]) * int(memory[1]) * BYTES[memory[2]]
            lanes = VECTOR.match(counted[2])
            sums["ops"] += int(counted[1]) * (int(lanes[1]) if lanes else LANES if ARITHMETIC.fullmatch(counted[2]) else 0)
        elif ends := re.match(r"frame (\w+) ", line):
            for kernel, sums in launches if ends[1] != "none" else []:
                of_frame = found.setdefault((ends[1], kernel), {"bytes": 0, "ops": 0})
                for name, value in sums.items():
                    of_frame[name] += value
            launches = []
    return found


@unittest.skipUnless(shutil.which("oclgrind"), "no oclgrind: apt install oclgrind")
class Counted(unittest.TestCase):
    def test_formulas_are_what_a_run_counts(self):
        """A kernel's work-items ask for so many bytes, and have so many arithmetic instructions."""
        costs, counted, told = json.loads(kernels.COSTS.read_text()), counts(PROGRAM, SIZE), {}
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "rows.json"
            subprocess.run([PROGRAM, *SIZE, "--json", file], check=True, capture_output=True, timeout=900)
            rows = json.loads(file.read_text())["rows"]
        for row in rows:  # Oclgrind names kernels, which several stages may share
            frame, _, kernel = row["name"].split(".")
            sums = told.setdefault((frame, kernel), {})
            for name, value in kernels.costs_of(row, costs).items():
                sums[name] = sums.get(name, 0) + value
        self.assertEqual(set(told), set(counted))
        for of, sums in told.items():
            for name, value in sums.items():
                self.assertTrue(0.8 < value / counted[of][name] < 1.25, f"{of}: {name} are {value:.0f} by the formulas, {counted[of][name]} counted")


if __name__ == "__main__":
    unittest.main()
