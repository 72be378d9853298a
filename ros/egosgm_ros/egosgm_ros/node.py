# SPDX-License-Identifier: Apache-2.0
"""The node egosgm: rectified pairs in, disparity, depth, its variance, points and odometry out, by stereo_image_proc's names."""
import array
import collections
import threading
import time
from typing import Any, Deque, Dict, Optional, Tuple

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from stereo_msgs.msg import DisparityImage

import egosgm
from egosgm.bag import Pairing
from egosgm.ros_images import BODY_FROM_OPTICAL, Cameras, depth_maps, grey_of, quaternion_of, ros_disparity, stamp_ns

SIDES = ("left", "right")
OUTPUTS = {"disparity": DisparityImage, "depth": Image, "variance": Image, "points2": PointCloud2}
OWN = {"device": "", "preset": "default", "max_skew_ms": 0.0, "queue_size": 4, "reliable": False, "auto_start": True, "odom_frame": "odom"}


class EgosgmNode(LifecycleNode):
    """Parameters: those of OWN, and every option of the pipeline by its name. They are read when the node is configured."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__("egosgm", **arguments)
        for name, value in {**OWN, **egosgm.pipeline_options()}.items():
            self.declare_parameter(name, value)
        self._worker: Optional[threading.Thread] = None
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(1.0, self._tell)
        self._clear()

    def _clear(self) -> None:
        self._infos: Dict[str, CameraInfo] = {}
        self._cameras: Optional[Cameras] = None
        self._pipeline: Optional[egosgm.Pipeline] = None
        self._odometry: Optional[egosgm.StereoOdometry] = None
        self._world_from_camera = np.eye(4)
        self._queue: Deque[Tuple[Any, Any]] = collections.deque()
        self._wake = threading.Condition()
        self._is_active = False
        self._count = self._lost = self._frames_told = 0
        self._problem = ""
        self._last_stamp: Optional[int] = None
        self._report: Optional[egosgm.FrameReport] = None
        self._latency_ms = 0.0
        self._told_at = time.monotonic()

    def _value(self, name: str) -> Any:
        return self.get_parameter(name).value

    def _options(self) -> Dict[str, Any]:
        """What differs from the preset's own values' defaults: a preset stays a preset where nobody changed an option."""
        defaults = egosgm.pipeline_options()
        changed = {name: self._value(name) for name, default in defaults.items() if self._value(name) != default and name != "preset"}
        return {"preset": self._value("preset"), **{name.replace(".", "__"): value for name, value in changed.items()}}

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        self._clear()
        try:
            egosgm.Pipeline(egosgm.Calibration(100, 100, 32, 32, 0.1), 64, 64, device=self._value("device"), **self._options())
        except (ValueError, RuntimeError) as error:
            self._problem = str(error)
            self.get_logger().error(self._problem)
            return TransitionCallbackReturn.FAILURE
        self._pairing = Pairing(int(self._value("max_skew_ms") * 1e6))
        qos = QoSProfile(depth=self._value("queue_size"), reliability=ReliabilityPolicy.RELIABLE) if self._value("reliable") else qos_profile_sensor_data
        self._outputs = {name: self.create_lifecycle_publisher(kind, name, qos) for name, kind in OUTPUTS.items()}
        self._outputs["odom"] = self.create_lifecycle_publisher(Odometry, "odom", self._value("queue_size"))
        self._inputs = []
        for index, side in enumerate(SIDES):
            self._inputs.append(self.create_subscription(CameraInfo, f"{side}/camera_info", lambda info, side=side: self._on_info(side, info), qos))
            self._inputs.append(self.create_subscription(Image, f"{side}/image_rect", lambda image, index=index: self._on_image(index, image), qos))
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        self._is_active = True
        self._worker = threading.Thread(target=self._work, daemon=True)
        self._worker.start()
        return super().on_activate(state)

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        self._stop()
        return super().on_deactivate(state)

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        for publisher in self._outputs.values():
            self.destroy_publisher(publisher)
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
        before = self._infos.get(side)
        if before is not None and ((before.p != info.p).any() or (before.width, before.height) != (info.width, info.height)):
            self._cameras = None  # another calibration: all that was made for the old one is dropped with the next frame
        self._infos[side] = info

    def _on_image(self, index: int, image: Image) -> None:
        if not self._is_active:
            return
        for (_, left), (_, right) in self._pairing.add(index, stamp_ns(image), image):
            with self._wake:
                self._queue.append((left, right))
                if len(self._queue) > self._value("queue_size"):
                    self._queue.popleft()
                    self._lost += 1
                self._wake.notify()

    def _work(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._queue or not self._is_active)
                if not self._is_active:
                    return
                left, right = self._queue.popleft()
            try:
                self._process(left, right)
                self._problem = ""
            except Exception as error:  # whatever a message held: the next one may be whole
                if str(error) != self._problem:
                    self.get_logger().error(str(error))
                self._problem = str(error)

    def _process(self, left: Image, right: Image) -> None:
        if len(self._infos) < 2:
            raise ValueError(f"no camera info yet on {' and '.join(f'{side}/camera_info' for side in SIDES if side not in self._infos)}")
        if self._cameras is None:
            self._cameras = Cameras(self._infos["left"], self._infos["right"], False)
            self._pipeline = egosgm.Pipeline(self._cameras.calibration, *self._cameras.size, device=self._value("device"), **self._options())
            self._odometry = egosgm.StereoOdometry(self._cameras.calibration)
            self._last_stamp = None
        images = grey_of(left), grey_of(right)
        for side, image in zip(SIDES, images):
            if image.shape != (self._cameras.size[1], self._cameras.size[0]):
                raise ValueError(f"{side}/image_rect: an image of {image.shape[1]}x{image.shape[0]} px, while the camera info is of "
                                 f"{self._cameras.size[0]}x{self._cameras.size[1]}")
        stamp = stamp_ns(left)
        if self._last_stamp is not None and stamp <= self._last_stamp:  # a bag that starts over
            self._pipeline.reset()
            self._odometry.reset()
        self._last_stamp = stamp
        found = self._odometry.process(*images)
        maps = self._pipeline.process(*images, found.motion)
        if found.motion:
            self._world_from_camera = self._world_from_camera @ np.linalg.inv(found.motion.current_from_previous)
        self._publish(left, images[0], maps)
        self._report, self._count = maps.report, self._count + 1
        self._latency_ms = self.get_clock().now().nanoseconds / 1e6 - stamp / 1e6

    def _publish(self, left: Image, grey: Any, maps: egosgm.Frame) -> None:
        calibration, header = self._cameras.calibration, left.header
        wanted = {name for name, publisher in self._outputs.items() if publisher.get_subscription_count() > 0}
        if "disparity" in wanted:
            message = DisparityImage(header=header, image=_image_of(header, ros_disparity(maps.disparity, calibration)), f=calibration.fx,
                                     t=calibration.baseline_m)
            message.valid_window.width, message.valid_window.height = left.width, left.height
            message.min_disparity = max(0.0, calibration.doffs_px)
            message.max_disparity = self._pipeline.options["disparities"] - 1 + calibration.doffs_px
            self._outputs["disparity"].publish(message)
        if wanted & {"depth", "variance", "points2"}:
            depth, variance = depth_maps(maps.disparity, maps.variance, calibration)
            if "depth" in wanted:
                self._outputs["depth"].publish(_image_of(header, depth))
            if "variance" in wanted:
                self._outputs["variance"].publish(_image_of(header, variance))
            if "points2" in wanted:
                self._outputs["points2"].publish(_points_of(header, depth, grey, calibration))
        if "odom" in wanted:
            self._outputs["odom"].publish(self._odometry_message(header))

    def _odometry_message(self, header: Any) -> Odometry:
        message = Odometry(child_frame_id="egosgm_camera")
        message.header.stamp, message.header.frame_id = header.stamp, self._value("odom_frame")
        pose = BODY_FROM_OPTICAL @ self._world_from_camera @ BODY_FROM_OPTICAL.T
        position, orientation = message.pose.pose.position, message.pose.pose.orientation
        position.x, position.y, position.z = (float(value) for value in pose[:3, 3])
        orientation.x, orientation.y, orientation.z, orientation.w = (float(value) for value in quaternion_of(pose[:3, :3]))
        return message

    def _tell(self) -> None:
        now = time.monotonic()
        rate = (self._count - self._frames_told) / max(1e-3, now - self._told_at)
        self._told_at, self._frames_told = now, self._count
        status = DiagnosticStatus(name=f"{self.get_fully_qualified_name()}: stereo", hardware_id="", level=DiagnosticStatus.OK, message="matching")
        gaps = self._pairing.gaps if hasattr(self, "_pairing") else None
        if self._problem:
            status.level, status.message = DiagnosticStatus.ERROR, self._problem
        elif rate == 0 and self._is_active:
            status.level = DiagnosticStatus.WARN
            status.message = "no pairs of images"
            if gaps and gaps.unpaired_left + gaps.unpaired_right > 0:
                status.message += f": the nearest stamps differ by {gaps.nearest_ms:.3f} ms, max_skew_ms is {self._value('max_skew_ms')}"
        elif not self._is_active:
            status.message = "not active"
        values = {"rate_hz": f"{rate:.2f}", "frames": str(self._count), "lost_in_queue": str(self._lost)}
        if gaps:
            values.update(unpaired_left=str(gaps.unpaired_left), unpaired_right=str(gaps.unpaired_right))
        if self._report:
            values.update(density=f"{self._report.density:.4f}", search_fraction=f"{self._report.search_fraction:.4f}",
                          vertical_offset_px=f"{self._report.vertical_offset_px:.3f}", latency_ms=f"{self._latency_ms:.1f}",
                          device=self._pipeline.device.name)
        status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def _image_of(header: Any, values: Any) -> Image:
    height, width = values.shape
    return Image(header=header, height=height, width=width, encoding="32FC1", is_bigendian=0, step=4 * width,
                 data=array.array("B", np.ascontiguousarray(values, np.float32).tobytes()))


def _points_of(header: Any, depth: Any, grey: Any, calibration: egosgm.Calibration) -> PointCloud2:
    """In rows and columns as the image, NaN where there is no depth."""
    height, width = depth.shape
    points = np.empty((height, width, 4), np.float32)
    points[..., 0] = (np.arange(width, dtype=np.float32) - np.float32(calibration.cx)) / np.float32(calibration.fx) * depth
    points[..., 1] = (np.arange(height, dtype=np.float32)[:, None] - np.float32(calibration.cy)) / np.float32(calibration.fy) * depth
    points[..., 2] = depth
    points[..., 3] = grey
    fields = [PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, name in enumerate(("x", "y", "z", "intensity"))]
    return PointCloud2(header=header, height=height, width=width, fields=fields, is_bigendian=False, point_step=16, row_step=16 * width,
                       data=array.array("B", points.tobytes()), is_dense=False)


def main() -> None:
    rclpy.init()
    node = EgosgmNode()
    if node._value("auto_start") and node.trigger_configure() == TransitionCallbackReturn.SUCCESS:
        node.trigger_activate()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    node._stop()
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
