# SPDX-License-Identifier: Apache-2.0
"""Compare scene flow with the true one, as KITTI 2015's development kit does: outliers of the disparity (D1), of the disparity in the next frame at this
frame's pixels (D2), of the optical flow to the next frame (Fl), and of any of them (SF)."""
import pathlib
from typing import Any, Dict, List, Sequence

import numpy as np

from . import _egosgm
from .arguments import comparison_parser, counted, json_text, resolve_comparison, tell, text_argument
from .run_folder import frames_of_run
from .evaluation.video_evaluation import BAD_PX, is_sky, percent
from .video_program import read_flow

_Path = pathlib.Path
MEASURES = ("d1", "d2", "fl", "sf")
BAD_SHARE = 0.05  # an outlier is off by more than BAD_PX, and by more than this share of the truth
_FOLDERS = (("disp_0", "disparity", "left_disp_occ", "disp_occ_0"), ("disp_1", "disp_occ_1"), ("flow", "flow_occ"))  # of D1, D2, Fl: the first that is there
_MOVING = ("objects", "obj_map")


def count_outliers(estimates: Sequence[np.ndarray], truths: Sequence[np.ndarray], moving: Any = None) -> Dict[str, np.ndarray]:
    """For each region a row for each measure: outliers, pixels with truth, pixels with truth and estimate. Of estimates and truths: the disparity, that in the
    next frame and the flow, H x W x 1 or 2, NaN where there is none. moving: what moves by itself; without it, there is the region `all` only."""
    wrong, known, given = [], [], []
    for estimate, truth in zip(estimates, truths):
        known.append(np.isfinite(truth).all(axis=2))
        given.append(np.isfinite(estimate).all(axis=2))
        error, size = np.linalg.norm(estimate - truth, axis=2), np.linalg.norm(truth, axis=2)
        nothing_there = is_sky(truth[..., 0]) if truth.shape[2] == 1 else False
        wrong.append(np.where(given[-1], (error > BAD_PX) & (error > BAD_SHARE * size), ~nothing_there))
    wrong, known, given = [*wrong, np.any(wrong, axis=0)], [*known, np.all(known, axis=0)], [*given, np.all(given, axis=0)]
    regions = {"all": True} if moving is None else {"all": True, "moving": moving, "static": ~moving}
    return {name: np.array([[np.count_nonzero(which & k & region) for which in (w, k, g)] for w, k, g in zip(wrong, known, given)]) for name, region in regions.items()}


def _place(folder: _Path, names: Sequence[str], needed: bool = True) -> _Path:
    found = next((folder / name for name in names if (folder / name).is_dir()), _Path())
    if needed and found == _Path():
        raise _egosgm.InvalidArgument(f"{folder}: has no folder {' or '.join(names)}: give the folder that holds it")
    return found


def _read(file: _Path) -> np.ndarray:
    disparity = _egosgm.read_disparity(file)
    return np.where(disparity == _egosgm.INVALID_DISPARITY, np.float32(np.nan), disparity)[..., None]


def _figures_of(counts: Dict[str, np.ndarray]) -> Dict[str, Any]:
    return {region: {measure: {"outliers_percent": percent(wrong, known), "density_percent": percent(given, known), "truth_pixels": int(known)}
                     for measure, (wrong, known, given) in zip(MEASURES, rows)} for region, rows in counts.items()}


def _text_of(frames: int, regions: Dict[str, Any], notes: List[str]) -> str:
    lines = [counted(frames, "frame"), f"{'outliers':<10}" + "".join(f"{name.upper() if name != 'fl' else 'Fl':>11}" for name in MEASURES) + "    density"]
    for region, figures in regions.items():
        cells = [figures[name]["outliers_percent"] for name in MEASURES] + [figures["sf"]["density_percent"]]
        lines.append(f"{region:<10}" + "".join(f"{'-':>11}" if cell != cell else f"{cell:>9.2f} %" for cell in cells))
    return "\n".join(lines + notes)


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
    pairs, notes, moving = [], [], _place(truth, _MOVING, needed=False)
    for names in _FOLDERS:
        place = _place(estimate, names)
        run = frames_of_run(place)
        found, missing, _ = _egosgm._pair_with_truth(place, _place(truth, names), text_argument(given.frames), run.images if run else {})
        pairs.append({pair.name: pair for pair in found})
    if missing:
        notes.append(f"{counted(len(missing), 'truth file')} without an estimate, the first is {missing[0]}")
    total: Dict[str, np.ndarray] = {}
    over_frames = []
    for name, flow in pairs[2].items():
        if any(name not in of_kind for of_kind in pairs):
            raise _egosgm.InvalidArgument(f"{flow.estimate}: its frame has no disparity, or none in the next frame: give one of each")
        files = [of_kind[name] for of_kind in pairs]
        maps = [[reader(getattr(pair, side)) for pair, reader in zip(files, (_read, _read, read_flow))] for side in ("estimate", "truth")]
        mask = None if moving == _Path() else _egosgm.read_grey(moving / flow.truth.with_suffix(".png").name) != 0
        sizes = {array.shape[:2] for array in (*maps[0], *maps[1], *([] if mask is None else [mask]))}
        if len(sizes) > 1:
            raise _egosgm.InvalidArgument(f"{flow.estimate}: maps of this frame differ in size: {', '.join(f'{w}x{h}' for h, w in sorted(sizes))}; give maps of one size")
        counts = count_outliers(*maps, mask)
        over_frames.append({"name": name, **_figures_of(counts)})
        total = {region: total.get(region, 0) + rows for region, rows in counts.items()}
    regions = _figures_of(total)
    if given.json:
        return json_text({"frames": len(over_frames), "regions": regions, "over_frames": over_frames, **({"notes": notes} if notes else {})})
    return _text_of(len(over_frames), regions, notes)


def main(arguments: Sequence[str]) -> int:
    tell(_work(arguments))
    return 0
