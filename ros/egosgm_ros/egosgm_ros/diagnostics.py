# SPDX-License-Identifier: Apache-2.0
"""What the node tells: its state and its losses each second on /diagnostics, and warnings, each at most once a minute."""
import time
from typing import Any, Dict, Optional

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

import egosgm
from egosgm_ros.parameters import ParameterNode
from egosgm_ros.process import VARIABLE, PROFILES

SIDES = ("left", "right")
LOST_ON_THE_WAY = (f"images lost on the way: the driver's shared memory does not hold them: start the driver with {VARIABLE}={PROFILES}; "
                   "where that is not enough, reliable:=true with a driver that is reliable")
REPLACED = "pairs replaced by newer ones: more come than are matched in time"


class TellingNode(ParameterNode):
    """A node that tells on /diagnostics whether it matches, what is lost, and what speaks against its input."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(1.0, self._tell)

    def _clear_told(self) -> None:
        self._count = self._replaced = self._lost_on_the_way = self._frames_told = 0
        self._lost_told = [0, 0]
        self._problem = self._warning = self._topics_warning = ""
        self._report: Optional[egosgm.FrameReport] = None
        self._latency_ms = 0.0
        self._suspicion, self._suspicion_told = "", False
        self._told_at = time.monotonic()
        self._warned_at: Dict[str, float] = {}
        self._waits_since = self._told_at  # for a pair

    def _look_at_input(self, images: Any, report: egosgm.FrameReport) -> None:
        """What is nearer or farther than the range, and what else speaks against the images or their calibration."""
        options = self._pipeline.options
        check = egosgm._egosgm._InputCheck(self._cameras.calibration, options["min_disparity"], options["disparities"])
        check.add(*images, report, True)
        self._suspicion = check.text().replace("--disparities ", "disparities:=").replace("--min-disparity ", "min_disparity:=")
        if self._suspicion and not self._suspicion_told:
            self.get_logger().warning(self._suspicion)
            self._suspicion_told = True

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
