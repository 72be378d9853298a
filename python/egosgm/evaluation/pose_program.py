# SPDX-License-Identifier: Apache-2.0
"""Compare poses with the true ones, as KITTI's odometry kit does."""
import math
import pathlib
from typing import Any, List, Sequence, Tuple

import numpy as np

from .. import _egosgm
from . import plots
from ..arguments import comparison_parser, counted, json_text, resolve_comparison, tell, text_argument
from .pose_evaluation import PoseEvaluation, evaluate_poses


def _poses_file_of(name: str) -> Tuple[pathlib.Path, List[int]]:
    """A file of poses: itself, a run's, or a data set's true ones; and the numbers of the data set's frames."""
    path = pathlib.Path(name)
    if not path.is_dir():
        return path, []
    if (path / "report.json").is_file() and (path / "poses.txt").is_file():
        return path / "poses.txt", []
    sequence = _egosgm.open_folder(path)
    if sequence.poses_file == pathlib.Path():
        raise _egosgm.InvalidArgument(f"{path}: holds no poses.txt; give a file of poses")
    return pathlib.Path(sequence.poses_file), sequence.numbers


def read_pairs(estimate_name: str, truth_name: str, frames: str) -> Tuple[np.ndarray, np.ndarray]:
    """The estimate and the truth of the same frames. Throws InvalidArgument where they cannot be told."""
    estimate_file, _ = _poses_file_of(estimate_name)
    truth_file, whole = _poses_file_of(truth_name)
    estimate, truth = _egosgm.read_poses(estimate_file), _egosgm.read_poses(truth_file)
    first, last = _egosgm._parse_frame_range(text_argument(frames)) if frames else (None, None)
    is_chosen = lambda number: (first is None or number >= first) and (last is None or number <= last)
    # Which frames the estimate's rows are of: the run tells, or --frames where they are as many, or they are all.
    run = _egosgm._frames_of_run(estimate_file)
    is_of_run = estimate_file.name == "poses.txt" and estimate_file.with_name("report.json").is_file()
    if run and is_of_run and len(run) != len(estimate):
        raise _egosgm.InvalidArgument(f"{estimate_file} holds {counted(len(estimate), 'pose')}, and the report beside it lists {counted(len(run), 'frame')}: let "
                                      "the run end, or run it again with --resume")
    if run and len(run) == len(estimate):
        numbers, sequence = [frame.number for frame in run.frames], run.numbers
    else:
        every = whole or list(range(len(truth)))
        some, sequence = [number for number in every if is_chosen(number)], []
        if frames and len(some) == len(estimate):
            numbers = some
        elif len(estimate) == len(truth):
            numbers = every if len(every) == len(estimate) else list(range(len(estimate)))
        else:
            raise _egosgm.InvalidArgument(f"{estimate_file} holds {counted(len(estimate), 'pose')}, {truth_file} {len(truth)}: give --frames FIRST:LAST, "
                                          "the numbers of the estimate's frames")
    rows = _egosgm._rows_of_frames(numbers, whole or sequence, len(truth), truth_file,
                                   text_argument(f"poses (the estimate {estimate_file} holds {len(estimate)})"))
    kept = [i for i, number in enumerate(numbers) if is_chosen(number)]
    if len(kept) < 2:
        raise _egosgm.InvalidArgument(f"{estimate_file} and {truth_file}: {counted(len(kept), 'pose')} of the same frames"
                                      f"{' in --frames ' + frames if frames else ''}: a motion needs two")
    return estimate[kept], truth[[rows[i] for i in kept]]


def _json_of(e: PoseEvaluation) -> Any:
    return {"frames": len(e.motions) + 1, "path_length_m": e.path_length_m, "translation_mean_m": e.translation_mean_m,
            "rotation_mean_deg": math.degrees(e.rotation_mean_rad), "translation_rmse_m": e.translation_rmse_m,
            "rotation_rmse_deg": math.degrees(e.rotation_rmse_rad), "end_drift_m": e.end_drift_m, "end_drift_percent": e.end_drift_percent,
            "rotation_end_drift_deg": e.rotation_end_drift_deg, "short_segments": e.short_segments,
            "segment_translation_percent": e.segment_translation_percent, "segment_rotation_deg_per_m": e.segment_rotation_deg_per_m,
            "segments": [vars(segment) for segment in e.segments],
            "motions": [{"translation_m": m.translation_m, "rotation_deg": math.degrees(m.rotation_rad)} for m in e.motions]}


def _text_of(e: PoseEvaluation) -> str:
    drift = "-" if math.isnan(e.end_drift_percent) else f"{e.end_drift_percent:.3f}"
    lines = [f"{counted(len(e.motions) + 1, 'frame')}, {e.path_length_m:.1f} m",
             f"frame to frame   {e.translation_mean_m:.4f} m  {math.degrees(e.rotation_mean_rad):.4f} deg (mean), "
             f"{e.translation_rmse_m:.4f} m  {math.degrees(e.rotation_rmse_rad):.4f} deg (root mean square)",
             f"at the end       {e.end_drift_m:.3f} m = {drift} %  {e.rotation_end_drift_deg:.3f} deg"]
    if e.segments:
        lines.append(f"segments         {e.segment_translation_percent:.3f} %  {e.segment_rotation_deg_per_m:.5f} deg/m"
                     + (" (of 5 to 50 m: not comparable with KITTI's of 100 to 800 m)" if e.short_segments else ""))
    lines += [f"{s.length_m:8.0f} m {s.segments:6d}  {s.translation_percent:.3f} %  {s.rotation_deg_per_m:.5f} deg/m" for s in e.segments]
    return "\n".join(lines)


def _work(arguments: Sequence[str]) -> str:
    parser = comparison_parser("eval-poses", __doc__, "KITTI poses, or a folder of `run`",
                                "the true ones, of the same frames or of the whole sequence, or the sequence's folder")
    parser.add_argument("--plot", action="append", default=[], metavar="FILE", help="draw both paths from above, in metres: a new .png or .svg file; "
                        "may be repeated")
    parser.add_argument("--json", action="store_true", help="print JSON")
    given = parser.parse(arguments)
    resolve_comparison(given)
    for file in given.plot:
        plots.expect_plot("--plot", file)
    estimate, truth = read_pairs(given.estimate, given.truth, given.frames)
    evaluation = evaluate_poses(estimate, truth)
    for file in given.plot:
        plots.write_plot(file, plots.paths(estimate, truth))
    is_same = np.array_equal(estimate, truth)
    warnings = ["the estimate equals the truth in every pose: is a file compared with itself, or with a copy of it?"] * is_same
    if given.json:
        return json_text({**_json_of(evaluation), **({"warnings": warnings} if warnings else {})})
    return "\n".join([_text_of(evaluation), *warnings])


def main(arguments: Sequence[str]) -> int:
    tell(_work(arguments))
    return 0
