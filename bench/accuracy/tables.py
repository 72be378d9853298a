# SPDX-License-Identifier: Apache-2.0
"""Figures with their limits (limits.json)."""
import json
import math
import pathlib
import re

from inputs import Missing, told


def shown(value):
    return "" if value is None else f"{value:.{2 if abs(value) >= 1 else 4}f}"


LIMITS = json.loads((pathlib.Path(__file__).parent / "limits.json").read_text())
OF_ACCURACY = re.compile(r"bad_|bad after|interpolated|d1")


class Table:
    """A row: a figure of an input, the single frame's beside it, and the limit that it keeps."""

    def __init__(self, only=""):
        self.only = only  # a pattern of the inputs that are filled in
        self.rows = []

    def add(self, source, figure, value, unit="%", limit=None, single=None, **limits):
        """`limit`: a name in limits.json; `limits`: the same, for what hangs on other figures. at_most and at_least are kept or missed; missing `goal`
        is no failure; at_most_above_single and goal_above_single are added to `single`, the figure of the same matcher on that frame alone."""
        if OF_ACCURACY.match(figure) and "single frame" not in source + figure and single is None:
            raise ValueError(f"{source}: {figure}: a figure of accuracy has its single frame's beside it")
        limits = {**(LIMITS[limit] if limit else {}), **limits}
        for name in ("at_most", "goal"):
            if f"{name}_above_single" in limits:
                limits[name] = single + limits.pop(f"{name}_above_single")
        at_most, at_least, goal = (limits.get(name) for name in ("at_most", "at_least", "goal"))
        passed = None
        if at_most is not None or at_least is not None:
            passed = value is not None and math.isfinite(value) and (at_most is None or value <= at_most) and (at_least is None or value >= at_least)
        self.rows.append({"input": source, "figure": figure, "value": value, "single_frame": single, "unit": unit, "at_most": at_most,
                          "at_least": at_least, "goal": goal, "passed": passed})

    def fill(self, source, measure):
        """Adds what `measure` adds; one row with the reason where something is missing or fails."""
        if not re.search(self.only, source):
            return
        try:
            measure()
        except Missing as reason:
            self.rows.append({"input": source, "figure": told(reason), "skipped": True, "passed": None})
        except Exception as reason:
            self.rows.append({"input": source, "figure": told(reason), "passed": False})

    def print(self):
        print(f"{'input':<42} {'figure':<44} {'value':>10} {'single':>9} {'limit':>10} {'goal':>8}")
        for row in self.rows:
            verdict = {True: "ok", False: "MISSED", None: ""}[row["passed"]]
            if "value" not in row:
                print(f"{row['input']:<42} {row['figure']} {verdict}")
                continue
            limit = f"<= {row['at_most']:.4g}" if row["at_most"] is not None else f">= {row['at_least']:.4g}" if row["at_least"] is not None else ""
            goal = "" if row["goal"] is None else f"{row['goal']:.4g}"
            print(f"{row['input']:<42} {row['figure']:<44} {shown(row['value']) or '-':>8} {row['unit']:<1} {shown(row['single_frame']):>9} {limit:>10} "
                  f"{goal:>8}  {verdict}")

    def exit_code(self):
        """0 where every row was measured and keeps its limit, 1 where one does not, 3 where rows were skipped."""
        if any(row["passed"] is False for row in self.rows):
            return 1
        return 3 if self.skipped() else 0

    def skipped(self):
        return [row for row in self.rows if row.get("skipped")]
