# SPDX-License-Identifier: Apache-2.0
"""Pairs the left and right images of a recording by their stamps, and tells what is unusual about these."""
import bisect
import collections
import dataclasses
import math
from typing import Any, Deque, Iterator, List, Optional, Tuple

import numpy as np

from ..arguments import counted

_MOST_INTERVALS = 1000  # the last ones, of both cameras
_Image = Tuple[int, Any]  # its stamp and its message


@dataclasses.dataclass
class Gaps:
    """What is unusual about the times of a drive."""

    unpaired_left: int = 0
    unpaired_right: int = 0
    nearest_ms: Optional[float] = None
    nearest_unpaired_ms: float = math.inf
    steps_back: int = 0
    repeated: int = 0
    without_pose: int = 0
    has_no_stamps: bool = False
    gaps: List[Tuple[int, float]] = dataclasses.field(default_factory=list)
    largest_skew_ms: float = 0.0
    intervals_ms: Deque[float] = dataclasses.field(default_factory=lambda: collections.deque(maxlen=_MOST_INTERVALS))
    broken: List[str] = dataclasses.field(default_factory=list)
    parts: List[str] = dataclasses.field(default_factory=list)

    @property
    def interval_ms(self) -> float:
        """The usual one, as two images may come at once after a stall."""
        return float(np.median(self.intervals_ms)) if self.intervals_ms else math.inf

    def are_other_moments(self, apart_ms: float) -> bool:
        """From about half the time between two frames on, stamps are of other moments, whatever is allowed."""
        return apart_ms >= 0.35 * self.interval_ms

    def text(self) -> str:
        parts = list(self.parts)
        if self.broken:
            parts.append(f"{counted(len(self.broken), 'broken message')}, whose pairs are left out: {self.broken[0]}")
        if self.has_no_stamps:
            parts.append("the images have no stamps: the times at which they were recorded are taken")
        if self.unpaired_left or self.unpaired_right:
            parts.append(f"{self.unpaired_left} left and {self.unpaired_right} right images have no partner")
        if self.unpaired_left and self.unpaired_right and self.are_other_moments(self.nearest_unpaired_ms) and self.nearest_unpaired_ms < math.inf:
            parts[-1] += f": the nearest of them differ by {ms_text(self.nearest_unpaired_ms)} at {ms_text(self.interval_ms)} a frame: they are of other moments"
        elif self.unpaired_left and self.unpaired_right and self.nearest_unpaired_ms < math.inf:
            parts[-1] += f": the nearest of them differ by {ms_text(self.nearest_unpaired_ms)}, which --max-skew-ms can allow"
        if self.largest_skew_ms:
            parts.append(f"stamps of a pair differ by up to {self.largest_skew_ms:.3f} ms")
            if self.are_other_moments(self.largest_skew_ms):
                parts[-1] += f" at {ms_text(self.interval_ms)} a frame: those are of other moments; give a smaller --max-skew-ms, and cameras that are triggered together"
        if self.gaps:
            at, longest = max(self.gaps, key=lambda gap: gap[1])
            parts.append(f"{counted(len(self.gaps), 'gap')}, the longest of {longest:.3f} s before frame {at}")
        if self.repeated:
            parts.append(f"{counted(self.repeated, 'pair')} with the stamp of the one before, left out")
        if self.without_pose:
            parts.append(f"{counted(self.without_pose, 'frame')} outside of the poses' times, or in a gap of half a second: odometry finds the motion there")
        if self.steps_back:
            parts.append(f"time steps back {counted(self.steps_back, 'time')}, where the method starts anew")
        return "; ".join(parts)


class Pairing:
    """Left and right by their stamps, each with the nearest one, no further than `bound_ns` away. Of a side whose partner is silent
    the last MOST_WAITING stay."""

    MOST_WAITING = 64

    def __init__(self, bound_ns: int) -> None:
        self.bound_ns = bound_ns
        self.gaps = Gaps()
        self._waiting: Tuple[Deque[_Image], Deque[_Image]] = (collections.deque(), collections.deque())
        self._last: List[Optional[int]] = [None, None]

    def add(self, side: int, stamp: int, message: Any) -> Iterator[Tuple[_Image, _Image]]:
        waiting = self._waiting[side]
        last = self._last[side]
        if last is not None and stamp > last:
            self.gaps.intervals_ms.append((stamp - last) / 1e6)
        self._last[side] = stamp
        if waiting and stamp < waiting[-1][0]:  # a recording that starts over
            yield from self.end()
        waiting.append((stamp, message))
        if len(waiting) > self.MOST_WAITING:
            self._drop(side)
        yield from self._pairs(False)

    def end(self) -> Iterator[Tuple[_Image, _Image]]:
        yield from self._pairs(True)
        for side in (0, 1):
            while self._waiting[side]:
                self._drop(side)

    def _drop(self, side: int) -> None:
        self._waiting[side].popleft()
        if side:
            self.gaps.unpaired_right += 1
        else:
            self.gaps.unpaired_left += 1

    def _pairs(self, is_end: bool) -> Iterator[Tuple[_Image, _Image]]:
        left, right = self._waiting
        while left and right:
            apart = abs(left[0][0] - right[0][0])
            self.gaps.nearest_ms = min(apart / 1e6, self.gaps.nearest_ms if self.gaps.nearest_ms is not None else np.inf)
            earlier = 0 if left[0][0] < right[0][0] else 1
            if apart > self.bound_ns:
                self.gaps.nearest_unpaired_ms = min(apart / 1e6, self.gaps.nearest_unpaired_ms)
                self._drop(earlier)
                continue
            if apart:  # the next one of the earlier side may be nearer
                later = self._waiting[1 - earlier][0][0]
                if len(self._waiting[earlier]) < 2 and not is_end:
                    return
                if len(self._waiting[earlier]) > 1 and abs(self._waiting[earlier][1][0] - later) < apart:
                    self._drop(earlier)
                    continue
            self.gaps.largest_skew_ms = max(self.gaps.largest_skew_ms, apart / 1e6)
            yield left.popleft(), right.popleft()


def ms_text(duration: float) -> str:
    """Rounded up: what is told, given as a bound, is enough."""
    return f"{math.ceil(round(duration * 1000, 6)) / 1000:.3f} ms"


def in_order(messages: Iterator[Tuple[int, int, Any]]) -> Iterator[Tuple[int, int, Any]]:
    """By their stamps, where threads recorded neighbours the wrong way round; a recording that starts over by a second and more stays."""
    held: List[Tuple[int, int, int, Any]] = []
    for count, (stamp, side, message) in enumerate(messages):
        if held and stamp < held[-1][0] - 1_000_000_000:
            yield from ((stamp, side, message) for stamp, _, side, message in held)
            held = []
        bisect.insort(held, (stamp, count, side, message))
        if len(held) > 8:
            stamp, _, side, message = held.pop(0)
            yield stamp, side, message
    yield from ((stamp, side, message) for stamp, _, side, message in held)
