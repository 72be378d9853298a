# SPDX-License-Identifier: Apache-2.0
"""Compare scene flow with the true one, as KITTI 2015's development kit does: outliers of the disparity (D1), of the disparity in the next frame at this
frame's pixels (D2), of the optical flow to the next frame (Fl), and of any of them (SF). Where both sides label objects that move by themselves: which of
them were found, and how far their motions are off."""
import csv
import dataclasses
import pathlib
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

from . import _egosgm
from .arguments import comparison_parser, counted, json_text, resolve_comparison, tell, text_argument
from .evaluation.flow_evaluation import MEASURES, SceneFlowFigures, count_outliers, evaluation_of, match_objects
from .video_program import read_flow

_Path = pathlib.Path
_FOLDERS = (("disp_0", "interpolated", "disparity", "left_disp_occ", "disp_occ_0"), ("disp_1", "disp_occ_1"), ("flow", "flow_occ"))  # of D1, D2, Fl: the first that is there
_MOVING = ("objects", "obj_map")
_Motions = Dict[Tuple[str, int], np.ndarray]


def _frame_key(name: str) -> str:
    return name.lstrip("0") or "0"


def read_motions(folder: _Path) -> _Motions:
    """The 4x4 motions to the next camera's frame, by frame and object, of a folder's objects.csv, or of motions.txt: rows of a frame, an id and 12 numbers."""
    rows: List[List[str]] = []
    motions: _Motions = {}
    try:
        if (folder / "objects.csv").is_file():
            with open(folder / "objects.csv", newline="", encoding="utf-8") as table:
                rows = [[row["frame"], row["id"], *(row[f"m{i}{j}"] for i in range(3) for j in range(4))] for row in csv.DictReader(table)]
        elif (folder / "motions.txt").is_file():
            rows = [line.split() for line in (folder / "motions.txt").read_text(encoding="utf-8").splitlines() if line.strip()]
        for row in rows:
            motion = motions[_frame_key(row[0]), int(row[1])] = np.vstack([np.array(row[2:], float).reshape(3, 4), [0, 0, 0, 1]])
            if not np.isfinite(motion).all():
                raise ValueError(f"object {row[1]} of frame {row[0]} has no finite motion")
    except (ValueError, LookupError, csv.Error) as error:
        raise _egosgm.InvalidArgument(f"{folder}: objects.csv or motions.txt is damaged: {error}; give it as `egosgm run --write objects` writes it") from None
    return motions


def motion_errors(estimate: np.ndarray, truth: np.ndarray, centre_m: np.ndarray) -> Tuple[float, float]:
    """By how much a motion moves an object's centre elsewhere than the true one [m], and turns it otherwise [deg]."""
    shift = (truth - estimate)[:3] @ np.append(centre_m, 1)
    cosine = (np.trace(truth[:3, :3].T @ estimate[:3, :3]) - 1) / 2
    return float(np.linalg.norm(shift)), float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


class _Objects:
    """Objects and their motions over the frames."""

    def __init__(self, estimate: _Path, truth: _Path) -> None:
        self.found = self.lost = self.false = 0
        self._shifts: List[float] = []
        self._turns: List[float] = []
        self._estimate, self._truth = read_motions(estimate), read_motions(truth)
        self._calibration: Optional[_egosgm.Calibration] = None
        try:
            self._calibration = _egosgm.open_folder(truth.parent if truth.name == "truth" else truth).calibration
        except _egosgm.Error:
            pass  # then nothing is said of motions

    def add(self, name: str, estimate: np.ndarray, truth: np.ndarray, disparity: np.ndarray) -> None:
        found, lost, false = match_objects(estimate, truth)
        self.found, self.lost, self.false = self.found + len(found), self.lost + len(lost), self.false + len(false)
        for true_id, own in found.items():
            motions = self._estimate.get((_frame_key(name), own)), self._truth.get((_frame_key(name), true_id))
            if self._calibration is None or motions[0] is None or motions[1] is None:
                continue
            c, (rows, columns) = self._calibration, np.nonzero((truth == true_id) & np.isfinite(disparity))
            depth = c.fx * c.baseline_m / (disparity[rows, columns] + c.doffs_px)
            centre = np.array([((columns - c.cx) / c.fx * depth).mean(), ((rows - c.cy) / c.fy * depth).mean(), depth.mean()])
            shift, turn = motion_errors(motions[0], motions[1], centre)
            self._shifts.append(shift)
            self._turns.append(turn)

    def figures(self) -> Dict[str, Any]:
        figures: Dict[str, Any] = {"found": self.found, "lost": self.lost, "false": self.false}
        if self._shifts:
            figures.update(median_shift_error_m=float(np.median(self._shifts)), median_turn_error_deg=float(np.median(self._turns)))
        return figures


def _text_of_objects(figures: Dict[str, Any]) -> str:
    text = f"objects: {figures['found']} of {figures['found'] + figures['lost']} found, {figures['false']} false"
    if "median_shift_error_m" in figures:
        text += f"; median errors of their motions: {figures['median_shift_error_m']:.3f} m, {figures['median_turn_error_deg']:.2f} degrees"
    return text


def _place(folder: _Path, names: Sequence[str], needed: bool = True) -> _Path:
    found = next((folder / name for name in names if (folder / name).is_dir()), _Path())
    if needed and found == _Path():
        raise _egosgm.InvalidArgument(f"{folder}: has no folder {' or '.join(names)}: give the folder that holds it")
    return found


def _read(file: _Path) -> np.ndarray:
    disparity = _egosgm.read_disparity(file)
    return np.where(disparity == _egosgm.INVALID_DISPARITY, np.float32(np.nan), disparity)[..., None]


def _text_of(frames: int, regions: Dict[str, SceneFlowFigures], notes: List[str]) -> str:
    lines = [counted(frames, "frame"), f"{'outliers':<10}" + "".join(f"{name.upper() if name != 'fl' else 'Fl':>11}" for name in MEASURES) + "    density"]
    for region, figures in regions.items():
        cells = [getattr(figures, name).outliers_percent for name in MEASURES] + [figures.sf.density_percent]
        lines.append(f"{region:<10}" + "".join(f"{'-':>11}" if cell != cell else f"{cell:>9.2f} %" for cell in cells))
    return "\n".join(lines + notes)


def _pairs_of(estimate: _Path, truth: _Path, frames: Any) -> Tuple[List[Dict[str, Any]], List[Any]]:
    """The files of each kind of map by their names, and the truth files without an estimate."""
    pairs = []
    for names in _FOLDERS:
        place = _place(estimate, names)
        found, missing, _ = _egosgm._pair_with_truth(place, _place(truth, names), text_argument(frames))
        pairs.append({pair.name: pair for pair in found})
    return pairs, missing


def _maps_of(files: List[Any], true_objects: Optional[np.ndarray]) -> List[List[np.ndarray]]:
    """A frame's estimates and its truths, all of one size."""
    maps = [[reader(getattr(pair, side)) for pair, reader in zip(files, (_read, _read, read_flow))] for side in ("estimate", "truth")]
    sizes = {array.shape[:2] for array in (*maps[0], *maps[1], *([] if true_objects is None else [true_objects]))}
    if len(sizes) > 1:
        raise _egosgm.InvalidArgument(f"{files[-1].estimate}: maps of this frame differ in size: {', '.join(f'{w}x{h}' for h, w in sorted(sizes))}; give maps of one size")
    return maps


def _work(arguments: Sequence[str]) -> str:
    parser = comparison_parser("eval-flow", __doc__, "folder with disp_0 (or disparity), disp_1 and flow: KITTI's PNG, or PFM, .npy and .flo",
                               "folder with such ones, or KITTI 2015's disp_occ_0, disp_occ_1, flow_occ; with objects or obj_map, what moves counts apart; or "
                               "the folder of `synth --moving-object`")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.epilog = "docs/use/evaluation.md says which pixels count."
    given = parser.parse(arguments)
    resolve_comparison(given)
    estimate, truth = _Path(given.estimate), _Path(given.truth)
    truth = truth / "truth" if (truth / "truth").is_dir() else truth
    pairs, missing = _pairs_of(estimate, truth, given.frames)
    notes = [f"{counted(len(missing), 'truth file')} without an estimate, the first is {missing[0]}"] if missing else []
    counts, is_same = [], True
    labels, moving = (_place(folder, names, needed=False) for folder, names in ((estimate, ("objects",)), (truth, _MOVING)))
    objects = _Objects(estimate, truth) if labels != _Path() and moving != _Path() else None
    for name, flow in pairs[2].items():
        if any(name not in of_kind for of_kind in pairs):
            raise _egosgm.InvalidArgument(f"{flow.estimate}: its frame has no disparity, or none in the next frame: give one of each")
        true_objects = None if moving == _Path() else _egosgm.read_grey(moving / flow.truth.with_suffix(".png").name)
        maps = _maps_of([of_kind[name] for of_kind in pairs], true_objects)
        is_same = is_same and all(np.array_equal(estimated, true, equal_nan=True) for estimated, true in zip(*maps))
        counts.append(count_outliers(*maps, None if true_objects is None else true_objects != 0))
        if objects and true_objects is not None:
            own = _egosgm.read_grey(labels / flow.estimate.with_suffix(".png").name)
            if own.shape != true_objects.shape:
                raise _egosgm.InvalidArgument(f"{labels}: its map of {name} is of another size than the truth: give one of the same frames")
            objects.add(name, own, true_objects, maps[1][0][..., 0])
    if is_same:
        notes.append("estimates equal their truth in every pixel: is a file compared with itself, or with a copy of it?")
    evaluation = evaluation_of(counts)
    of_objects = {"objects": objects.figures()} if objects else {}
    if given.json:
        plain = dataclasses.asdict(evaluation)
        over_frames = [{"name": name, **figures} for name, figures in zip(pairs[2], plain["over_frames"])]
        return json_text({"frames": len(counts), "regions": plain["regions"], **of_objects, "over_frames": over_frames, **({"notes": notes} if notes else {})})
    return _text_of(len(counts), evaluation.regions, [*map(_text_of_objects, of_objects.values()), *notes])


def main(arguments: Sequence[str]) -> int:
    tell(_work(arguments))
    return 0
