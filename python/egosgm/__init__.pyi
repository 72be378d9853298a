# SPDX-License-Identifier: Apache-2.0
# The build makes a property of each attribute of the module's classes, as nobody can set one.
import dataclasses
import os
from typing import Any, ClassVar, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import Unpack

from ._options import FrameMaps, PipelineOptions, StereoOdometryOptions, SyntheticOptions
from .calibration.reader import read_calibration as read_calibration, read_euroc_rig as read_euroc_rig, read_opencv_rig as read_opencv_rig
from .geometry.depth import depth_sigma_from_disparity as depth_sigma_from_disparity
from .drive import StereoVideo as StereoVideo, VideoFrame as VideoFrame, run as run
from .diagnostics.examination import match_pair as match_pair
from .matcher import Matcher as Matcher
from .geometry.points import PointCloud as PointCloud, point_cloud as point_cloud, write_ply as write_ply
from .evaluation.flow_evaluation import ObjectCounts as ObjectCounts, OutlierFigures as OutlierFigures, SceneFlowEvaluation as SceneFlowEvaluation, SceneFlowFigures as SceneFlowFigures, evaluate_scene_flow as evaluate_scene_flow
from .evaluation.pose_evaluation import MotionError as MotionError, PoseEvaluation as PoseEvaluation, SegmentError as SegmentError, evaluate_poses as evaluate_poses
from .calibration.rectification import Rectification as Rectification, StereoRig as StereoRig
from .evaluation.video_evaluation import DensityFigures as DensityFigures, RegionFigures as RegionFigures, VideoEvaluation as VideoEvaluation, VideoFigures as VideoFigures, evaluate_video as evaluate_video
from .evaluation.moved_maps import move_map as move_map

__version__: str
INVALID_DISPARITY: float
REASONS: tuple[str, ...]

_Path = Union[str, os.PathLike[str]]
_Map = NDArray[np.float32]
_Transform = NDArray[np.float64]

class Error(Exception): ...
class InvalidArgument(Error, ValueError): ...
class IoError(Error, OSError): ...
class DeviceError(Error, RuntimeError): ...
class BuildError(DeviceError): ...

class Calibration:
    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]
    def __init__(self, fx: float, fy: float, cx: float, cy: float, baseline_m: float, doffs_px: float = 0.0) -> None: ...
    fx: float
    fy: float
    cx: float
    cy: float
    baseline_m: float
    doffs_px: float

class Motion:
    def __init__(self, current_from_previous: ArrayLike, covariance: Optional[ArrayLike] = None) -> None: ...
    current_from_previous: _Transform
    covariance: _Transform

class DeviceInfo:
    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]
    name: str
    type: str
    vendor: str
    platform: str
    version: str
    driver: str
    compute_units: int
    memory_bytes: int
    max_allocation_bytes: int

class FrameReport:
    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]
    unpredicted: str
    repeated: bool
    searched_everything: bool
    search_fraction: float
    predicted_fraction: float
    density: float
    vertical_offset_px: float
    stripes: int
    launches: int
    total_ms: float
    stages: list[tuple[str, float]]

class Frame(FrameMaps):
    report: FrameReport

class Pipeline:
    def __init__(self, calibration: Calibration, width: int, height: int, *, device: Union[str, int] = "", preset: str = "default",
                 cache: str = "", **options: Unpack[PipelineOptions]) -> None: ...
    def process(self, left: NDArray[Any], right: NDArray[Any], motion: Union[Motion, ArrayLike, None] = None,
                outputs: Union[str, Sequence[str], dict[str, NDArray[Any]]] = ("disparity", "variance")) -> Frame: ...
    def submit(self, left: NDArray[Any], right: NDArray[Any], motion: Union[Motion, ArrayLike, None] = None,
               outputs: Union[str, Sequence[str], dict[str, NDArray[Any]]] = ("disparity", "variance")) -> None: ...
    def collect(self) -> Frame: ...
    under_way: int
    def reset(self) -> None: ...
    options: dict[str, Union[bool, int, float, str]]
    device: DeviceInfo
    device_memory_bytes: int

class OdometryResult:
    motion: Optional[Motion]
    features: int
    matches: int
    inliers: int
    reprojection_rms_px: float
    standstill: bool
    reason: str

class StereoOdometry:
    def __init__(self, calibration: Calibration, **options: Unpack[StereoOdometryOptions]) -> None: ...
    def process(self, left: NDArray[Any], right: NDArray[Any], prior: Union[Motion, ArrayLike, None] = None) -> OdometryResult: ...
    def reset(self) -> None: ...

class MovingObject:
    id: int
    age: int
    pixels: int
    box: list[int]
    centre_m: list[float]
    velocity_m: list[float]
    velocity_sigma_m: list[float]
    current_from_previous: _Transform

class LabelledObjects:
    moving: list[MovingObject]
    labels: NDArray[np.uint8]

class SceneFlow:
    disparity: _Map
    next_disparity: _Map
    flow: _Map
    labels: NDArray[np.uint8]
    moving: list[MovingObject]
    camera: Motion

class ObjectTracker:
    def __init__(self, calibration: Calibration) -> None: ...
    def process(self, left: NDArray[Any], disparity: ArrayLike, dynamic: NDArray[np.uint8], motion: Optional[Motion]) -> LabelledObjects: ...
    def scene_flow(self) -> Optional[SceneFlow]: ...

class SyntheticFrame:
    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    left_disparity: _Map
    right_disparity: _Map
    left_noc: NDArray[np.uint8]
    right_noc: NDArray[np.uint8]
    left_moving: NDArray[np.uint8]
    right_moving: NDArray[np.uint8]
    world_from_camera: _Transform

class SyntheticObject:
    id: int
    box: list[int]
    centre_m: list[float]
    velocity_m: list[float]
    next_from_current: _Transform

class SyntheticSceneFlow:
    flow: _Map
    next_disparity: _Map
    seen_next: NDArray[np.uint8]
    objects: NDArray[np.uint8]
    moving: list[SyntheticObject]

class SyntheticSequence:
    def __init__(self, **options: Unpack[SyntheticOptions]) -> None: ...
    def __len__(self) -> int: ...
    options: dict[str, Union[bool, int, float]]
    calibration: Calibration
    def motion(self, frame: int) -> Motion: ...
    def render(self, frame: int) -> SyntheticFrame: ...
    def scene_flow(self, frame: int) -> SyntheticSceneFlow: ...

class StereoFrame:
    number: int
    name: str
    left: os.PathLike[str]
    right: os.PathLike[str]
    truth_noc: os.PathLike[str]
    truth_occ: os.PathLike[str]
    def read(self) -> tuple[NDArray[Any], NDArray[Any]]: ...

class StereoSequence:
    title: str
    frames: list[StereoFrame]
    numbers: list[int]
    note: str
    calibration: Optional[Calibration]
    times_file: os.PathLike[str]
    poses_file: os.PathLike[str]
    size: tuple[int, int]
    def __len__(self) -> int: ...

class DisparityMetrics:
    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]
    bad_or_missing: float
    bad_of_valid: float
    density: float
    interpolated: float
    d1: float
    d1_interpolated: float
    mae_px: float
    bad_1px: float
    mean_error_px: float
    filled: float
    wrong_of_all: float

class DisparityCounts:
    __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]
    def __init__(self) -> None: ...
    truth: int
    valid: int
    bad: int
    d1: int
    bad_interpolated: int
    d1_interpolated: int
    absolute_error_px: float
    bad_1px: int
    signed_error_px: float
    sky: int
    sky_valid: int
    metrics: DisparityMetrics
    def __add__(self, other: DisparityCounts) -> DisparityCounts: ...

def devices() -> list[DeviceInfo]: ...
def pipeline_options(preset: str = "default", **options: Unpack[PipelineOptions]) -> dict[str, Union[bool, int, float, str]]: ...
def odometry_options() -> dict[str, Union[bool, int, float]]: ...
def synthetic_options() -> dict[str, Union[bool, int, float]]: ...
def open_folder(folder: _Path, frames: str = "") -> StereoSequence: ...
def open_kitti_multiview(folder: _Path, scene: str, frames: str = "") -> StereoSequence: ...
def open_patterns(left: _Path, right: _Path, calibration: _Path = ..., frames: str = "", by_order: bool = False) -> StereoSequence: ...
def write_calibration(file: _Path, calibration: Calibration) -> None: ...
def read_grey(file: _Path) -> NDArray[Any]: ...
def read_color(file: _Path) -> NDArray[np.uint8]: ...
def read_disparity(file: _Path) -> _Map: ...
def write_disparity(file: _Path, disparity: ArrayLike) -> int: ...
def write_pfm(file: _Path, map: ArrayLike) -> None: ...
def read_poses(file: _Path) -> _Transform: ...
def write_poses(file: _Path, world_from_camera: ArrayLike) -> None: ...
def compare_disparity(estimate: ArrayLike, truth: ArrayLike) -> DisparityCounts: ...
def mean_of(images: Sequence[DisparityMetrics]) -> DisparityMetrics: ...
def interpolate_background(disparity: ArrayLike) -> _Map: ...
def depth_from_disparity(disparity: ArrayLike, calibration: Calibration) -> _Map: ...
def color_disparity(disparity: ArrayLike, low: Optional[float] = None, high: Optional[float] = None) -> NDArray[np.uint8]: ...
def color_error(estimate: ArrayLike, truth: ArrayLike) -> NDArray[np.uint8]: ...
