# SPDX-License-Identifier: Apache-2.0
"""The node egosgm: rectified pairs in, disparity, depth, its variance, points and odometry out, by stereo_image_proc's names."""
import copy
import sys
import threading
import time
from typing import Any, Dict, Optional, Set, Tuple

import numpy as np
import rclpy
from nav_msgs.msg import Odometry
from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from stereo_msgs.msg import DisparityImage

import egosgm
from egosgm.bag import Pairing
from egosgm.bag.ros_images import Cameras, are_raw, grey_of, is_named_rect, rgb_of, stamp_ns, variance_of_depth
from egosgm_ros import messages, process
from egosgm_ros.diagnostics import SIDES, TellingNode
from egosgm_ros.messages import Path, detections_of, disparity_of, image_of, odometry_of, points_of, transform_of
from egosgm_ros.tf_motion import TfMotion, tf2_ros

OUTPUTS = {"disparity": DisparityImage, "depth": Image, "variance": Image, "reason": Image, "points2": PointCloud2, "camera_info": CameraInfo}
PAIRS_PER_LOOK = 50  # at what speaks against the input
QUEUE_SIZE = 5  # of the middleware, as topics of sensors have it: the node empties it at once, and keeps the newest pair


def _differ(a: CameraInfo, b: CameraInfo) -> bool:
    def size(info: CameraInfo) -> Tuple[int, ...]:
        region = info.roi
        return info.width, info.height, info.binning_x, info.binning_y, region.x_offset, region.y_offset, region.width, region.height

    return bool((a.p != b.p).any()) or size(a) != size(b)


class EgosgmNode(TellingNode):
    """Matches the newest pair in a thread of its own, and publishes what somebody listens to."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        self._worker: Optional[threading.Thread] = None
        self._clear()

    def _clear(self) -> None:
        self._clear_told()
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
        self._tf: Optional[TfMotion] = None
        self._broadcaster: Any = None
        self._last_stamp: Optional[int] = None

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        self._clear()
        try:
            self._check_parameters()
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


def main() -> int:
    process.prepare()
    try:
        rclpy.init()
        node = EgosgmNode()
    except (ParameterException, RuntimeError, ValueError) as error:
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
