#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures accuracy, search and drift through the program `egosgm`, and tells which figures keep their limits.

  python3 bench/accuracy                      the table of limits (exit code 1 where one is missed, 3 where rows were skipped)
  python3 bench/accuracy --ego-motion         the table of stereo odometry alone: drift, error, time, and what it is worth to the disparities
  python3 bench/accuracy --ablation           every correction on and off, on four kinds of input apart
  python3 bench/accuracy --evidence           places without evidence: what is filled there, what is wrong, what was gained over the single frame
  python3 bench/accuracy --video              over time: beside the single frame, OpenCV and its maps averaged in time; wrong motions, dropped frames
  python3 bench/accuracy --search SECONDS     better constants of the method by the figures of many inputs (docs/develop/search.md)
  python3 bench/accuracy --paper      the table of Fucek et al. (IFAC 2017) on all scenes at hand
  python3 bench/accuracy --paper --kitti2015 DIR --scenes 84,87,130,146,148 --frames 0:10
                                      and on scenes of KITTI 2015's multi-view data
"""
import argparse
import datetime
import json
import pathlib
import re
import subprocess
import sys

from ablation import ablation
from ego_motion import ego_motion_table
from evidence import evidence_tables
from inputs import PROJECT, Bench, Failed, Missing
from paper import paper_table
from rows import main_table
from search import Search
from video import video_tables


def commit():
    done = subprocess.run(["git", "describe", "--always", "--dirty", "--abbrev=10"], cwd=PROJECT, capture_output=True, text=True)
    return done.stdout.strip() or "unknown"


def write_json(path, content):
    unfinished = pathlib.Path(str(path) + ".part")
    unfinished.write_text(json.dumps(content, indent=1) + "\n")
    unfinished.replace(path)


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--egosgm", metavar="FILE", help="the program (else the newest build*/apps/egosgm)")
    parser.add_argument("--data", metavar="DIR", help="real sequences (else $EGOSGM_DATA, else ../shared/data beside the project)")
    parser.add_argument("--work", metavar="DIR", default=PROJECT / "out/accuracy", help="where runs are written (out/accuracy)")
    parser.add_argument("--json", metavar="FILE", help="write all figures")
    parser.add_argument("--only", metavar="REGEX", default="", help="only these groups of rows: 'synthetic', '2012 / 000151', 'poles', ...")
    parser.add_argument("--no-speed", action="store_true", help="do not run egosgm_compare or egosgm_odometry")
    parser.add_argument("--compare-json", metavar="FILE", help="take the speed from what egosgm_compare --json wrote")
    parser.add_argument("--no-maps", action="store_true", help="leave out what needs the maps pixel by pixel: flicker, poles, variances, 500 frames")
    parser.add_argument("--video", action="store_true", help="the figures over time (docs/use/evaluation.md), and nothing else")
    parser.add_argument("--evidence", action="store_true", help="places without evidence, and nothing else")
    parser.add_argument("--ego-motion", action="store_true", help="stereo odometry alone, and nothing else")
    parser.add_argument("--ablation", action="store_true", help="every correction on and off, on four kinds of input apart, and nothing else")
    parser.add_argument("--search", metavar="SECONDS", type=float, help="search for better constants for so long, and nothing else")
    parser.add_argument("--constants", metavar="REGEX", default="", help="only these constants of --search, by name: 'banded_sgm', 'EGOSGM_EVIDENCE', ...")
    parser.add_argument("--sequences", metavar="DIR", nargs="+", type=pathlib.Path, help="inputs of --search: recorded sequences with truth, in place of the bench's")
    parser.add_argument("--seed", type=int, default=1, help="the order in which --search tries constants (1)")
    parser.add_argument("--inputs", metavar="REGEX", default="", help="only these inputs of --ablation and --search, by title")
    parser.add_argument("--paper", action="store_true", help="the paper's table and nothing else")
    parser.add_argument("--kitti2015", metavar="DIR", help="more scenes for --paper: KITTI 2015 multi-view data")
    parser.add_argument("--scenes", metavar="LIST", default="84,87,130,146,148", help="of --kitti2015")
    parser.add_argument("--frames", metavar="FIRST:LAST", default="0:10", help="of --kitti2015")
    return parser.parse_args()


def reasons_of(rows):
    """Why rows have no figures."""
    return [str(row[1]) for row in rows if re.search("(skipped|failed): ", str(row[1]))]


def main():
    arguments = parse_arguments()
    bench = Bench(arguments)
    content = {"commit": commit(), "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds")}
    if arguments.paper:
        content["paper"], table = paper_table(bench, arguments)
        rows, skipped, code = content["paper"], [row["skipped"] for row in content["paper"] if "skipped" in row], table.exit_code()
    elif arguments.ablation:
        content["ablation"], skipped = ablation(bench, arguments.inputs)
        rows, code = content["ablation"], 0
    elif arguments.search:
        content["search"] = Search(bench, arguments).run(arguments.search, arguments.constants)
        rows, skipped, code = ["the start's figures"], [], 0
    elif arguments.evidence:
        content["evidence"] = evidence_tables(bench, re.compile(arguments.only))
        rows = [row for table in content["evidence"].values() for row in table["rows"]]
        skipped, code = reasons_of(rows), 0
    elif arguments.video:
        content["video"] = video_tables(bench, re.compile(arguments.only))
        rows = [row for table in content["video"].values() for row in table["rows"]]
        skipped, code = reasons_of(rows), 0
    else:
        table = ego_motion_table(bench, arguments) if arguments.ego_motion else main_table(bench, arguments)
        table.print()
        content["rows"] = table.rows
        rows, skipped, code = table.rows, [row["figure"] for row in table.skipped()], table.exit_code()
    if not rows and not skipped:
        sys.exit("accuracy: nothing was measured: --only and --inputs are patterns of titles, see --help")
    code = code or (1 if any("failed: " in reason for reason in skipped) else 3 if skipped else 0)
    content["device"] = bench.device.get("name", "")
    content["driver"] = bench.device.get("driver", "")
    print(f"\n{content['device']}, driver {content['driver']}, commit {content['commit']}, {content['date']}")
    if arguments.json:
        write_json(arguments.json, content)
    if skipped:
        print(f"accuracy: {len(skipped)} rows skipped, so not all was measured" + ("" if bench.data.is_dir() else f": no data at {bench.data}"),
              file=sys.stderr)
    return code


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (OSError, Missing, Failed) as error:  # a folder or file that cannot be written or read, or a module that every row needs
        sys.exit(f"accuracy: {error}")
