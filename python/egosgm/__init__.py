# SPDX-License-Identifier: Apache-2.0
"""Dense disparity from stereo video on OpenCL devices.

    import egosgm
    for frame in egosgm.run("street"):
        frame.disparity    # float32 [px], egosgm.INVALID_DISPARITY where there is none
        frame.depth        # float32 [m], NaN where there is none
        frame.depth_sigma  # its standard deviation [m]

The same, step by step:

    sequence = egosgm.open_folder("street")
    width, height = sequence.size
    pipeline = egosgm.Pipeline(sequence.calibration, width, height, disparities=128)
    odometry = egosgm.StereoOdometry(sequence.calibration)
    for frame in sequence.frames:
        left, right = frame.read()
        result = pipeline.process(left, right, odometry.process(left, right).motion)
        result.disparity
"""
import inspect as _inspect

from . import cpu_driver as _cpu_driver

_cpu_driver.show()  # before the library is loaded, which asks the loader

from . import _egosgm
from ._egosgm import *  # noqa: F401,F403
from ._egosgm import __version__
from .calibration.reader import read_calibration, read_euroc_rig, read_opencv_rig
from .geometry.depth import depth_sigma_from_disparity
from .drive import StereoVideo, VideoFrame, run
from .diagnostics.examination import match_pair
from .matcher import Matcher
from .geometry.points import PointCloud, point_cloud, write_ply
from .evaluation.flow_evaluation import ObjectCounts, OutlierFigures, SceneFlowEvaluation, SceneFlowFigures, evaluate_scene_flow
from .evaluation.pose_evaluation import MotionError, PoseEvaluation, SegmentError, evaluate_poses
from .calibration.rectification import Rectification, StereoRig
from .values import as_dataclass as _as_dataclass
from .evaluation.moved_maps import move_map
from .evaluation.video_evaluation import DensityFigures, RegionFigures, VideoEvaluation, VideoFigures, evaluate_video

__all__ = ["__version__", "read_calibration", "read_euroc_rig", "read_opencv_rig", "depth_sigma_from_disparity", "Rectification", "StereoRig", "StereoVideo", "VideoFrame", "match_pair", "Matcher", "run", "PointCloud", "point_cloud", "write_ply", "ObjectCounts", "OutlierFigures", "SceneFlowEvaluation", "SceneFlowFigures", "evaluate_scene_flow", "MotionError", "PoseEvaluation", "SegmentError", "evaluate_poses", "DensityFigures", "RegionFigures", "VideoEvaluation", "VideoFigures", "evaluate_video", "move_map",
           *(name for name in dir(_egosgm) if not name.startswith("_"))]


def _signature(leading, options):
    """What help() and editors show: the options with their defaults."""
    kind = _inspect.Parameter
    names = [kind(name, kind.POSITIONAL_OR_KEYWORD) for name in leading]
    return _inspect.Signature(names + [kind(name.replace(".", "__"), kind.KEYWORD_ONLY, default=value)
                                       for name, value in options.items()])


_egosgm.Pipeline.__doc__ = """Disparity and its variance for every frame of rectified stereo video.

Pipeline(calibration, width, height, *, device="", preset="default", cache="", **options)

device: a number, a type or a part of a name, see devices(); "" is the environment variable EGOSGM_DEVICE, else the first one.
cache: a folder that keeps what the device's compiler makes, or "off"; "" is the environment variable EGOSGM_CACHE, else ~/.cache/egosgm for
drivers that keep nothing themselves.
Options, with their defaults:
""" + "".join(f"    {_name}={_egosgm.pipeline_options()[_name]!r}\n        {_meaning} {_range}{' ' + _unit if _unit else ''}. {_when}\n"
              for _name, _meaning, _unit, _range, _when in _egosgm._option_texts())
_egosgm.Pipeline.__signature__ = _signature(("calibration", "width", "height"),
                                            {"device": "", **_egosgm.pipeline_options()})
_egosgm.StereoOdometry.__signature__ = _signature(("calibration",), _egosgm.odometry_options())
_egosgm.SyntheticSequence.__signature__ = _signature((), _egosgm.synthetic_options())

for _values in (_egosgm.Calibration, _egosgm.DeviceInfo, _egosgm.DisparityCounts, _egosgm.DisparityMetrics, _egosgm.FrameReport):
    _as_dataclass(_values)

# Other processes take them: multiprocessing pickles what it sends.
_egosgm.Calibration.__reduce__ = lambda self: (_egosgm.Calibration, (self.fx, self.fy, self.cx, self.cy, self.baseline_m, self.doffs_px))
_egosgm.Motion.__reduce__ = lambda self: (_egosgm.Motion, (self.current_from_previous, self.covariance))


def _shown(cls, text):
    cls.__repr__ = lambda self: f"<{cls.__name__} {text(self)}>"


def _motion_text(motion):
    """Where the camera went, in the frame that it was in."""
    moved = motion.current_from_previous
    return "to ({:.3f}, {:.3f}, {:.3f}) m".format(*(-moved[:3, :3].T @ moved[:3, 3]))


def _maps_of(frame):
    names = (name for name, member in vars(_egosgm.Frame).items() if isinstance(member, property) and name != "report")
    return "of " + ", ".join(name for name in names if getattr(frame, name) is not None)


_shown(_egosgm.Motion, _motion_text)
_shown(_egosgm.Frame, _maps_of)
_shown(_egosgm.OdometryResult, lambda found: f"{found.motion!r}, {found.inliers} of {found.matches} matches" if found.motion else f"no motion: {found.reason}")
_shown(_egosgm.Pipeline, lambda pipeline: f"on {pipeline.device.name}, {pipeline.options['disparities']} disparities")
_shown(_egosgm.StereoSequence, lambda sequence: f"{sequence.title}, {len(sequence)} frames")
_shown(_egosgm.StereoFrame, lambda frame: f"{frame.name}: {frame.left}, {frame.right}")
_shown(_egosgm.SyntheticSequence, lambda street: f"of {len(street)} frames, {street.options['width']}x{street.options['height']}")
