# SPDX-License-Identifier: Apache-2.0
"""Prints the figures of several outputs of `egosgm run` side by side"""
import json
import pathlib
import statistics

from usage import Parser

STEADY_FROM = 3  # frames; the first ones search everything and warm the device up
HOST = ("total", "wall", "odometry", "read", "write")  # in "ms"; all else there ran on the device


def figures(folder):
    """The rows of one column: name -> text."""
    report = json.loads((folder / "report.json").read_text())
    frames = report["frames"]
    steady = frames[STEADY_FROM:] or frames

    def mean(key):
        return 100 * statistics.mean(frame[key] for frame in steady)

    device_ms = statistics.median(sum(ms for name, ms in frame["ms"].items() if name not in HOST) for frame in steady)
    wall_ms = statistics.median(frame["ms"]["wall"] for frame in steady)
    rows = {
        "searched": f"{mean('search_fraction'):.1f} %",
        "dense": f"{mean('density'):.1f} %",
    }
    accuracy = folder / "accuracy.json"
    if accuracy.exists():
        pooled = json.loads(accuracy.read_text())["pooled"]
        rows["bad or missing"] = f"{pooled['bad_or_missing']:.2f} %"
        rows["bad of valid"] = f"{pooled['bad_of_valid']:.2f} %"
        rows["bad, interpolated"] = f"{pooled['interpolated']:.2f} %"
        rows["mean error"] = f"{pooled['mae']:.3f} px"
    rows["on the device"] = f"{device_ms:.1f} ms a frame"
    rows["with files, odometry"] = f"{wall_ms:.1f} ms a frame"
    return report, rows


def main(folders):
    columns = [(folder.name.replace("_", " "), *figures(folder)) for folder in folders]
    report = columns[0][1]
    print(f"{len(report['frames'])} frames of {report['width']}x{report['height']}, D = {report['options']['disparities']}, "
          f"{report['device']['name']}")
    print(f"{'':<22}" + "".join(f"{name:>18}" for name, _, _ in columns))
    for row in columns[0][2]:
        print(f"{row:<22}" + "".join(f"{rows.get(row, '-'):>18}" for _, _, rows in columns))


if __name__ == "__main__":
    parser = Parser(__doc__)
    parser.add_argument("folders", metavar="FOLDER", nargs="+", type=pathlib.Path)
    main(parser.parse_args().folders)
