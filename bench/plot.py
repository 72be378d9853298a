#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Draws plots (PNG and SVG) and writes the README's tables (tables.md) from the JSON of the programs in bench/.

  bench/plot.py --out DIR compare.json stages.json scaling.json accuracy.json ...
What a file holds is told by its rows. Plots need matplotlib (Debian, Ubuntu: apt install python3-matplotlib); tables need nothing.
"""
import argparse
import json
import pathlib
import sys
import textwrap

TYPICAL = (1242, 375, 128)  # width, height, disparities of the tables that show one size
OURS, THEIRS, ACCENT = "#1b6ca8", "#9aa5b1", "#d1495b"
CONTENDERS = {
    "opencv_hh": "OpenCV StereoSGBM MODE_HH, 8 paths, left view",
    "opencv_hh4": "OpenCV MODE_HH4, 4 paths, left view",
    "opencv_sgbm": "OpenCV MODE_SGBM, 5 paths, left view",
    "opencv_3way": "OpenCV MODE_SGBM_3WAY, 3 paths, left view",
    "egosgm_full_left": "EgoSGM, full range, 8 paths, left view",
    "egosgm_full_both": "EgoSGM, full range, both views, checked",
    "egosgm_banded_frame": "EgoSGM, steady frame, motion given",
    "egosgm_banded_left": "EgoSGM, the same with the left view tracked alone",
    "egosgm_video_frame": "EgoSGM, steady frame with odometry",
}
SCALING_LABELS = {"full_both": "full range", "banded_frame": "steady frame"}


def caption(content):
    parts = [content.get("device"), content.get("driver") and f"driver {content['driver']}",
             content.get("threads") and f"{content['threads']} threads", content.get("input"),
             content.get("copy_gb_s") and f"device copy {content['copy_gb_s']:.1f} GB/s", content.get("commit") and f"commit {content['commit']}",
             str(content.get("date", ""))[:10]]
    return ", ".join(part for part in parts if part)


def markdown(header, rows):
    lines = ["| " + " | ".join(header) + " |", "| " + " | ".join("---" if i == 0 else "---:" for i in range(len(header))) + " |"]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def number(value, digits=2):
    return "" if value is None else f"{value:.{digits}f}"


def shape(row):
    return row["width"], row["height"], row["disparities"]


def shapes_of(rows):
    return sorted({shape(row) for row in rows}, key=lambda s: (s[0] * s[1], s[2]))


def compare_table(content):
    ms = {(row["name"], shape(row)): row["median_ms"] for row in content["rows"]}
    shapes = shapes_of(content["rows"])
    header = ["ms (of MODE_HH's time)"] + [f"{w}×{h}, D {d}" for w, h, d in shapes]
    rows = []
    for name, label in CONTENDERS.items():
        if not any((name, s) in ms for s in shapes):
            continue
        cells = []
        for s in shapes:
            ours, reference = ms.get((name, s)), ms.get(("opencv_hh", s))
            cells.append("" if ours is None else f"{ours:.1f}" + (f" ({ours / reference:.2f})" if reference else ""))
        rows.append([label, *cells])
    return "### Speed\n\n" + markdown(header, rows)


def stage_rows(content):
    """Without the steps; of the typical size, or of all."""
    rows = [row for row in content["rows"] if "of_copy" in row]
    return [row for row in rows if shape(row) == TYPICAL] or rows


def stages_table(content):
    rows = stage_rows(content)
    width, height, disparities = shape(rows[0])
    rows = [row for row in rows if shape(row) == (width, height, disparities)]
    cells = [[row["name"], number(row["median_ms"]), number(row["device_ms"]), number(row["GB_s"], 1), f"{100 * row['of_copy']:.0f} %",
              number(row.get("Gcells_s"))] for row in rows]
    return (f"### Stages, {width}×{height}, D {disparities}, a steady frame\n\n"
            + markdown(["stage", "ms", "ms on the device", "GB/s", "of a copy", "Gcells/s"], cells))


def scaling_table(content):
    cells = [[row["name"].split("_", 1)[0], SCALING_LABELS[row["name"].split("_", 1)[1]], f"{row['width']}×{row['height']}",
              str(row["disparities"]), number(row["compute_units"], 0), f"{100 * row['search_fraction']:.1f} %", number(row["median_ms"], 1),
              number(row["device_memory_bytes"] / 1e6, 0)] for row in content["rows"]]
    return "### Scaling\n\n" + markdown(["sweep", "frame", "size", "D", "units", "search", "ms", "device MB"], cells)


def limit_of(row):
    if row.get("at_most") is not None:
        return f"≤ {row['at_most']:g}"
    return f"≥ {row['at_least']:g}" if row.get("at_least") is not None else ""


def accuracy_table(content):
    cells = [[row["input"], row["figure"], number(row.get("value")) + (f" {row['unit']}" if row.get("unit") else ""), limit_of(row),
              {True: "yes", False: "**no**"}.get(row["passed"], "")] for row in content["rows"]]
    return "### Accuracy\n\n" + markdown(["input", "figure", "value", "limit", "kept"], cells)


def ablation_table(content):
    """A configuration's figures and, where the interval does not hold 0, in bold what they are above the default's."""
    kinds = list(content["ablation"][0]["kinds"])

    def cell(at):
        above = f"{at['above']:+.2f}"
        return f"{at['value']:.2f} ({f'**{above}**' if at['low'] * at['high'] > 0 else above})"
    header = ["configuration"] + [f"{kind}: bad or missing, bad of valid, interpolated [%]" for kind in kinds] + ["why"]

    def cells(kind):
        return kind.get("skipped") or ", ".join(map(cell, kind.values()))
    rows = [[row["name"], *(cells(row["kinds"][kind]) for kind in kinds), row["why"]] for row in content["ablation"]]
    return "### Ablation\n\n" + markdown(header, rows)


def paper_table(content):
    columns = ("single_frame", "method", "method_interpolated", "search", "time")
    cells = [[row["scene"], row["preset"], *([row["skipped"], "", "", "", ""] if "skipped" in row else [number(row[name]) for name in columns])]
             for row in content["paper"]]
    return "### The paper's table\n\n" + markdown(["scene", "preset", "single frame [%]", "method [%]", "interpolated [%]", "search [%]",
                                                   "time / single frame's"], cells)


def tidy(axes):
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_axisbelow(True)
    axes.grid(True, alpha=0.25)
    for axis in (axes.xaxis, axes.yaxis):
        if axis.get_scale() == "log":
            label_each_decade(axis)


def label_each_decade(axis):
    """Plain numbers, also where the data lie within one decade or two, which powers of ten leave without a scale."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def label(axes, x, y):
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.legend(fontsize=8)
    tidy(axes)


def draw_compare(plt, content):
    shapes = [s for s in shapes_of(content["rows"]) if s[2] == TYPICAL[2]] or shapes_of(content["rows"])
    figure, panels = plt.subplots(1, len(shapes), figsize=(4.2 * len(shapes) + 3, 3.6), squeeze=False, sharey=True)
    for axes, s in zip(panels[0], shapes):
        rows = {row["name"]: row["median_ms"] for row in content["rows"] if shape(row) == s}
        names = [name for name in reversed(CONTENDERS) if name in rows]
        bars = axes.barh([CONTENDERS[name] for name in names], [rows[name] for name in names], color=[OURS if name.startswith("egosgm") else THEIRS for name in names])
        axes.bar_label(bars, fmt="%.0f", padding=2, fontsize=8)
        axes.set_title(f"{s[0]}×{s[1]}, D = {s[2]}", fontsize=10)
        axes.set_xlabel("ms a frame (median)")
        tidy(axes)
    return figure


def draw_stages(plt, content):
    rows = stage_rows(content)
    rows = [row for row in reversed(rows) if shape(row) == shape(rows[0])]
    figure, (time, share) = plt.subplots(1, 2, figsize=(9, 4), sharey=True)
    names = [row["name"] for row in rows]
    time.bar_label(time.barh(names, [row["median_ms"] for row in rows], color=OURS), fmt="%.2f", padding=2, fontsize=8)
    time.set_xscale("log")
    time.set_xlabel("ms of a steady frame")
    share.barh(names, [100 * row["of_copy"] for row in rows], color=THEIRS)
    share.set_xlabel("% of this device's copy bandwidth")
    for axes in (time, share):
        tidy(axes)
    return figure


def draw_scaling(plt, content):
    figure, panels = plt.subplots(2, 3, figsize=(12, 6.5))
    sweeps = {}
    for row in content["rows"]:
        sweeps.setdefault(row["name"].split("_", 1)[0], {}).setdefault(row["name"].split("_", 1)[1], []).append(row)

    def line(axes, sweep, x, y, x_label, y_label, log=True):
        axes.set_visible(sweep in sweeps)
        for kind, rows in sweeps.get(sweep, {}).items():
            points = sorted((x(row), y(row)) for row in rows)
            axes.plot(*zip(*points), "o-", ms=4, label=SCALING_LABELS[kind], color=OURS if kind == "banded_frame" else THEIRS)
        if log:
            axes.set_xscale("log")
            axes.set_yscale("log")
        axes.set_xlabel(x_label)
        axes.set_ylabel(y_label)
        tidy(axes)
        if sweep in sweeps:
            axes.legend(fontsize=8)

    megapixels = lambda row: 1e-6 * row["width"] * row["height"]
    ms = lambda row: row["median_ms"]
    megabytes = lambda row: 1e-6 * row["device_memory_bytes"]
    disparities = lambda row: row["disparities"]
    line(panels[0][0], "pixels", megapixels, ms, "megapixels", "ms")
    line(panels[0][1], "disparities", disparities, ms, "disparities", "ms")
    line(panels[0][2], "band", lambda row: 100 * row["search_fraction"], ms, "search [%]", "ms", log=False)
    line(panels[1][0], "pixels", megapixels, megabytes, "megapixels", "device memory [MB]")
    line(panels[1][1], "disparities", disparities, megabytes, "disparities", "device memory [MB]")
    line(panels[1][2], "units", lambda row: row["compute_units"], ms, "compute units", "ms", log=False)
    panels[1][2].xaxis.get_major_locator().set_params(integer=True)
    return figure


def draw_uncertainty(plt, content):
    curves = content["curves"]["uncertainty"]
    figure, axes = plt.subplots(figsize=(5.2, 4.4))
    for curve, color in zip(curves, (OURS, ACCENT, THEIRS, "#e0a458")):
        axes.plot([at["predicted_px"] for at in curve["bins"]], [at["actual_px"] for at in curve["bins"]], "o-", ms=4, color=color, label=curve["input"])
    ends = [at[name] for curve in curves for at in curve["bins"] for name in ("predicted_px", "actual_px")]
    axes.plot([min(ends), max(ends)], [min(ends), max(ends)], color="#cccccc", zorder=0, label="as predicted")
    axes.set_xscale("log")
    axes.set_yscale("log")
    label(axes, "predicted deviation, of a tenth of the pixels each [px]", "actual deviation, errors cut at 3 px [px]")
    return figure


def contents_of(content):
    """Tables (functions) and drawings (name -> function) for what is in a file."""
    names = {row.get("name", "") for row in content.get("rows", [])}
    if names & CONTENDERS.keys():
        return [compare_table], {"compare": draw_compare}
    if "Census" in names or "BandedSgm_full" in names:
        return [stages_table], {"stages": draw_stages}
    if any(name.split("_", 1)[-1] in SCALING_LABELS for name in names):
        return [scaling_table], {"scaling": draw_scaling}
    tables, drawings = [], {}
    if any("figure" in row for row in content.get("rows", [])):
        tables.append(accuracy_table)
    if content.get("ablation"):
        tables.append(ablation_table)
    if content.get("paper"):
        tables.append(paper_table)
    if content.get("curves", {}).get("uncertainty"):
        drawings["uncertainty"] = draw_uncertainty
    return tables, drawings


def import_pyplot():
    try:
        import matplotlib
    except ImportError:
        return None
    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "egosgm"  # equal figures give equal files
    import matplotlib.pyplot
    return matplotlib.pyplot


def read(path):
    try:
        return json.loads(pathlib.Path(path).read_text())
    except (OSError, ValueError) as error:
        sys.exit(f"plot.py: {path}: {error}: give a JSON file of bench/")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", metavar="FILE", help="what --json of egosgm_compare, _stages, _scaling or accuracy wrote")
    parser.add_argument("--out", default="out/bench", metavar="DIR", help="folder of plots and tables.md (out/bench)")
    arguments = parser.parse_args()
    out = pathlib.Path(arguments.out)
    out.mkdir(parents=True, exist_ok=True)
    plt = import_pyplot()
    text = []
    for path in arguments.files:
        content = read(path)
        tables, drawings = contents_of(content)
        if not tables and not drawings:
            sys.exit(f"plot.py: {path}: no rows of bench/ in it")
        text += [table(content) + f"\n{caption(content)}\n" for table in tables]
        for name, draw in drawings.items() if plt else ():
            figure = draw(plt, content)
            lines = textwrap.wrap(caption(content), width=int(20 * figure.get_figwidth()))
            figure.text(0.01, 0.005, "\n".join(lines), fontsize=6, color="#666666")
            figure.tight_layout(rect=(0, 0.14 * len(lines) / figure.get_figheight(), 1, 1))
            figure.savefig(out / f"{name}.png", dpi=150)
            figure.savefig(out / f"{name}.svg", metadata={"Date": None})
            plt.close(figure)
    (out / "tables.md").write_text("\n".join(text))
    print(out / "tables.md")
    if not plt:
        sys.exit("plot.py: tables only: no matplotlib for this python3: apt install python3-matplotlib, then /usr/bin/python3 bench/plot.py, draws the plots too")


if __name__ == "__main__":
    main()
