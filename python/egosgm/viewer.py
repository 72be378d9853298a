# SPDX-License-Identifier: Apache-2.0
"""Frames to Rerun, to look at: images, depth, variance, reasons, what moves by itself and where the camera was. Needs rerun-sdk."""
import os
import pathlib
from typing import Any, Optional, Sequence

import numpy as np

from . import _egosgm
from .bag.ros_images import depth_maps


ARROW_FRAMES = 10  # an arrow leads to where the object is after so many frames, if it moves on so


class RerunOutput:
    """Starts the viewer, or writes a recording into a new file."""

    def __init__(self, file: Optional[pathlib.Path] = None) -> None:
        try:
            import rerun
        except ModuleNotFoundError:
            raise _egosgm.InvalidArgument('the viewer Rerun is a package of its own: pip install rerun-sdk') from None
        except ImportError as error:  # of what it needs in its turn
            raise _egosgm.InvalidArgument(f"the viewer Rerun is there and does not load: {error}") from None
        if file is not None:
            if os.path.lexists(file):
                raise _egosgm.InvalidArgument(f"{file}: is there already, and stays: give another name")
            if not file.parent.is_dir():
                raise _egosgm.InvalidArgument(f"{file}: {file.parent}: no such folder")
            open(file, "xb").close()  # an error names what is wrong with it
        self._rerun: Any = rerun
        self._file = file
        self._recording = rerun.RecordingStream("egosgm")
        if file is None:
            self._recording.spawn()
        else:
            self._recording.save(file)
        self._world_from_camera = np.eye(4)
        self._last_motion: Optional[np.ndarray] = None
        self._log("camera", rerun.ViewCoordinates.RDF, static=True)
        self._log("camera/image/reason", rerun.AnnotationContext([(i, name) for i, name in enumerate(_egosgm.REASONS)]), static=True)

    def _log(self, name: str, what: Any, static: bool = False) -> None:
        self._recording.log(name, what, static=static)

    def add(self, frame: Any, maps: _egosgm.Frame, motion: Any, calibration: _egosgm.Calibration) -> None:
        """frame: of a bag or of run(). motion: from the frame before, a Motion or its matrix, or None."""
        rerun = self._rerun
        self._recording.set_time("frame", sequence=frame.number)
        if hasattr(frame, "stamp_ns"):
            self._recording.set_time("time", timestamp=np.datetime64(frame.stamp_ns, "ns"))
        if motion is not None or getattr(frame, "starts_anew", False):
            self._last_motion = getattr(motion, "current_from_previous", motion)
        if self._last_motion is not None:  # where none was found, the last one is repeated
            self._world_from_camera = self._world_from_camera @ np.linalg.inv(self._last_motion)
        height, width = frame.left.shape[:2]
        depth, variance = depth_maps(maps.disparity, maps.variance, calibration)
        self._log("camera", rerun.Transform3D(translation=self._world_from_camera[:3, 3], mat3x3=self._world_from_camera[:3, :3]))
        self._log("camera/image", rerun.Pinhole(focal_length=(calibration.fx, calibration.fy), principal_point=(calibration.cx, calibration.cy),
                                                resolution=(width, height)))
        self._log("camera/image/left", rerun.Image(frame.left, "L" if frame.left.ndim == 2 else {1: "L", 3: "RGB", 4: "RGBA"}[frame.left.shape[2]]))
        self._log("camera/image/depth", rerun.DepthImage(np.nan_to_num(depth), meter=1.0))  # 0: none
        self._log("maps/variance", rerun.DepthImage(np.nan_to_num(variance)))
        if maps.reason is not None:
            self._log("camera/image/reason", rerun.SegmentationImage(maps.reason))
        if getattr(frame, "objects", None) is not None:
            self._log_objects(frame.objects.moving)
        self._log("figures/density", rerun.Scalars(maps.report.density))
        self._log("figures/search_fraction", rerun.Scalars(min(1.0, maps.report.search_fraction)))

    def _log_objects(self, moving: Sequence[_egosgm.MovingObject]) -> None:
        """A frame without one takes the boxes of the frame before away."""
        ids = [one.id for one in moving]
        labels = [f"{one.id}: {np.linalg.norm(one.velocity_m):.2f} m a frame" for one in moving]
        self._log("camera/image/objects", self._rerun.Boxes2D(array=np.reshape([one.box for one in moving], (-1, 4)), array_format=self._rerun.Box2DFormat.XYXY,
                                                              labels=labels, class_ids=ids))
        self._log("camera/objects", self._rerun.Arrows3D(origins=np.reshape([one.centre_m for one in moving], (-1, 3)), class_ids=ids,
                                                         vectors=ARROW_FRAMES * np.reshape([one.velocity_m for one in moving], (-1, 3))))

    def finish(self) -> None:
        self._recording.flush()
        self._recording.disconnect()

    def give_up(self) -> None:
        self.finish()
        if self._file is not None:
            self._file.unlink(missing_ok=True)
