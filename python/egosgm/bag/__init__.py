# SPDX-License-Identifier: Apache-2.0
"""Recorded drives of robots: ROS 2's MCAP and SQLite, and ROS 1's bags, by rosbags."""
import bisect
import contextlib
import dataclasses
import itertools
import math
import os
import pathlib
from typing import Any, Collection, Iterator, List, Optional, Sequence, Tuple

import numpy as np
from numpy.typing import NDArray

from .. import _egosgm
from ..calibration import reader as calibrations
from ..calibration.rectification import StereoRig
from .pairing import Gaps, Pairing, in_order, ms_text
from .parts import Parts, first_line, remedy_of
from .ros_images import BODY_FROM_OPTICAL, Cameras, are_raw, grey_of, is_set, needs, quaternion_of, rotation_of, stamp_ns

_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
# Words that tell cameras apart in names of topics.
_SIDES = (("left", "right"), ("Left", "Right"), ("cam0", "cam1"), ("camera0", "camera1"), ("infra1", "infra2"), ("cam_0", "cam_1"),
          ("camera_0", "camera_1"), ("cam1", "cam2"), ("camera1", "camera2"), ("infra_1", "infra_2"), ("/0/", "/1/"), ("Infrared_1", "Infrared_2"))
_MOST_BROKEN = 10  # from the start on; then the bag is none that can be read
_POSES = ("nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped")


@dataclasses.dataclass
class BagFrame:
    """A rectified pair of a bag."""

    number: int
    stamp_ns: int
    frame_id: str
    left: NDArray[Any]
    right: NDArray[Any]
    starts_anew: bool
    world_from_camera: Optional[NDArray[np.float64]]


class Bag:
    """Frames of a bag, from its start each time. `cameras` and `gaps` are known when frames are read."""

    def __init__(self, path: "str | os.PathLike[str]", left_topic: str = "", right_topic: str = "", info_topics: Sequence[str] = (),
                 pose_topic: str = "", max_skew_ms: float = 0.0, rectify: Optional[bool] = None, pose_axes: str = "body",
                 calib: "str | os.PathLike[str] | Sequence[str | os.PathLike[str]]" = "") -> None:
        highlevel = needs("rosbags.highlevel")
        self.path = pathlib.Path(path)
        if not (self.path.is_file() or self.path.is_dir()):
            raise _egosgm.InvalidArgument(f"{self.path}: no such file or folder: give a .mcap, a .bag, or a bag's folder")
        if len(info_topics) not in (0, 2):
            raise _egosgm.InvalidArgument(f"info topics: give two, left and right, not {len(info_topics)}")
        if not (max_skew_ms >= 0 and math.isfinite(max_skew_ms)):
            raise _egosgm.InvalidArgument(f"max skew {max_skew_ms} ms: give 0 for equal stamps, or how far they may differ")
        if pose_axes not in ("body", "optical"):
            raise _egosgm.InvalidArgument(f"pose axes \"{pose_axes}\": choose body (x forward, z up) or optical (z forward, y down)")
        if calib and (info_topics or rectify is not None):
            raise _egosgm.InvalidArgument(f"calibration {calib}: it says by itself whether images are rectified, and what camera infos would say: "
                                          "give no info topics, and leave rectify out")
        self._parts = Parts(self.path, highlevel, needs("rosbags.typesys"))
        if not left_topic or not right_topic:
            left_topic, right_topic = self._find_topics(left_topic, right_topic)
        self.images = left_topic, right_topic
        self.infos = () if calib else tuple(info_topics) or tuple(_info_topic(topic) for topic in self.images)
        self._calib = calib
        self._pose_topic, self._bound_ns, self._rectify, self._pose_axes = pose_topic, int(max_skew_ms * 1e6), rectify, pose_axes
        self.cameras: Optional[Cameras] = None
        self.is_rectified_here = False
        self.gaps = Gaps()
        with self._opened() as reader:
            there = {connection.topic for connection in reader.connections}
            self.images, self.infos = (tuple(_with_slash(topic, there) for topic in topics) for topics in (self.images, self.infos))
            self._pose_topic = _with_slash(pose_topic, there)
            self._check_topics(reader)
            self.count = min(sum(c.msgcount for c in reader.connections if c.topic == topic) for topic in self.images)

    @contextlib.contextmanager
    def _opened(self) -> Iterator[Any]:
        try:
            with self._parts.reader() as reader:
                yield reader
        except (_egosgm.InvalidArgument, _egosgm.IoError, _egosgm.DeviceError):
            raise
        except Exception as error:  # whatever a decoder of what is broken may raise
            raise _egosgm.InvalidArgument(f"{self.path}: cannot be read as a bag: {first_line(error)}{_remedy(self.path)}") from error

    def _find_topics(self, left: str, right: str) -> Tuple[str, str]:
        """The topics of both cameras, where there is one choice; of one camera's raw and rectified images the rectified."""
        with self._opened() as reader:
            there = sorted({connection.topic for connection in reader.connections if connection.msgtype in _IMAGES})
        pairs = []
        for topic in there:
            for name, other in _SIDES:
                partner = topic.replace(name, other)
                if partner != topic and partner in there and (left in ("", topic)) and (right in ("", partner)):
                    pairs.append((topic, partner))
                    break
        rectified = [pair for pair in pairs if "rect" in pair[0]]
        chosen = rectified if len(rectified) == 1 else pairs
        plain = [pair for pair in chosen if not pair[0].endswith(("/compressed", "/compressedDepth", "/theora"))]
        chosen = plain if len(plain) == 1 else chosen
        if len(chosen) != 1:
            what = "more than one pair of cameras" if chosen else "no pair of cameras that names tell"
            raise _egosgm.InvalidArgument(f"{self.path}: has {what}: give --left-topic and --right-topic; its topics of images: {', '.join(there) or 'none'}")
        return chosen[0]

    def _check_topics(self, reader: Any) -> None:
        types = {connection.topic: connection.msgtype for connection in reader.connections}
        wanted = [(topic, _IMAGES, "images") for topic in self.images] + [(topic, ("sensor_msgs/msg/CameraInfo",), "camera infos") for topic in self.infos]
        if self._pose_topic:
            wanted.append((self._pose_topic, _POSES, "poses"))
        if self.images[0] == self.images[1]:
            raise _egosgm.InvalidArgument(f"{self.path}: \"{self.images[0]}\" is given as left and as right: give the topics of both cameras")
        for topic, kinds, what in wanted:
            there = ", ".join(sorted(name for name, kind in types.items() if kind in kinds)) or "none"
            if topic not in types:
                remedy = "; without them give --calib" if topic in self.infos and there == "none" else ""
                raise _egosgm.InvalidArgument(f"{self.path}: has no topic \"{topic}\"; its topics of {what}: {there}{remedy}")
            if types[topic] not in kinds:
                raise _egosgm.InvalidArgument(f"{self.path}: \"{topic}\" is of type {types[topic]}; its topics of {what}: {there}")

    def find_cameras(self) -> Cameras:
        with self._opened() as reader:
            self.cameras = self._find_cameras(reader)
        return self.cameras

    def _first_messages(self, reader: Any, topic: str) -> Iterator[Any]:
        """Those that can be read of the first few."""
        connections = [c for c in reader.connections if c.topic == topic]
        for connection, _, raw in itertools.islice(reader.messages(connections=connections), _MOST_BROKEN):
            try:
                message = reader.deserialize(raw, connection.msgtype)
            except Exception:  # of what is broken, which is named when its turn comes
                continue
            yield message

    def _find_cameras(self, reader: Any) -> Cameras:
        found = []
        self._first_infos = {}
        for topic in self.infos or self.images[:1]:
            found.append(self._first_whole(reader, topic))
            if self.infos:
                self._first_infos[topic] = _values_of(found[-1])
        if self._calib:
            height, width = grey_of(found[0]).shape
            calibration = calibrations.read_calibration(self._calib, size=(width, height))
            self.is_rectified_here = isinstance(calibration, StereoRig)
            return Cameras.of_calibration(calibration, width, height)
        self.is_rectified_here = any(map(are_raw, found, self.images)) if self._rectify is None else self._rectify
        return Cameras(*found, self.is_rectified_here, self.infos)

    def _first_whole(self, reader: Any, topic: str) -> Any:
        """The first camera info that is set, or the first image that can be read."""
        first, reason = None, None
        connections = [c for c in reader.connections if c.topic == topic]
        for connection, _, raw in itertools.islice(reader.messages(connections=connections), 300):
            try:
                message = reader.deserialize(raw, connection.msgtype)
                if self.infos and not is_set(message):
                    first = message if first is None else first
                    continue
                if not self.infos:
                    grey_of(message)
                return message
            except Exception as error:  # of what is broken
                reason = error
        if first is not None:
            return first
        if isinstance(reason, _egosgm.InvalidArgument):
            raise _egosgm.InvalidArgument(f"{self.path}: {topic}: {reason}")
        raise _egosgm.InvalidArgument(f"{self.path}: \"{topic}\" has no message" + (f" that can be read: {reason}" if reason else ""))

    def __len__(self) -> int:
        return self.count

    def frames(self) -> Iterator[BagFrame]:
        pairing = Pairing(self._bound_ns)
        self.gaps = pairing.gaps
        pairing.gaps.parts = list(self._parts.notes)
        with self._opened() as reader:
            self.cameras = self._find_cameras(reader)
            of_sides = [[stamp_ns(m) for m in itertools.islice(self._first_messages(reader, topic), 2)] for topic in self.images]
            pairing.gaps.has_no_stamps = any(stamps and not any(stamps) for stamps in of_sides)
            yield from _Reading(self, reader, pairing).frames()

    def _read_poses(self, reader: Any) -> Tuple[List[int], List[NDArray[np.float64]]]:
        poses = []
        for connection, time, raw in reader.messages(connections=[c for c in reader.connections if c.topic == self._pose_topic]):
            message = reader.deserialize(raw, connection.msgtype)
            pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
            world_from_body = np.eye(4)
            world_from_body[:3, :3] = rotation_of(pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w)
            world_from_body[:3, 3] = pose.position.x, pose.position.y, pose.position.z
            if not np.isfinite(world_from_body).all():
                raise _egosgm.InvalidArgument(f"{self._pose_topic}: pose {len(poses)} is not finite")
            poses.append((stamp_ns(message) or time, world_from_body @ BODY_FROM_OPTICAL if self._pose_axes == "body" else world_from_body))
        poses.sort(key=lambda item: item[0])
        return [time for time, _ in poses], [pose for _, pose in poses]


class _Reading:
    """The frames of a bag, from its start to its end or to another calibration."""

    def __init__(self, bag: Bag, reader: Any, pairing: Pairing) -> None:
        self._bag, self._reader, self._pairing, self._gaps = bag, reader, pairing, pairing.gaps
        self._cameras = bag.cameras
        self._times, self._poses = bag._read_poses(reader) if bag._pose_topic else ([], [])
        self._number, self._last, self._changed = 0, None, ""

    def frames(self) -> Iterator[BagFrame]:
        for stamp, side, message in in_order(self._stamped()):
            for pair in self._pairing.add(side, stamp, message):
                yield from self._frame_of(*pair)
        for pair in self._pairing.end():
            yield from self._frame_of(*pair)
        if self._changed:
            raise _egosgm.InvalidArgument(self._changed)
        if self._number == 0:
            raise _egosgm.InvalidArgument(f"{self._bag.path}: {self._why_none()}")

    def _stamped(self) -> Iterator[Tuple[int, int, Any]]:
        connections = [c for c in self._reader.connections if c.topic in (*self._bag.images, *self._bag.infos)]
        for connection, time, raw in self._reader.messages(connections=connections):
            try:
                message = self._reader.deserialize(raw, connection.msgtype)
            except Exception as error:  # whatever a decoder of what is broken may raise
                self._note_broken(connection.topic, time, error)
                continue
            if connection.topic in self._bag.images:
                stamp = time if self._gaps.has_no_stamps else stamp_ns(message)
                yield stamp, self._bag.images.index(connection.topic), message
                continue
            if is_set(message) and _values_of(message) != self._bag._first_infos[connection.topic]:  # what was before is a drive of its own
                self._changed = (f"{connection.topic}: another calibration than at the start, from {stamp_ns(message) / 1e9:.3f} s on: cut the bag "
                                 "there, or give one calibration for all of it by --calib")
                return

    def _frame_of(self, left: Tuple[int, Any], right: Tuple[int, Any]) -> Iterator[BagFrame]:
        """None of a pair that comes again, or that is broken."""
        stamp, last, topics = left[0], self._last, self._bag.images
        if not 0 <= stamp < 2**31 * 10**9:
            raise _egosgm.InvalidArgument(f"{topics[0]}: a stamp of {stamp / 1e9:.0f} s, which is not from 1970 to 2038")
        if stamp == last:
            self._gaps.repeated += 1
            return
        steps_back = last is not None and stamp < last
        if steps_back:
            self._gaps.steps_back += 1
        elif last is not None and stamp - last > 1.5e6 * self._gaps.interval_ms:
            self._gaps.gaps.append((self._number, (stamp - last) / 1e9))
        images = [self._image_of(message, stamp, topic) for (_, message), topic in zip((left, right), topics)]
        if images[0] is None or images[1] is None:
            return
        if images[0].dtype != images[1].dtype:
            raise _egosgm.InvalidArgument(f"{topics[0]} has {images[0].dtype}, {topics[1]} has {images[1].dtype}: both need one depth")
        pose = _pose_at(self._times, self._poses, stamp)
        self._gaps.without_pose += bool(self._bag._pose_topic) and pose is None
        frame = BagFrame(self._number, stamp, left[1].header.frame_id, *self._cameras.rectified(*images), last is None or steps_back, pose)
        self._number, self._last = self._number + 1, stamp
        yield frame

    def _image_of(self, message: Any, stamp: int, topic: str) -> Optional[NDArray[Any]]:
        """None of one that is broken, unless all are."""
        try:
            image = grey_of(message)
            if image.shape != (self._cameras.size[1], self._cameras.size[0]):
                of, remedy = ("first image", "") if self._bag._calib else ("camera info", ": where all are, give their calibration by --calib")
                raise _egosgm.InvalidArgument(f"an image of {image.shape[1]}x{image.shape[0]} px, while the {of} is of "
                                              f"{self._cameras.size[0]}x{self._cameras.size[1]}{remedy}")
            return image
        except (_egosgm.InvalidArgument, ValueError) as error:
            self._note_broken(topic, stamp, error)
            return None

    def _note_broken(self, topic: str, stamp: int, error: Exception) -> None:
        broken = self._gaps.broken
        broken.append(f"{topic} at {stamp // 10**9}.{stamp % 10**9:09d} s: {first_line(error)}")
        if self._number == 0 and len(broken) >= _MOST_BROKEN:
            raise _egosgm.InvalidArgument(f"{self._bag.path}: {broken[0]}")

    def _why_none(self) -> str:
        """Why there is no frame."""
        if self._gaps.broken:
            return f"no pair is whole: {self._gaps.broken[0]}"
        none, apart = "no left image has a right one of its time", self._gaps.nearest_ms
        if apart is not None and self._gaps.are_other_moments(apart):
            return (f"{none}; the nearest stamps differ by {ms_text(apart)} at {ms_text(self._gaps.interval_ms)} a frame: left and right are of other moments, "
                    "so that nothing can be matched")
        nearest = f"the nearest stamps differ by {ms_text(apart)}: allow that by --max-skew-ms" if apart is not None else "one of the topics has no image"
        unset = " (images have no stamps here: the times at which they were recorded are taken)" if self._gaps.has_no_stamps else ""
        return f"{none}; {nearest}{unset}"


def _remedy(path: pathlib.Path) -> str:
    if path.is_file() and (path.parent / "metadata.yaml").exists():
        return f"; it is a part of the bag {path.parent}: give that folder"
    return remedy_of(path)


def _with_slash(topic: str, there: Collection[str]) -> str:
    return f"/{topic}" if topic and topic not in there and f"/{topic}" in there else topic


def _values_of(info: Any) -> Tuple[Any, ...]:
    """All that a camera info says, but when."""
    roi = getattr(info, "roi", None)
    region = (roi.x_offset, roi.y_offset, roi.width, roi.height) if roi is not None else ()
    of_image = info.width, info.height, info.binning_x, info.binning_y, info.distortion_model, region
    return *of_image, *(tuple(np.ravel(getattr(info, name.lower(), None) if hasattr(info, name.lower()) else getattr(info, name))) for name in "DKRP")


def _info_topic(image_topic: str) -> str:
    """Where ROS puts the camera info of an image: beside it. A compressed image lies one level deeper."""
    parts = image_topic.rstrip("/").split("/")
    if parts[-1] in ("compressed", "compressedDepth", "theora", "zstd"):
        parts = parts[:-1]
    return "/".join([*parts[:-1], "camera_info"])


def _pose_at(times: List[int], poses: List[NDArray[np.float64]], stamp: int) -> Optional[NDArray[np.float64]]:
    """Between the poses before and after, which lie no further than half a second apart; None elsewhere."""
    after = bisect.bisect_left(times, stamp)
    if after < len(poses) and times[after] == stamp:
        return poses[after]
    if after == 0 or after == len(poses) or times[after] - times[after - 1] > 500_000_000:
        return None
    before, later = poses[after - 1], poses[after]
    part = (stamp - times[after - 1]) / (times[after] - times[after - 1])
    a, b = quaternion_of(before[:3, :3]), quaternion_of(later[:3, :3])
    b = b if a @ b >= 0 else -b
    result = np.eye(4)
    result[:3, :3] = rotation_of(*((1 - part) * a + part * b))
    result[:3, 3] = (1 - part) * before[:3, 3] + part * later[:3, 3]
    return result
