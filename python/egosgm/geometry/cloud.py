# SPDX-License-Identifier: Apache-2.0
"""egosgm cloud: the points of all frames of a run, by its poses, in one cloud."""
import os
import pathlib
from typing import Any, List, Sequence, Tuple

import numpy as np
from numpy.typing import NDArray

from .. import _egosgm
from ..arguments import counted, decimal, left_of_run, Parser, read_json, tell
from ..evaluation.maps import size_text
from .points import cloud_of_maps, write_new_ply


def _parser() -> Parser:
    parser = Parser("cloud", description="Fuse the points of all frames of a run, by its poses, into one cloud with colours",
                    epilog="The run has to have variances and poses: egosgm run DRIVE --out OUT --write variance\n"
                    "The cloud lies in the frame of the run's first left camera: x right, y down, z forward, metres.")
    add = parser.add_argument
    add("run", metavar="OUT", help="the folder that `egosgm run` wrote")
    add("--out", metavar="FILE.ply", help="the cloud: a new file; without: OUT/cloud.ply")
    add("--voxel", metavar="M", type=decimal, default=0.05, help="points within a cube of this side become their mean [m, %(default)s]")
    add("--cloud-sigma", metavar="PERCENT", type=decimal, default=10, help="largest standard deviation of a depth [%% of the depth, %(default)s]")
    add("--max-depth", metavar="M", type=decimal, default=20, help="points farther from their camera are left out [m, %(default)s]")
    add("--least-frames", metavar="N", type=int, default=1, help="cubes that fewer frames saw are left out [%(default)s]")
    add("--normals", action="store_true", help="a normal for each point too, towards the cameras that saw it")
    return parser


def _map_of(folder: pathlib.Path, name: str, kind: str) -> NDArray[np.float32]:
    for extension in (".pfm", ".png"):
        if (folder / kind / (name + extension)).exists():
            return _egosgm.read_disparity(folder / kind / (name + extension))
    raise _egosgm.InvalidArgument(f"{folder / kind}: has no map of frame {name}: egosgm run --write {kind} writes it, into a new folder"
                                  if kind != "disparity" else f"{folder / kind}: has no map of frame {name}: give the folder that `egosgm run` wrote")


def _frames_of(folder: pathlib.Path) -> Tuple[_egosgm.Calibration, List[Tuple[str, str]], NDArray[np.float64], int]:
    """The calibration, names and left images, the poses, and how many of them are the one before, as odometry found no motion."""
    file = folder / "report.json"
    if not file.exists():
        raise _egosgm.InvalidArgument(f"{file}: no such file: give the folder that `egosgm run --out` wrote")
    poses = folder / "poses.txt"
    if not poses.exists():
        raise _egosgm.InvalidArgument(f"{poses}: no such file: a run with a calibration (--calib) writes it when it ends")
    report = read_json(file)
    try:
        calibration = _egosgm.Calibration(**report["calibration"])
        names = [str(entry.get("name") or f"{entry['frame']:06d}") for entry in report["frames"]]
        frames = [(name, left_of_run(folder, name, os.fsdecode(entry["left"]))) for name, entry in zip(names, report["frames"])]
        lost = sum(entry["odometry"]["motion"] is None for entry in report["frames"][1:] if "odometry" in entry)
    except (AttributeError, KeyError, TypeError, ValueError):
        raise _egosgm.InvalidArgument(f"{file}: is no report of a run, or was changed since: run it again, into a new folder") from None
    world_from_camera = _egosgm.read_poses(poses)
    if len(world_from_camera) != len(frames) or not frames:
        raise _egosgm.InvalidArgument(f"{poses}: has {len(world_from_camera)} poses and {file.name} {len(frames)} frames: let the run end, "
                                      "or run it again with --resume")
    return calibration, frames, world_from_camera, lost


class VoxelGrid:
    """Means of what lies in one cube, of as many frames as there are."""

    def __init__(self, side_m: float) -> None:
        self._side_m = side_m
        self._keys = np.empty((0, 3), np.int32)
        self._sums = np.empty((0, 11))  # points, colours, normals, count, frames
        self._waiting: List[Tuple[NDArray[np.int32], NDArray[np.float64]]] = []  # of frames that are not yet among them

    def add(self, points: NDArray[Any], colors: NDArray[Any], normals: NDArray[Any]) -> None:
        with np.errstate(over="ignore"):
            ones, cubes = np.ones((len(points), 1)), np.floor(points / self._side_m)
        if not (np.abs(cubes) < 2**31).all():
            raise _egosgm.InvalidArgument(f"--voxel {self._side_m:g}: is too small for points that lie {np.abs(points).max():.4g} m away: choose larger cubes")
        keys, sums = self._of(cubes.astype(np.int32), np.hstack([points, colors, normals, ones, ones]))
        sums[:, 10] = 1
        self._waiting.append((keys, sums))
        if 4 * sum(len(keys) for keys, _ in self._waiting) > len(self._keys):  # else each frame would take as long as all that there is
            self._merge()

    def _merge(self) -> None:
        keys, sums = zip((self._keys, self._sums), *self._waiting)
        self._waiting = []
        self._keys, self._sums = self._of(np.vstack(keys), np.vstack(sums))

    @staticmethod
    def _of(keys: NDArray[np.int32], rows: NDArray[np.float64]) -> Tuple[NDArray[np.int32], NDArray[np.float64]]:
        """Each key once, and the sum of its rows."""
        order = np.lexsort(keys.T)
        keys, rows = keys[order], rows[order]
        if not len(keys):
            return keys, rows
        begins = np.flatnonzero(np.r_[True, (keys[1:] != keys[:-1]).any(axis=1)])
        return keys[begins], np.add.reduceat(rows, begins)

    def means(self, least_frames: int) -> Tuple[NDArray[np.float32], NDArray[np.uint8], NDArray[np.float32]]:
        """Points, colours and unit normals."""
        self._merge()
        sums = self._sums[self._sums[:, 10] >= least_frames]
        count = sums[:, 9:10]
        length = np.linalg.norm(sums[:, 6:9], axis=1, keepdims=True)
        return ((sums[:, :3] / count).astype(np.float32), np.rint(sums[:, 3:6] / count).astype(np.uint8),
                (sums[:, 6:9] / np.where(length > 0, length, 1)).astype(np.float32))


def normals_of(disparity: NDArray[np.float32], calibration: _egosgm.Calibration, points: NDArray[np.float32]) -> NDArray[np.float64]:
    """Of the disparity's slope at each point's pixel: a plane of space is one of disparities, d = a x + b y + c. They look at the camera."""
    c = calibration
    x, y = (np.rint(f * points[:, i] / points[:, 2] + m).astype(int) for i, f, m in ((0, c.fx, c.cx), (1, c.fy, c.cy)))
    d = np.where(disparity > _egosgm.INVALID_DISPARITY, disparity, np.nan) + c.doffs_px
    down, across = (np.gradient(d, axis=axis) if d.shape[axis] > 1 else np.zeros_like(d) for axis in (0, 1))
    a, b, here = across[y, x], down[y, x], d[y, x]
    # d = f b / Z, so that a fx X + b fy Y + (d - a (x - cx) - b (y - cy)) Z = fx baseline.
    normal = -np.stack([a * c.fx, b * c.fy, here - a * (x - c.cx) - b * (y - c.cy)], axis=1)
    normal[~np.isfinite(normal).all(axis=1)] = 0
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return normal / np.where(length > 0, length, 1)


def main(arguments: Sequence[str]) -> int:
    given = _parser().parse(arguments)
    for name in ("voxel", "cloud_sigma", "max_depth", "least_frames"):
        if not getattr(given, name) > 0:
            raise _egosgm.InvalidArgument(f"--{name.replace('_', '-')} {getattr(given, name)}: choose a number above 0")
    if given.out and pathlib.Path(given.out).suffix.lower() not in ("", ".ply"):
        raise _egosgm.InvalidArgument(f"--out {given.out}: a cloud is a PLY file: give a name that ends in .ply")
    folder = pathlib.Path(given.run)
    calibration, frames, poses, lost = _frames_of(folder)
    file = pathlib.Path(given.out) if given.out else folder / "cloud.ply"
    _egosgm._expect_new_file("--out", file)
    grid, taken, pixels = VoxelGrid(given.voxel), 0, 0
    for (name, left), pose in zip(frames, poses):
        disparity, variance = (_map_of(folder, name, kind) for kind in ("disparity", "variance"))
        if not pathlib.Path(left).exists():
            raise _egosgm.InvalidArgument(f"{left}: no such file: the colours come from the left images of the run")
        image = _egosgm._read_stored_image(pathlib.Path(left))
        sizes = [size_text(each) for each in (disparity, variance, image)]
        if len(set(sizes)) > 1:
            raise _egosgm.InvalidArgument(f"{folder}: of frame {name} the disparity is {sizes[0]}, the variance {sizes[1]} and {left} {sizes[2]}: "
                                          "one of them was changed after the run")
        points, colors, left_out = cloud_of_maps(disparity, variance, image, calibration, given.cloud_sigma / 100, None, None,
                                                 given.max_depth, 1)
        normals = normals_of(disparity, calibration, points) if given.normals else np.zeros_like(points)
        grid.add(points @ pose[:3, :3].T + pose[:3, 3], colors, normals @ pose[:3, :3].T)
        taken, pixels = taken + len(points), pixels + len(points) + sum(left_out.values())
    points, colors, normals = grid.means(given.least_frames)
    if not len(points):
        raise _egosgm.InvalidArgument(f"{folder}: no point is left: raise --cloud-sigma or --max-depth, or lower --least-frames")
    write_new_ply(file, points, colors, normals if given.normals else None)
    tell(f"{file}: {len(points)} points, of {100 * taken / pixels:.1f} % of the pixels with a disparity in {len(frames)} frames")
    if lost:
        tell(f"odometry found no motion in {counted(lost, 'frame')}, whose pose is that of the frame before: what was seen before and after does not meet")
    return 0
