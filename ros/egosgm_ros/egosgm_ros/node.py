# SPDX-License-Identifier: Apache-2.0
"""The node egosgm: rectified pairs in, disparity, depth, its variance, points and odometry out, by stereo_image_proc's names."""
import contextlib
import copy
import ctypes
import os
import pathlib
import sys
import threading
import time
from typing import Any, Dict, Optional, Set, Tuple

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import SetParametersResult
from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from stereo_msgs.msg import DisparityImage

import egosgm
from egosgm.bag import Pairing
from egosgm.bag.ros_images import Cameras, are_raw, grey_of, is_named_rect, rgb_of, stamp_ns, variance_of_depth
from egosgm_ros import messages
from egosgm_ros.messages import Path, detections_of, disparity_of, image_of, odometry_of, points_of, transform_of
from egosgm_ros.tf_motion import TfMotion, tf2_ros

SIDES = ("left", "right")
OUTPUTS = {"disparity": DisparityImage, "depth": Image, "variance": Image, "reason": Image, "points2": PointCloud2, "camera_info": CameraInfo}
OWN = {"device": "", "preset": "default", "max_skew_ms": 0.0, "reliable": False, "auto_start": True, "odom_frame": "odom",
       "publish_tf": False, "motion_frame": "", "tf_wait_s": 0.1, "compressed": False, "max_depth_sigma": 0.1, "point_reasons": "",
       "points_without_moving": False}
PROFILES = pathlib.Path(__file__).with_name("fastdds.xml")
PROFILES_NAMES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")  # before Fast DDS 3, and since then
PROFILES_NAME = PROFILES_NAMES[os.environ.get("ROS_DISTRO") not in ("humble", "iron", "jazzy")]
LOST_ON_THE_WAY = (f"images lost on the way: the driver's shared memory does not hold them: start the driver with {PROFILES_NAME}={PROFILES}; "
                   "where that is not enough, reliable:=true with a driver that is reliable")
REPLACED = "pairs replaced by newer ones: more come than are matched in time"
PAIRS_PER_LOOK = 50  # at what speaks against the input
QUEUE_SIZE = 5  # of the middleware, as topics of sensors have it: the node empties it at once, and keeps the newest pair


def _differ(a: CameraInfo, b: CameraInfo) -> bool:
    def size(info: CameraInfo) -> Tuple[int, ...]:
        region = info.roi
        return info.width, info.height, info.binning_x, info.binning_y, region.x_offset, region.y_offset, region.width, region.height

    return bool((a.p != b.p).any()) or size(a) != size(b)


class EgosgmNode(LifecycleNode):
    """Parameters: those of OWN, and every option of the pipeline by its name. They are read when the node is configured."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__("egosgm", **arguments)
        for name, value in OWN.items():
            self._declare(name, value)
        try:
            self._of_preset = egosgm.pipeline_options(self._value("preset"))
        except ValueError:  # which on_configure says
            self._of_preset = egosgm.pipeline_options()
        del self._of_preset["preset"]
        for name, value in self._of_preset.items():
            self._declare(name, value)
        for name in self._parameter_overrides:
            if not self.has_parameter(name) and not name.startswith("qos_overrides."):
                raise egosgm.InvalidArgument(f"no parameter named {name}: docs/use/robots.md lists them")
        self._set_later: Set[str] = set()
        self.add_on_set_parameters_callback(self._on_set)
        self._worker: Optional[threading.Thread] = None
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(1.0, self._tell)
        self._clear()

    def _clear(self) -> None:
        self._infos: Dict[str, CameraInfo] = {}
        self._cameras: Optional[Cameras] = None
        self._pipeline: Optional[egosgm.Pipeline] = None
        self._odometry: Optional[egosgm.StereoOdometry] = None
        self._tracker: Optional[egosgm.ObjectTracker] = None
        self._made_for: Tuple[CameraInfo, ...] = ()
        self._path = Path()
        self._newest: Optional[Tuple[Any, Any]] = None  # the pair that is matched next
        self._wake = threading.Condition()
        self._is_active = self._is_configured = False
        self._count = self._replaced = self._lost_on_the_way = self._frames_told = 0
        self._lost_told = [0, 0]
        self._problem = self._warning = ""
        self._tf: Optional[TfMotion] = None
        self._broadcaster: Any = None
        self._last_stamp: Optional[int] = None
        self._report: Optional[egosgm.FrameReport] = None
        self._latency_ms = 0.0
        self._suspicion, self._suspicion_told = "", False
        self._topics_warning = ""
        self._told_at = time.monotonic()
        self._warned_at: Dict[str, float] = {}
        self._waits_since = self._told_at  # for a pair

    def _declare(self, name: str, default: Any) -> None:
        """A whole number is a text or a fraction where one is wanted: device:=0, max_skew_ms:=5."""
        given = self._parameter_overrides.get(name)
        if given is not None and type(given.value) is int and type(default) in (str, float):
            self._parameter_overrides[name] = Parameter(name, value=type(default)(given.value))
        self.declare_parameter(name, default)

    def _value(self, name: str) -> Any:
        return self.get_parameter(name).value

    def _options(self) -> Dict[str, Any]:
        """The preset, and over it what the user set."""
        changed = {name: self._value(name) for name, value in self._of_preset.items() if name in self._set_later or self._value(name) != value}
        return {"preset": self._value("preset"), **{name.replace(".", "__"): value for name, value in changed.items()}}

    def _on_set(self, parameters: Any) -> SetParametersResult:
        late = [parameter.name for parameter in parameters if self._is_configured and parameter.name in (*OWN, *self._of_preset)]
        if late:
            return SetParametersResult(successful=False, reason=f"{late[0]} is read when the node is configured: clean it up, set the parameter, configure it again")
        self._set_later.update(parameter.name for parameter in parameters)
        return SetParametersResult(successful=True)

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        self._clear()
        try:
            if not 0 <= self._value("tf_wait_s") < np.inf:
                raise ValueError(f"tf_wait_s {self._value('tf_wait_s')}: give how long an image waits for its motion, 0 or more")
            if not 0 <= self._value("max_skew_ms") < np.inf:
                raise ValueError(f"max_skew_ms {self._value('max_skew_ms')}: give 0 for equal stamps, or how far they may differ")
            if not self._value("max_depth_sigma") > 0:
                raise ValueError(f"max_depth_sigma {self._value('max_depth_sigma')}: give the largest sigma of a point's depth as a part of the depth, 0.1 or .inf")
            names = self._value("point_reasons").replace(",", " ").split()
            for name in names:
                if name not in egosgm.REASONS:
                    raise ValueError(f"point_reasons {name}: give some of {', '.join(egosgm.REASONS)}, or none for all")
            self._point_reasons = [egosgm.REASONS.index(name) for name in names]
            if self._value("publish_tf") and self._value("motion_frame"):
                raise ValueError("publish_tf and motion_frame: a motion that comes from tf is not published there again: unset one of them")
            egosgm.Pipeline(egosgm.Calibration(100, 100, 32, 32, 0.1), 64, 64, device=self._value("device"), **self._options())
            if self._value("publish_tf"):
                self._broadcaster = tf2_ros().TransformBroadcaster(self)
            if self._value("motion_frame"):  # last: what is made here stays
                self._tf = TfMotion(self, self._value("motion_frame"), self._value("tf_wait_s"))
        except (ValueError, RuntimeError) as error:
            self._problem = str(error)
            self.get_logger().error(self._problem)
            return TransitionCallbackReturn.FAILURE
        self._pairing = Pairing(int(self._value("max_skew_ms") * 1e6))
        qos = QoSProfile(depth=QUEUE_SIZE, reliability=ReliabilityPolicy.RELIABLE) if self._value("reliable") else qos_profile_sensor_data
        self._outputs = {name: self.create_lifecycle_publisher(kind, name, qos) for name, kind in OUTPUTS.items()}
        self._outputs["odom"] = self.create_lifecycle_publisher(Odometry, "odom", QUEUE_SIZE)
        if messages.vision:
            self._outputs["objects"] = self.create_lifecycle_publisher(messages.vision.Detection3DArray, "objects", qos)
        else:
            self.get_logger().info("no topic objects: it needs vision_msgs: apt install ros-$ROS_DISTRO-vision-msgs")
        self._tracked_topics = {"objects"} | ({"points2"} if self._value("points_without_moving") else set())
        self._inputs = []
        for index, side in enumerate(SIDES):
            self._inputs.append(self.create_subscription(CameraInfo, f"{side}/camera_info", lambda info, side=side: self._on_info(side, info), qos))
            self._inputs.append(self._image_subscription(index, qos))
        self._is_configured = True
        return TransitionCallbackReturn.SUCCESS

    def _image_subscription(self, index: int, qos: QoSProfile) -> Any:
        """Whose middleware tells what it dropped, where it can."""
        kind, topic = (CompressedImage, "image_rect/compressed") if self._value("compressed") else (Image, "image_rect")
        for events in (SubscriptionEventCallbacks(message_lost=self._on_lost), None):
            try:
                return self.create_subscription(kind, f"{SIDES[index]}/{topic}", lambda image: self._on_image(index, image), qos, event_callbacks=events)
            except UnsupportedEventTypeError:
                continue

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        self._is_active = True
        self._newest = None
        self._worker = threading.Thread(target=self._work, daemon=True)
        self._worker.start()
        self._waits_since = time.monotonic()
        topics = " ".join(subscription.topic_name for subscription in self._inputs)
        self.get_logger().info(f"active: waits for {topics} ({'reliable' if self._value('reliable') else 'best effort'})")
        self._topics_warning = self._warning_of(*(subscription.topic_name for subscription in self._inputs[1::2]))
        if self._topics_warning:
            self.get_logger().warning(self._topics_warning)
        return super().on_activate(state)

    @staticmethod
    def _warning_of(left: str, right: str) -> str:
        """What speaks against two topics of images."""
        if is_named_rect(left) == is_named_rect(right):
            return ""
        rectified, raw = (left, right) if is_named_rect(left) else (right, left)
        return f"by their names, {rectified} is rectified and {raw} is not: remap both cameras' image_rect to rectified images"

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        self._stop()
        return super().on_deactivate(state)

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        for publisher in self._outputs.values():
            self.destroy_publisher(publisher)
        if self._tf:
            self._tf.close()
        self._clear()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: Any) -> TransitionCallbackReturn:
        self._stop()
        return TransitionCallbackReturn.SUCCESS

    def _stop(self) -> None:
        with self._wake:
            self._is_active = False
            self._wake.notify()
        if self._worker:
            self._worker.join()
            self._worker = None

    def _on_info(self, side: str, info: CameraInfo) -> None:
        self._infos[side] = info

    def _on_lost(self, event: Any) -> None:
        self._lost_on_the_way += event.total_count_change

    def _on_image(self, index: int, image: Image) -> None:
        if not self._is_active:
            return
        for (_, left), (_, right) in self._pairing.add(index, stamp_ns(image), image):
            self._waits_since = time.monotonic()
            with self._wake:
                self._replaced += self._newest is not None
                self._newest = left, right
                self._wake.notify()

    def _work(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._newest or not self._is_active)
                if not self._is_active:
                    return
                (left, right), self._newest = self._newest, None
            try:
                self._process(left, right)
                self._problem = ""
            except Exception as error:  # whatever a message held: the next one may be whole
                if not self.context.ok():  # the process ends: nothing can be published
                    return
                for tool in (self._pipeline, self._odometry):
                    if tool:
                        tool.reset()  # one of them may have gone on without the other
                self._tracker = None
                if str(error) != self._problem:
                    self.get_logger().error(str(error))
                self._problem = str(error)

    def _process(self, left: Image, right: Image) -> None:
        if len(self._infos) < 2:
            raise ValueError(f"no camera info yet on {' and '.join(f'{side}/camera_info' for side in SIDES if side not in self._infos)}")
        infos = self._infos["left"], self._infos["right"]
        if self._cameras is None or any(map(_differ, infos, self._made_for)):
            cameras = Cameras(*infos, False)
            self._pipeline = egosgm.Pipeline(cameras.calibration, *cameras.size, device=self._value("device"), **self._options())
            self._odometry = egosgm.StereoOdometry(cameras.calibration)
            self._cameras, self._made_for = cameras, infos  # last: where one cannot be made, all are made for the next pair
            self._last_stamp = self._path.motion = self._tracker = None
            raw = [topic.topic_name for info, topic in zip(infos, self._inputs[1::2]) if are_raw(info, topic.topic_name)]
            if raw and not self._topics_warning:
                self._topics_warning = (f"by {' and '.join(raw)}'s name and camera info, which has a distortion or a rotation, it is not rectified: remap both "
                                      "cameras' image_rect to rectified images")
                self.get_logger().warning(self._topics_warning)
        images = grey_of(left), grey_of(right)
        for side, image in zip(SIDES, images):
            if image.shape != (self._cameras.size[1], self._cameras.size[0]):
                raise ValueError(f"{side}/image_rect: an image of {image.shape[1]}x{image.shape[0]} px, while the camera info is of "
                                 f"{self._cameras.size[0]}x{self._cameras.size[1]}")
        stamp, previous = stamp_ns(left), self._last_stamp
        self._warning = ""
        if stamp == previous:
            self._warning = f"pairs of one stamp, {stamp / 1e9:.3f} s, which tells nothing of what belongs together or moved: let the driver stamp each image"
            self._warn("stamp", self._warning)
        if previous is not None and stamp <= previous:  # a bag that starts over
            self._pipeline.reset()
            self._odometry.reset()
            previous = self._path.motion = None
        self._last_stamp = stamp
        motion = self._motion(left.header.frame_id, images, previous, stamp)
        if previous is not None:
            self._path.add(motion, (stamp - previous) / 1e9)
        wanted = self._listened_to()
        maps = self._pipeline.process(*images, motion, self._maps_for(wanted))
        self._publish(wanted, left, images[0], maps, self._track(wanted, images[0], maps, motion))
        self._report, self._count = maps.report, self._count + 1
        self._latency_ms = self.get_clock().now().nanoseconds / 1e6 - stamp / 1e6
        if self._count % PAIRS_PER_LOOK == 1:
            self._look_at_input(images, maps.report)
        if self._count == 1:
            width, height = self._cameras.size
            self.get_logger().info(f"first pair: {width}x{height} px, matched by {self._pipeline.device.name}")

    def _maps_for(self, wanted: Set[str]) -> Tuple[str, ...]:
        needed = {"variance": {"variance", "points2"}, "reason": {"reason"} | ({"points2"} if self._point_reasons else set()),
                  "dynamic": self._tracked_topics}
        return ("disparity", *(name for name, topics in needed.items() if wanted & topics))

    def _track(self, wanted: Set[str], grey: Any, maps: egosgm.Frame, motion: Optional[egosgm.Motion]) -> Optional[egosgm.LabelledObjects]:
        """What moves by itself, where a topic needs it. A frame that none needs ends all objects."""
        if not wanted & self._tracked_topics:
            self._tracker = None
            return None
        if self._tracker is None:
            self._tracker, motion = egosgm.ObjectTracker(self._cameras.calibration), None
        return self._tracker.process(grey, maps.disparity, maps.dynamic, motion)

    def _look_at_input(self, images: Any, report: egosgm.FrameReport) -> None:
        """What is nearer than the range, and what else speaks against the images or their calibration."""
        options = self._pipeline.options
        check = egosgm._egosgm._InputCheck(self._cameras.calibration, options["min_disparity"], options["disparities"])
        check.add(*images, report, True)
        self._suspicion = check.text().replace("--disparities ", "disparities:=")
        if self._suspicion and not self._suspicion_told:
            self.get_logger().warning(self._suspicion)
            self._suspicion_told = True

    def _motion(self, frame_id: str, images: Any, previous: Optional[int], stamp: int) -> Optional[egosgm.Motion]:
        if self._tf is None:
            return self._odometry.process(*images).motion
        try:
            return self._tf.between(frame_id, previous, stamp) if previous is not None else None
        except LookupError as error:
            self._warning = f"{error}; such frames are searched whole"
            return None

    def _certain(self, depth: Any, variance: Any, maps: egosgm.Frame, objects: Optional[egosgm.LabelledObjects]) -> Any:
        """The depth of which points are made, NaN elsewhere."""
        is_certain = variance <= (self._value("max_depth_sigma") * depth) ** 2
        if self._point_reasons:
            is_certain &= np.isin(maps.reason, self._point_reasons)
        if self._value("points_without_moving"):
            is_certain &= (maps.dynamic == 0) & (objects.labels == 0)
        return np.where(is_certain, depth, np.float32(np.nan))

    def _listened_to(self) -> Set[str]:
        return {name for name, publisher in self._outputs.items() if publisher.get_subscription_count() > 0}

    def _publish(self, wanted: Set[str], left: Any, grey: Any, maps: egosgm.Frame, objects: Optional[egosgm.LabelledObjects]) -> None:
        calibration, header = self._cameras.calibration, left.header
        if "disparity" in wanted:
            self._outputs["disparity"].publish(disparity_of(header, maps.disparity, calibration, self._pipeline.options))
        if "reason" in wanted:
            self._outputs["reason"].publish(image_of(header, maps.reason))
        if wanted & {"depth", "variance", "points2", "objects"}:
            depth = egosgm.depth_from_disparity(maps.disparity, calibration)
            if "depth" in wanted:
                self._outputs["depth"].publish(image_of(header, depth))
            if "objects" in wanted:
                self._outputs["objects"].publish(detections_of(header, objects, depth, calibration))
        if wanted & {"variance", "points2"}:
            variance = variance_of_depth(maps.disparity, maps.variance, calibration)
            if "variance" in wanted:
                self._outputs["variance"].publish(image_of(header, variance))
            if "points2" in wanted:
                self._outputs["points2"].publish(points_of(header, self._certain(depth, variance, maps, objects), grey, rgb_of(left), calibration))
        if "camera_info" in wanted:
            info = copy.copy(self._infos["left"])
            info.header = header
            self._outputs["camera_info"].publish(info)
        if "odom" in wanted:
            self._outputs["odom"].publish(odometry_of(header, self._value("odom_frame"), self._path))
        if self._broadcaster:
            self._broadcaster.sendTransform(transform_of(header, self._value("odom_frame"), self._path.world_from_camera))

    def _warn(self, cause: str, text: str) -> None:
        """At most once a minute for each cause."""
        now = time.monotonic()
        if now - self._warned_at.get(cause, -60) >= 60:
            self._warned_at[cause] = now
            self.get_logger().warning(text)

    def _tell(self) -> None:
        now = time.monotonic()
        rate = (self._count - self._frames_told) / max(1e-3, now - self._told_at)
        lost = [self._lost_on_the_way, self._replaced]
        losses = [f"{count - told} {what}" for count, told, what in zip(lost, self._lost_told, (LOST_ON_THE_WAY, REPLACED)) if count > told]
        self._told_at, self._frames_told, self._lost_told = now, self._count, lost
        status = DiagnosticStatus(name=f"{self.get_fully_qualified_name()}: stereo", hardware_id="", level=DiagnosticStatus.OK, message="matching")
        gaps = self._pairing.gaps if hasattr(self, "_pairing") else None
        if self._problem:
            status.level, status.message = DiagnosticStatus.ERROR, self._problem
        elif rate == 0 and self._is_active:
            text = "no pairs of images"
            if gaps and gaps.nearest_ms is None and gaps.unpaired_left + gaps.unpaired_right > 0:
                text += f": {SIDES[gaps.unpaired_left > 0]}/image_rect is silent"
            elif gaps and gaps.nearest_ms is not None and gaps.nearest_ms > self._value("max_skew_ms"):
                text += f": the nearest stamps differ by {gaps.nearest_ms:.3f} ms, max_skew_ms is {self._value('max_skew_ms')}"
            if now - self._waits_since >= 2:
                self._warn(text.partition("differ")[0], text)
            status.level, status.message = DiagnosticStatus.WARN, "; ".join([text, *losses])
        elif not self._is_active:
            status.message = "not active"
        elif losses:
            status.level, status.message = DiagnosticStatus.WARN, "; ".join(losses)
        elif self._warning:
            status.level, status.message = DiagnosticStatus.WARN, self._warning
        elif self._topics_warning or self._suspicion:
            status.level, status.message = DiagnosticStatus.WARN, self._topics_warning or self._suspicion
        values = {"rate_hz": f"{rate:.2f}", "frames": str(self._count), "replaced": str(self._replaced), "lost_on_the_way": str(self._lost_on_the_way)}
        if self._is_active:
            values["listened_to"] = " ".join(sorted(self._listened_to()))
        if gaps:
            values.update(unpaired_left=str(gaps.unpaired_left), unpaired_right=str(gaps.unpaired_right))
        if self._report:
            values.update(density=f"{self._report.density:.4f}", search_fraction=f"{min(1.0, self._report.search_fraction):.4f}",
                          vertical_offset_px=f"{self._report.vertical_offset_px:.3f}", latency_ms=f"{self._latency_ms:.1f}",
                          device=self._pipeline.device.name)
        for loss in losses:
            self._warn(loss.partition(" ")[2], loss)
        status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def _prepare_process() -> None:
    """Fast DDS gets shared memory for maps, unless somebody chose what it has. glibc keeps the memory of maps, which come and go with each pair;
    else the kernel clears it anew each time."""
    if not any(name in os.environ for name in (*PROFILES_NAMES, "FASTDDS_BUILTIN_TRANSPORTS")):
        os.environ[PROFILES_NAME] = str(PROFILES)
    with contextlib.suppress(AttributeError, OSError, TypeError):  # another C library
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(-3, 32 << 20)  # M_MMAP_THRESHOLD
        mallopt(-1, 128 << 20)  # M_TRIM_THRESHOLD


def main() -> int:
    _prepare_process()
    rclpy.init()
    try:
        node = EgosgmNode()
    except (ParameterException, ValueError) as error:
        rclpy.try_shutdown()
        print(f"egosgm_node: {error}", file=sys.stderr)
        return 1
    configured = not node._value("auto_start") or node.trigger_configure() == TransitionCallbackReturn.SUCCESS  # which says why not
    try:
        if configured:
            if node._value("auto_start"):
                node.trigger_activate()
            rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    node._stop()
    node.destroy_node()
    rclpy.try_shutdown()
    return 0 if configured else 1


if __name__ == "__main__":
    sys.exit(main())
