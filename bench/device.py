#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The half of scripts/bench-device after its build: runs what was built on a device, part by part, and writes what all of them found as one JSON.

  bench/device.py --programs DIR --out DIR --json FILE [--all] [--seconds N] [ARGUMENT OF egosgm_stages]...

A part that is not done in its time is stopped: the others' figures stay, and the file and the terminal say so. Exit code 1 where a part fails, or where
none has figures.
"""
import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import threading
import time

SOURCE = pathlib.Path(__file__).resolve().parents[1]
# Seconds. With --all they leave two minutes of ten to the build.
TESTS, ALL = "stage tests", {"stage tests": 150, "stages": 90, "same-bits": 70, "kernels": 60, "stream": 30, "tuner": 80}
ALONE = {TESTS: 240, "stages": None}
HEAD = ("device", "driver", "version", "compute_units", "threads", "commit", "date", "input")


def run(command, seconds, environment=None, says=True):
    """(how it ended, its lines); it and all that it started are killed when its time is over."""
    late, lines = threading.Event(), []
    with subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, stderr=None if says else subprocess.STDOUT, text=True, errors="replace",
                          start_new_session=True, cwd=SOURCE, env={**os.environ, **(environment or {})}) as process:

        def stop():
            late.set()
            os.killpg(process.pid, signal.SIGKILL)

        timer = threading.Timer(seconds or 0, stop)
        if seconds:
            timer.start()
        try:
            for line in process.stdout:
                lines.append(line.rstrip("\n"))
                if says:
                    print(line, end="", flush=True)
            code = process.wait()
        except KeyboardInterrupt:
            stop()
            raise
        finally:
            timer.cancel()
    return f"stopped after {seconds} s" if late.is_set() else "passed" if code == 0 else "failed", lines


def stage_tests(program, out, seconds):
    """In shards at once, as most of the time goes into the compiler, which takes a core."""
    number = min(os.cpu_count() or 1, 16)
    words = [program, "--gtest_shuffle", "--gtest_random_seed=1"]
    with concurrent.futures.ThreadPoolExecutor(number) as pool:
        shards = list(pool.map(lambda shard: run(words, seconds, {"GTEST_TOTAL_SHARDS": str(number), "GTEST_SHARD_INDEX": str(shard)}, says=False), range(number)))
    lines = [line for _, of_shard in shards for line in of_shard]
    (out / "tests.log").write_text("\n".join(lines) + "\n")
    listed = run([program, "--gtest_list_tests"], None, says=False)[1]
    count = {name: sum(bool(re.match(rf"\[ *{name} \] .*ms\)", line)) for line in lines) for name in ("OK", "FAILED")}
    found = {"passed": count["OK"], "failed": count["FAILED"], "of": sum(line.startswith("  ") for line in listed)}
    ends = {end for end, _ in shards}
    end = "failed" if "failed" in ends or found["failed"] else next(iter(ends - {"passed"}), "passed")
    if end == "failed":
        print("\n".join(lines))
    print(f"stage tests: {found['passed']} pass, {found['failed']} fail, of {found['of']}", flush=True)
    return end, found


def read(file):
    return json.loads(file.read_text()) if file.exists() else None


def merged(parts, out, tests, lines):
    """One text of all that the parts wrote, with the stages' figures first; none where no part has figures. `lines`: those that a part printed."""
    wrote = {name: read(out / f"{name}.json") for name in ("rows", "kernels", "stream", "tuning")}
    heads = [wrote[name] for name in ("rows", "kernels", "stream") if wrote[name]]
    if not heads:
        return None
    found = {**{name: heads[0][name] for name in HEAD if name in heads[0]}, **(wrote["rows"] or {"rows": []}), "parts": parts, "tests": tests}
    if wrote["kernels"]:
        found["kernels"] = wrote["kernels"]
    if wrote["stream"]:
        found["stream"] = wrote["stream"]["rows"]
    # Only lines that name no file and no folder.
    if "same-bits" in lines:
        found["same_bits"] = [line for line in lines["same-bits"] if re.match("differs: |not recorded: |the same to the bit: |no time for: ", line)]
    if "tuner" in lines:
        found["tuning"] = {"tried": [line for line in lines["tuner"] if re.search(r" ms\b|not on this device$", line)], "kept": wrote["tuning"]}
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False)
    for name in ("--programs", "--out", "--json"):
        parser.add_argument(name, type=pathlib.Path, required=True)
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--seconds", type=int)
    for name in ("--size", "--disparities", "--rounds", "--threads"):
        parser.add_argument(name)
    given, more = parser.parse_known_args()
    programs, out = given.programs.resolve(), given.out.resolve()
    limits = {name: seconds if given.seconds is None else given.seconds for name, seconds in (ALL if given.all else ALONE).items()}
    sizes = [f"--{name}={value}" for name, value in vars(given).items() if name in ("size", "disparities", "rounds", "threads") and value]
    stages_sizes = sizes or ([] if given.all else ["--size=1242x375", "--disparities=128"])
    width, _, height = (given.size or "1242x375").partition("x")
    tuner_sizes = ["--width", width, "--height", height, *(["--disparities", given.disparities] if given.disparities else []),
                   *(["--rounds", max(2, int(given.rounds))] if given.rounds else [])]
    ruler = [sys.executable, "-B", SOURCE / "bench/kernels.py", "--program", programs / "bench/egosgm_kernels"]
    program = programs / "apps/egosgm"
    same_bits = [sys.executable, "-B", SOURCE / "scripts/same-bits", "--program", program, "--check", SOURCE / "tests/same_bits.json"]
    if limits.get("same-bits"):
        same_bits += ["--seconds", int(0.8 * limits["same-bits"])]
    commands = {
        "stages": [programs / "bench/egosgm_stages", "--json", out / "rows.json", "--bits", SOURCE / "bench/street_bits.txt", *stages_sizes, *more],
        "same-bits": same_bits,
        "kernels": [*ruler, "--json", out / "kernels.json", *sizes],
        "stream": [programs / "bench/egosgm_offload", "--json", out / "stream.json", *sizes],
        "tuner": [program, "tune", "--file", out / "tuning.json", *tuner_sizes],
    }
    for name in ("stages", "rows", "kernels", "stream", "tuning"):  # an earlier run's figures are none of this one
        (out / f"{name}.json").unlink(missing_ok=True)
    temporary = out / "temporary"  # of parts that are killed, too
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    os.environ["TMPDIR"] = str(temporary)
    parts, lines, tests = {}, {}, None
    for name, seconds in limits.items():
        begun = time.monotonic()
        if name in ("same-bits", "tuner") and not program.exists():
            end = "left out: the program's libraries are missing"
        elif name == TESTS:
            end, tests = stage_tests(programs / "tests/egosgm_stage_test", out, seconds)
        else:
            end, lines[name] = run(commands[name], seconds)
        parts[name] = {"end": end, "seconds": round(time.monotonic() - begun, 1)}
        if end != "passed":
            print(f"{name}: {end}", flush=True)
    shutil.rmtree(temporary, ignore_errors=True)
    found = merged(parts, out, tests, lines)
    if found:
        given.json.write_text(json.dumps(found, indent=1) + "\n")
        print(f"Written: {given.json}", flush=True)
    else:
        print("bench-device: the benchmarks ended without figures", file=sys.stderr)
    wrong = [name for name, part in parts.items() if part["end"] == "failed"]
    if wrong:
        print(f"bench-device: failed on this device, or its maps differ (see above): {', '.join(wrong)}: do not trust its figures", file=sys.stderr)
    return 1 if wrong or not found else 0


if __name__ == "__main__":
    sys.exit(main())
