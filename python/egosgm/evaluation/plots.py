# SPDX-License-Identifier: Apache-2.0
"""Figures over frames, against density, and paths, drawn by matplotlib into .png and .svg files."""
import io
import math
import pathlib
from typing import Any, List, Sequence, Tuple

import numpy as np

from .. import _egosgm
from .pose_evaluation import evaluate_poses, inverse
from .video_evaluation import DensityFigures

_GRID = {"color": "#dedede", "linewidth": 0.8}


def expect_plot(option: str, name: str) -> None:
    """Throws InvalidArgument, naming the option, unless `name` can be drawn: the package is there, and the name is of a new .png or .svg file."""
    file = pathlib.Path(name)
    if file.suffix not in (".png", ".svg"):
        raise _egosgm.InvalidArgument(f"{option} {name}: the name must end in .png or .svg")
    _egosgm._expect_new_file(option, file)
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError:
        raise _egosgm.InvalidArgument(f"{option} needs matplotlib: pip install matplotlib, or apt install python3-matplotlib") from None


def write_plot(name: str, figure: Any) -> None:
    """REQUIRES: expect_plot. A file that has come there meanwhile stays."""
    import matplotlib
    drawn = io.BytesIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "egosgm"}):
        figure.savefig(drawn, format=pathlib.Path(name).suffix[1:], dpi=100, metadata={"Date": None} if name.endswith(".svg") else None)
    _egosgm._write_new_file(name, drawn.getvalue())


def _chart(x_name: str, y_name: str, curves: Sequence[Tuple[str, Sequence[float], Sequence[float]]]) -> Any:
    from matplotlib.figure import Figure
    figure = Figure(figsize=(7.2, 4.2), layout="constrained")
    axes = figure.add_subplot(xlabel=x_name, ylabel=y_name)
    for name, x, y in curves:
        y = np.asarray(y, float)
        axes.plot(x, y, label=name, marker="." if len(y) < 40 else None)  # a lone frame between gaps is no line
    axes.set_ylim(bottom=0)
    axes.grid(**_GRID)
    axes.legend()
    return figure


def over_frames(curves: Sequence[Tuple[str, List[float]]]) -> Any:
    """A matplotlib Figure of curves [px] by name, those without a value left out. Throws InvalidArgument where none is left."""
    known = [(name, range(len(values)), values) for name, values in curves if not all(map(math.isnan, values))]
    if not known:
        raise _egosgm.InvalidArgument("nothing to plot over frames: give a truth or a sequence")
    if len(known[0][1]) < 2:
        raise _egosgm.InvalidArgument("a plot over frames needs at least two of them")
    return _chart("frame, counted from the first one", "px", known)


def against_density(density: Any) -> Any:
    """Bad pixels of those kept, against the share that is kept: in the order of the uncertainty, and the oracle's."""
    if not isinstance(density, DensityFigures) or math.isnan(density.kept_bad_percent[-1]):
        raise _egosgm.InvalidArgument("no density to plot: give a truth and a variance or confidence")
    return _chart("kept of the pixels with truth and estimate [%]", "bad of these [%]",
                  [("by uncertainty", density.kept_percent, density.kept_bad_percent), ("oracle", density.kept_percent, density.oracle_bad_percent)])


def paths(estimate: np.ndarray, truth: np.ndarray) -> Any:
    """Two paths from above, the first poses laid on each other: x (to the right) and z (ahead) of the first camera in metres, at one scale."""
    from matplotlib.figure import Figure
    evaluation = evaluate_poses(estimate, truth)
    figure = Figure(figsize=(6.5, 7.0), layout="constrained")
    axes = figure.add_subplot(xlabel="x [m]", ylabel="z [m]")
    for name, poses, style in (("truth", truth, {"linewidth": 3.5}), ("estimate", estimate, {"linewidth": 1.2, "color": "#d62728"})):
        places = (inverse(poses[0]) @ poses)[:, :3, 3]
        axes.plot(places[:, 0], places[:, 2], label=name, **style)
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(**_GRID)
    axes.legend()
    drift = evaluation.end_drift_percent
    axes.set_title(f"end drift {evaluation.end_drift_m:.3f} m" if math.isnan(drift) else f"end drift {drift:.2f} % of {evaluation.path_length_m:.1f} m")
    return figure
