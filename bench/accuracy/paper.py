# SPDX-License-Identifier: Apache-2.0
"""The table of Fućek et al. (IFAC 2017)."""
import json
import pathlib
import re
import statistics

from inputs import PAPER, SINGLE_FRAME, STEADY_FROM, expect, scored_frames, settings, told
from tables import Table, shown

HOST_TIMES = {"total", "odometry", "read", "write", "wall"}  # in a report; all others are stages'
# The paper has a window of 3x3 and does not name its cost; census is the other one that was tried (docs/understand/paper.md).
CONFIGURATIONS = {"paper": PAPER, "paper, census 5x5": (*PAPER, *settings("cost=census5x5")), "default": ()}
COLUMNS = ("single_frame", "method", "method_interpolated", "search")


def scenes(bench, arguments):
    """Openers of all inputs at hand, by title."""
    openers = {"2012 / 000151": lambda: bench.multiview(2012, "000151", "7:10"), "2012 / 000138": lambda: bench.backwards(2012, "000138"),
               "2015 / 000002": lambda: bench.backwards(2015, "000002"), "odometry A": bench.odometry_a}
    for name in ("warehouse", "forest", "kitchen"):
        openers[f"rendered {name}"] = lambda name=name: rendered(bench, name)
    for seed in (1, 2, 3):
        openers[f"street, seed {seed}"] = lambda seed=seed: bench.synthetic(seed=seed)
    openers["street, moving objects"] = lambda: bench.synthetic(moving=True)
    if arguments.kitti2015:
        folder = pathlib.Path(arguments.kitti2015)
        folder = folder / "training" if (folder / "training").is_dir() else folder
        for scene in [f"{int(number):06d}" for number in arguments.scenes.split(",")]:
            openers[f"2015 / {scene}"] = lambda scene=scene: bench.multiview(2015, scene, arguments.frames, folder)
    return openers


def rendered(bench, name):
    folder = expect(bench.data / "rendered" / name)
    return bench.odometry_layout(f"rendered {name}", folder, truth=folder / "truth/left_disp_noc")


def mean_figures(source, result):
    """The mean of each figure over the frames that count."""
    frames = [result["frames"][number] for number in scored_frames(source, result) if number in result["frames"]]
    return {name: statistics.mean(frame[name] for frame in frames) for name in frames[0]
            if all(frame.get(name) is not None for frame in frames)}


def device_ms(bench, source, arguments):
    """What the device takes for a steady frame: the median of those that count."""
    result = bench.run(source, arguments)
    report = json.loads((bench.folder_of(source, arguments) / "report.json").read_text())
    wanted = set(scored_frames(source, result))
    return statistics.median(sum(ms for stage, ms in frame["ms"].items() if stage not in HOST_TIMES)
                             for frame in report["frames"] if frame["frame"] in wanted)


def measured(bench, source, method):
    """A row of the paper's table. A sequence without truth has none of the errors."""
    single = (*method, *SINGLE_FRAME)
    of_method, of_single = mean_figures(source, bench.run(source, method)), mean_figures(source, bench.run(source, single))
    return {"single_frame": of_single.get("bad_or_missing"), "method": of_method.get("bad_or_missing"),
            "method_interpolated": of_method.get("interpolated"), "search": of_method["search"],
            "is_steady": len(bench.run(source, method)["frames"]) > STEADY_FROM,
            "time": device_ms(bench, source, method) / device_ms(bench, source, single)}


def paper_table(bench, arguments):
    """Prints the table; returns its rows, and the figures that have limits."""
    table, rows = Table(), []
    print(f"{'scene':<42} {'method':<18} {'single frame':>14} {'fused':>10} {'interpolated':>14} {'search':>8} {'time':>7}")
    for title, opener in scenes(bench, arguments).items():
        if not re.search(arguments.only, title):
            continue
        for name, configuration in CONFIGURATIONS.items():
            row = {"scene": title, "preset": name}
            rows.append(row)
            try:
                row.update(measured(bench, opener(), configuration))
            except Exception as reason:
                row["skipped"] = told(reason)
                print(f"{title:<42} {name:<18} {row['skipped']}")
                continue
            percent = [f"{shown(row[column])} %" if row[column] is not None else "" for column in COLUMNS]
            print(f"{title:<42} {name:<18} {percent[0]:>14} {percent[1]:>10} {percent[2]:>14} {percent[3]:>8} {row['time']:>7.2f}", flush=True)
            if name == "paper":
                add_limits(table, title, row)
    print("single frame, fused: pixels that are bad or missing. time: of a steady frame on the device, as a share of the single frame's.\n")
    table.print()
    return rows, table


def add_limits(table, title, row):
    limit = "paper, " if title == "2012 / 000151" else None
    if row["method"] is not None:
        table.add(title, "bad or missing / its single frame's", row["method"] / row["single_frame"], "", limit=limit and limit + "bad or missing")
    table.add(title, "search", row["search"], limit=limit and limit + "search")
    table.add(title, "time / its single frame's", row["time"], "", limit="paper, time" if row["is_steady"] else None)
