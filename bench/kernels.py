#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How near each kernel of a full and of a steady frame comes to what binds it on a device.

  bench/kernels.py [--program FILE] [--json FILE] [--picture FILE.png] [--against FILE] [ARGUMENT OF egosgm_kernels]...
  bench/kernels.py --read FILE [--picture FILE.png] [--against FILE]    of what --json wrote

--program: build/bench/egosgm_kernels of this source unless given; EGOSGM_DEVICE chooses the device.
--against: names what got slower than in that file by more than the spread of both, and ends with exit code 1 then.
The table: a kernel's time in a frame (all its launches: median, and half of the values lie within the spread), what it moves and computes by
kernels/costs.json, the roof that binds it, and how much of that roof it reaches. Bytes are those that its work-items ask for, so that what
caches serve may reach more than the roof of a copy. The roof of operations is of 16 bits, so that narrower ones may reach more than it.
The picture has a dot for each kernel that computes, and needs matplotlib.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

SOURCE = pathlib.Path(__file__).resolve().parents[1]
COSTS = SOURCE / "kernels/costs.json"
ROOFS = {"copy_gb_s": "copy, GB/s", "min_add_g_s": "minima and additions of 16 bits, G/s", "popcount_g_s": "bit counts of 32 bits, G/s",
         "launch_us": "launch, us", "enqueue_us": "launch for the host, us", "local_gb_s": "local memory, GB/s", "barrier_ns": "barrier, ns"}
CACHES = ("POCL_CACHE_DIR", "CUDA_CACHE_PATH", "NEO_CACHE_DIR", "MESA_SHADER_CACHE_DIR", "EGOSGM_CACHE")  # of drivers, and ours


def run(program, arguments, caches):
    """What the program writes with `caches` in place of the drivers' own."""
    file = caches / "rows.json"
    for name in CACHES:
        (caches / name).mkdir(exist_ok=True)
    subprocess.run([program, *arguments, "--json", file], check=True, stdout=subprocess.DEVNULL,
                   env={**os.environ, **{name: str(caches / name) for name in CACHES if name != "EGOSGM_CACHE" or name not in os.environ}})
    return json.loads(file.read_text())


def measure(program, arguments):
    with tempfile.TemporaryDirectory() as caches:
        cold = run(program, arguments, pathlib.Path(caches))
        warm = run(program, [*arguments, "--rounds", "1"], pathlib.Path(caches))
    return {**{name: cold[name] for name in ("device", "driver", "version", "compute_units", "threads", "commit", "date", "input")},
            "width": cold["rows"][0]["width"], "height": cold["rows"][0]["height"], "disparities": cold["rows"][0]["disparities"],
            "roofs": {name: cold[name] for name in ROOFS}, "build_s": {"cold": cold["build_s"], "warm": warm["build_s"]},
            "kernels": [with_costs(row, cold, json.loads(COSTS.read_text())) for row in cold["rows"]]}


def costs_of(row, costs):
    """What a kernel's launches in a frame cost together, by the formulas of kernels/costs.json: {"bytes": ..., "ops": ...}."""
    frame, stage, kernel = row["name"].split(".")
    formulas = costs["kernels"].get(kernel, {})
    names = {"pixels": row["width"] * row["height"], "rows": row["height"], "cells": row["cells"]}
    if f"{stage}.{kernel}" in costs["small"]:  # images of a quarter the width and height, in their whole range
        frame, names = "small", {"pixels": names["pixels"] / 16, "rows": names["rows"] / 4, "cells": names["pixels"] / 16 * max(8, row["disparities"] / 4)}
    times = 1 if kernel in costs["of_frame"] else row["launches"]
    return {name: times * float(eval(formula, {"__builtins__": {}}, names)) for name, formula in {**formulas, **formulas.get(frame, {})}.items()
            if isinstance(formula, str)}


def with_costs(row, roofs, costs):
    """A row of egosgm_kernels with what its kernel costs, the roof that binds it, and how much of it is reached."""
    frame, stage, kernel = row["name"].split(".")
    told = {"frame": frame, "stage": stage, "kernel": kernel, "launches": int(row["launches"]),
            **{name: row[name] for name in ("median_ms", "lower_ms", "upper_ms")}, **costs_of(row, costs)}
    least_ms = {"launch": 1e-3 * roofs["launch_us"] * told["launches"]}
    for name, roof in (("bytes", "copy_gb_s"), ("ops", "min_add_g_s"), ("popcounts", "popcount_g_s")):
        if name in told:
            least_ms[{"bytes": "copy"}.get(name, name)] = 1e-6 * told[name] / roofs[roof]
    bound = max(least_ms, key=least_ms.get)
    return {**told, "bound": bound, "of_roof": least_ms[bound] / row["median_ms"]}


def table(found):
    yield (f"{found['device']}, driver {found['driver']}, {found['compute_units']} compute units; {found['width']}x{found['height']}, "
           f"D = {found['disparities']}; commit {found['commit']}, {found['date'][:10]}\n")
    yield "| roof | |\n| --- | ---: |"
    yield from (f"| {ROOFS[name]} | {value:.4g} |" for name, value in found["roofs"].items() if value)
    yield f"| build, cold and warm, s | {found['build_s']['cold']:.2f}, {found['build_s']['warm']:.2f} |\n"
    for frame in ("full", "steady"):
        rows = sorted((row for row in found["kernels"] if row["frame"] == frame), key=lambda row: -row["median_ms"])
        yield f"| {frame} frame: kernel | launches | ms | spread | GB/s | Gops/s | bound | of it |\n| --- | ---: | ---: | ---: | ---: | ---: | --- | ---: |"
        for row in rows:
            rates = [f"{1e-6 * row[name] / row['median_ms']:.1f}" if name in row else "" for name in ("bytes", "ops")]
            yield (f"| {row['stage']}.{row['kernel']} | {row['launches']} | {row['median_ms']:.3f} | {row['upper_ms'] - row['lower_ms']:.3f} | "
                   f"{rates[0]} | {rates[1]} | {row['bound']} | {100 * row['of_roof']:.0f} % |")
        yield f"| all | {sum(row['launches'] for row in rows)} | {sum(row['median_ms'] for row in rows):.3f} | | | | | |\n"


def slower(found, before):
    """Names and times of what got slower than the spread of both."""
    same = ("device", "width", "height", "disparities")
    if any(found[name] != before[name] for name in same):
        raise SystemExit(f"kernels: --against: {[before[name] for name in same]} is not {[found[name] for name in same]}: measure both alike")
    known = {(row["frame"], row["stage"], row["kernel"]): row for row in before["kernels"]}
    for row in found["kernels"]:
        old = known.get((row["frame"], row["stage"], row["kernel"]))
        if old and row["lower_ms"] > old["upper_ms"]:
            yield f"slower: {row['frame']} {row['stage']}.{row['kernel']}: {old['median_ms']:.3f} ms, then {row['median_ms']:.3f} ms"


def draw(found, file):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    roofs = found["roofs"]
    rows = [row for row in found["kernels"] if "ops" in row and "bytes" in row]
    intensities = [row["ops"] / row["bytes"] for row in rows]
    left, right = min(intensities) / 2, max(*intensities, roofs["min_add_g_s"] / roofs["copy_gb_s"]) * 2
    figure, axes = pyplot.subplots(figsize=(10, 6.5))
    knee = roofs["min_add_g_s"] / roofs["copy_gb_s"]
    axes.loglog([left, knee, right], [left * roofs["copy_gb_s"], roofs["min_add_g_s"], roofs["min_add_g_s"]], color="#333333")
    axes.text(left, left * roofs["copy_gb_s"] * 2.5, f"copy {roofs['copy_gb_s']:.1f} GB/s")
    axes.text(right, roofs["min_add_g_s"] * 1.08, f"minima and additions {roofs['min_add_g_s']:.0f} G/s", ha="right")
    most = max(row["median_ms"] for row in rows)
    for frame, color in (("full", "#d1495b"), ("steady", "#1b6ca8")):
        points = [(x, 1e-6 * row["ops"] / row["median_ms"], row) for x, row in zip(intensities, rows) if row["frame"] == frame]
        axes.scatter([x for x, _, _ in points], [y for _, y, _ in points], s=[15 + 400 * row["median_ms"] / most for _, _, row in points], color=color,
                     alpha=0.6, linewidths=0)
        axes.scatter([], [], s=40, color=color, alpha=0.6, linewidths=0, label=f"{frame} frame")
        for x, y, row in sorted(points, key=lambda point: -point[2]["median_ms"])[:8]:
            axes.annotate(row["kernel"], (x, y), fontsize=8, xytext=(5, 4), textcoords="offset points")
    axes.set_xlabel("operations a byte that is asked for")
    axes.set_ylabel("operations, 10⁹ a second")
    axes.set_title(f"{found['device']}, {found['width']}×{found['height']}, D = {found['disparities']} (area: time)", fontsize=10)
    axes.legend(loc="lower right")
    axes.grid(alpha=0.25, which="both")
    figure.tight_layout()
    figure.savefig(file, dpi=130)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=SOURCE / "build/bench/egosgm_kernels", type=pathlib.Path)
    for name in ("--json", "--picture", "--against", "--read"):
        parser.add_argument(name, type=pathlib.Path)
    given, arguments = parser.parse_known_args()
    if not given.read and not given.program.exists():
        raise SystemExit(f"kernels: {given.program}: not there: build the target egosgm_kernels, or give --program FILE")
    found = json.loads(given.read.read_text()) if given.read else measure(given.program, arguments)
    print("\n".join(table(found)))
    if given.json:
        given.json.write_text(json.dumps(found, indent=1) + "\n")
    if given.picture:
        draw(found, given.picture)
    worse = list(slower(found, json.loads(given.against.read_text()))) if given.against else []
    print("\n".join(worse) if worse else "nothing got slower beyond the spread" if given.against else "", end="\n" if given.against else "")
    return 1 if worse else 0


if __name__ == "__main__":
    sys.exit(main())
