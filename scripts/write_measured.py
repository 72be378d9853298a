#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes docs/understand/measured.md, and the table of README.md, from what the benches left in docs/measured/: the only places with figures that a run
could change.

  scripts/write_measured.py           writes the page
  scripts/write_measured.py --check   exit code 1 where the page is not what would be written, 77 where there is nothing to write it from
scripts/measure runs the benches. All of one page must come from one commit without changes, or it is refused. The table of scripts/drivers
(build/lanes/drivers.json, to be put beside the others) names its own, row by row.
"""
import json
import pathlib
import sys

from usage import Parser

DOCS = pathlib.Path(__file__).resolve().parents[1] / "docs"
FILES = ("accuracy", "video", "compare", "stages")
EVIDENCE = "evidence"  # may be missing
DRIVERS = "drivers"  # of scripts/drivers, which runs apart: each row has a commit of its own, and all may be missing
DEVICES = "devices"  # a folder of what scripts/bench-device wrote on other machines; may be missing
CONTENDERS = {
    "opencv_hh": "OpenCV MODE_HH, 8 paths, left view",
    "opencv_hh4": "OpenCV MODE_HH4, 4 paths, left view",
    "opencv_sgbm": "OpenCV MODE_SGBM, 5 paths, left view",
    "opencv_3way": "OpenCV MODE_SGBM_3WAY, 3 paths, left view",
    "egosgm_full_left": "EgoSGM, full range, 8 paths, left view",
    "egosgm_full_both": "EgoSGM, full range, both views, checked",
    "egosgm_banded_frame": "EgoSGM, steady frame, both views, motion given",
    "egosgm_banded_left": "EgoSGM, the same with the left view tracked alone",
    "egosgm_video_frame": "EgoSGM, steady frame with odometry",
    "egosgm_video_objects": "EgoSGM, steady frame with odometry, objects and scene flow",
}
# Rows of the README's table: the name there, and the input and figure of a row of bench/accuracy.
RESULTS = [
    ("KITTI 2012 scene 000151, frame 10 of 7 to 10", "2012 / 000151", "bad_or_missing"),
    ("the same, holes filled as KITTI's kit does", "2012 / 000151", "interpolated"),
    ("KITTI 2012 scene 000138, frame 10 after 11", "2012 / 000138, frames 11, 10", "bad_or_missing, frame 10"),
    ("KITTI 2015 scene 000002, frame 10 after 11 (D1)", "2015 / 000002, frames 11, 10", "d1, frame 10"),
    ("synthetic street, seed 1", "synthetic, true poses, seed 1", "bad_or_missing, pixels from frame 3 on"),
]
TIMES = ("opencv_hh", "opencv_3way", "egosgm_full_both", "egosgm_banded_frame", "egosgm_banded_left")
BEGIN, END = "<!-- results: scripts/write_measured.py writes this -->\n", "<!-- end of results -->\n"
NO_FILES, DIFFERS = 77, 1


class Refused(Exception):
    """What the files hold makes no page."""


def read(folder):
    missing = [name for name in FILES if not (folder / f"{name}.json").exists()]
    if missing:
        raise FileNotFoundError(", ".join(f"{folder / name}.json" for name in missing))
    others = sorted(file.name for file in folder.iterdir() if file.stem not in (*FILES, EVIDENCE, DRIVERS, DEVICES))
    if others:
        raise Refused(f"{folder}: the page is not made from {', '.join(others)}: remove what is left of other runs")
    present = [name for name in (*FILES, EVIDENCE, DRIVERS) if (folder / f"{name}.json").exists()]
    found = {name: json.loads((folder / f"{name}.json").read_text()) for name in present}
    machines = [(file, json.loads(file.read_text())) for file in sorted((folder / DEVICES).glob("*.json"))]
    for file, machine in machines:
        if not {"device", "driver", "compute_units", "copy_gb_s", "commit", "date", "rows"} <= machine.keys() or not is_clean(machine["commit"]):
            raise Refused(f"{file}: is not what scripts/bench-device wrote at a commit without changes: run it there on a clean checkout")
    return {**found, DEVICES: [machine for _, machine in machines]}


def is_clean(commit):
    return not commit.endswith("-dirty") and commit != "unknown"


def expect_one_commit(found):
    if DRIVERS in found and not all(is_clean(row[-1]) for row in found[DRIVERS]["rows"]):
        raise Refused(f"{DRIVERS}.json: not of a commit without changes: run scripts/drivers on a clean checkout")
    found = {name: content for name, content in found.items() if name not in (DRIVERS, DEVICES)}
    commits = {name: content["commit"] for name, content in found.items()}
    if len(set(commits.values())) != 1 or not all(map(is_clean, commits.values())):
        raise Refused(f"not of one commit without changes: {commits}: run scripts/measure on a clean checkout")
    devices = {(content["device"], content["driver"]) for content in found.values()}
    if len(devices) != 1:
        raise Refused(f"not of one device: {sorted(devices)}: run scripts/measure on one machine")


def table(header, rows):
    """Words to the left, numbers to the right."""
    words = [i == 0 or any(row[i][:1].isalpha() for row in rows) for i in range(len(header))]
    lines = ["| " + " | ".join(header) + " |", "| " + " | ".join("---" if left else "---:" for left in words) + " |"]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def number(value, unit=""):
    if value is None:
        return ""
    return f"{value:.{2 if abs(value) >= 1 else 3}f}" + (f" {unit}" if unit else "")


def limit_of(row):
    if row.get("at_most") is not None:
        return f"≤ {row['at_most']:.4g}"
    return f"≥ {row['at_least']:.4g}" if row.get("at_least") is not None else ""


def accuracy(content):
    rows, skipped = [], []
    for row in content["rows"]:
        if "value" not in row:
            skipped.append(f"- {row['input']}: {row['figure']}")
            continue
        verdict = " **missed**" if row["passed"] is False else ""
        rows.append([row["input"], row["figure"], number(row["value"], row["unit"]), number(row["single_frame"]), limit_of(row) + verdict])
    text = "## Accuracy\n\n\"Single frame\" is the same matcher without the frames before (`--temporal off`), on the same frames.\n\n"
    text += table(["input", "figure", "EgoSGM", "single frame", "limit"], rows)
    return text + ("\nNot measured:\n\n" + "\n".join(skipped) + "\n" if skipped else "")


def video_table(found):
    """Rows of titles and numbers; those that were skipped are told below."""
    rows = [[value if isinstance(value, str) else number(value) for value in row] for row in found["rows"] if len(row) == len(found["headings"])]
    skipped = [f"- {': '.join(row)}" for row in found["rows"] if len(row) != len(found["headings"])]
    return table(found["headings"], rows) + ("\nNot measured:\n\n" + "\n".join(skipped) + "\n" if skipped else "")


def video(content):
    found = content["video"]
    return "\n".join([
        "## Over time\n\nFrom frame 3 on, pixels that both views see; percent unless px. \"Harm\" and \"help\": of the pixels that differ from the single "
        "frame's by more than 1 px. \"Bad at the single frame's density\": of the surest pixels by the variance, of as many as the single frame has. "
        "\"Error² / variance\": the mean, of errors up to 3 px. The filters are those of cameras: 0.4 of the new and 0.6 of the old disparity where they differ by less than the step. "
        "[What each figure is](../use/evaluation.md).\n", video_table(found["methods"]),
        *([] if "ratios" not in found else ["### Bad of valid, to the single frame\n\nOne video can decide a mean, but no median.\n",
                                           video_table(found["ratios"])]),
        "### A wrong motion\n\nThe true motions, each off by so much in a random direction, and believed.\n", video_table(found["pose_noise"]),
        "### Missing frames\n\nThe last frame, when the frames before it are missing.\n", video_table(found["dropped_frames"])])


def evidence(content):
    found = content["evidence"]
    return "\n".join([
        "## Places without evidence\n\nThe last frame beside the same frame alone; percent, all pixels that have truth. Sky, corridor, fence, poles and plain streets "
        "have no texture, or one that repeats, in large parts. \"Gained\": what the video's map has and the single frame's has not. What is right is off by at most 3 px. "
        "[What each figure is](../use/evaluation.md#figures-of-single-frames).\n", video_table(found["places"]),
        "### One pair again and again\n\nIt brings no evidence that the first time did not bring.\n", video_table(found["repeated"]),
        *([] if "standing" not in found else [
            "### A camera that stands\n\nOne pair with new noise in every frame; a lens is covered in part, or a hand is nearer than the range.\n",
            video_table(found["standing"])]),
        "### Thin poles\n\nPercent of the pixels of a pole, before a wall, that are off by at most 2 px.\n", video_table(found["poles"]),
        "### The paper's preset in such places\n\nPercent of all pixels of the last frame ([why](paper.md#where-nothing-is-seen)).\n", video_table(found["paper"])])


def speed(content):
    ms = {(row["name"], row["width"], row["height"], row["disparities"]): row["median_ms"] for row in content["rows"]}
    rows = []
    for row in content["rows"]:
        name = row["name"].removesuffix("_1t")
        one = name != row["name"]
        reference = ms.get(("opencv_hh_1t" if one else "opencv_hh", row["width"], row["height"], row["disparities"]))
        rows.append([CONTENDERS.get(name, name), f"{row['width']}×{row['height']}, {row['disparities']}", "1" if one else str(content["threads"]),
                     number(row["cpus"]), number(row["median_ms"], "ms"), number(row["median_ms"] / reference) if reference else "",
                     f"{100 * row['search_fraction']:.1f} %" if "search_fraction" in row else ""])
    text = ("## Speed\n\nMedians of random turns. \"At work\" is processor time by wall time: how many threads a row kept at work in the mean. "
            "\"/ MODE_HH\" is by MODE_HH's time with as many threads allowed.\n\n")
    return text + table(["", "size, D", "threads allowed", "at work", "time", "/ MODE_HH", "search"], rows)


def stages(content):
    rows = [[row["name"], f"{row['width']}×{row['height']}, {row['disparities']}", number(row["median_ms"], "ms"), number(row.get("device_ms"), "ms"),
             number(row.get("GB_s"))] for row in content["rows"]]
    return "## Stages\n\nOf a steady frame, stage by stage, and by steps.\n\n" + table(["stage", "size, D", "time", "on the device", "GB/s"], rows)


def machines(found):
    """A row for each that sent its figures, beside this one's."""
    rows = []
    for machine in (found["stages"], *found[DEVICES]):
        ms = {row["name"]: row["median_ms"] for row in machine["rows"] if (row["width"], row["disparities"]) == (1242, 128)}
        rows.append([machine["device"], machine["driver"], str(machine["compute_units"]), number(machine.get("copy_gb_s")),
                     *(number(ms.get(name), "ms") for name in ("BandedSgm_full", "full_frame", "steady_frame")), machine["commit"], machine["date"][:10]])
    return ("## Devices\n\nBy `scripts/bench-device` at 1242×375, D = 128: this machine's, and those that came ([send yours](../use/send-your-device.md)).\n\n" +
            table(["device", "driver", "compute units", "copy, GB/s", "full search", "full frame", "steady frame", "commit", "date"], rows))


def drivers(content):
    text = ("## Other drivers\n\nBy `scripts/drivers`. Maps are those of whole runs. A run is that of a short street, its time that of the clock; the first "
            "one compiles. The ratio is that of the stages of a steady frame, of turns: the median, and the least and the largest.\n\n")
    rule = "| " + " | ".join("---" for _ in content["headings"]) + " |"
    lines = ["| " + " | ".join(row) + " |" for row in [content["headings"], *content["rows"]]]
    return text + "\n".join([lines[0], rule, *lines[1:]]) + "\n"


def page(found):
    expect_one_commit(found)
    machine = found["compare"]
    head = ("# Measured\n\n<!-- Written by scripts/write_measured.py from docs/measured/: do not edit. -->\n\n"
            f"{machine['device']}, {machine['compute_units']} compute units, {machine['version']}, driver {machine['driver']}; commit {machine['commit']}; "
            f"{machine['date'][:10]}. Speed on {machine['input']}.\n`scripts/measure` runs all of it again. \"Search\" counts every cell that is matched "
            "([how much is searched](how-it-works.md#how-much-is-searched)).\n")
    places = [evidence(found[EVIDENCE])] if EVIDENCE in found else []
    parts = [head, accuracy(found["accuracy"]), video(found["video"]), *places, speed(found["compare"]), stages(found["stages"]), machines(found)]
    return "\n".join(parts + ([drivers(found[DRIVERS])] if DRIVERS in found else []))


def results(found):
    """The table of the README: a few rows of accuracy beside the single frame's, and of speed."""
    rows = []
    for title, where, figure in RESULTS:
        chosen = [row for row in found["accuracy"]["rows"] if row["input"].startswith(where) and row["figure"] == figure and "value" in row
                  and row["single_frame"] is not None]
        rows += [[title, f"{row['value']:.2f} %", f"{row['single_frame']:.2f} %"] for row in chosen[:1]]
    text = table(["bad or missing (off by more than 3 px)", "EgoSGM", "the same matcher, single frames"], rows) + "\n"
    compare = found["compare"]
    largest = max((row for row in compare["rows"]), key=lambda row: (row["width"] == 1242, row["disparities"] == 128))
    times = [[CONTENDERS[row["name"]], f"{row['median_ms']:.1f} ms"] for name in TIMES for row in compare["rows"]
             if row["name"] == name and all(row[key] == largest[key] for key in ("width", "height", "disparities"))]
    title = f"time of a pair, {largest['width']}×{largest['height']}, D = {largest['disparities']}, {compare['threads']} threads"
    return text + table([title, ""], times)


def with_results(readme, text):
    if BEGIN not in readme or END not in readme:
        raise Refused("README.md has no place for the results: put the two comments back")
    return readme[:readme.index(BEGIN) + len(BEGIN)] + text + readme[readme.index(END):]


def main():
    parser = Parser(__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing")
    parser.add_argument("--docs", metavar="DIR", type=pathlib.Path, default=DOCS, help="where measured/ and understand/measured.md are, beside README.md (docs)")
    arguments = parser.parse_args()
    written, readme = arguments.docs / "understand/measured.md", arguments.docs.resolve().parent / "README.md"
    try:
        found = read(arguments.docs / "measured")
        texts = {written: page(found)}
        if readme.exists():
            texts[readme] = with_results(readme.read_text(), results(found))
    except FileNotFoundError as missing:
        print(f"write_measured: not there: {missing}: run scripts/measure", file=sys.stderr)
        # A page without its files is worse than none.
        return DIFFERS if written.exists() else NO_FILES
    except Refused as reason:
        print(f"write_measured: {reason}", file=sys.stderr)
        return DIFFERS
    status = 0
    for file, text in texts.items():
        if not arguments.check:
            file.write_text(text)
        elif not file.exists() or file.read_text() != text:
            print(f"write_measured: {file} is not what its files say: run scripts/write_measured.py", file=sys.stderr)
            status = DIFFERS
    return status


if __name__ == "__main__":
    sys.exit(main())
