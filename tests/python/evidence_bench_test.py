# SPDX-License-Identifier: Apache-2.0
"""What bench/accuracy --evidence counts."""
import pathlib
import sys

import numpy as np
import pytest

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[2] / "bench/accuracy")]
import evidence  # noqa: E402


def test_ratios_and_their_median():
    rows = [["a", "ours", 6.0], ["a", "single", 2.0], ["b", "ours", 1.0], ["b", "single", 2.0], ["c", "ours", 4.0], ["c", "single", 4.0],
            ["d", "ours", None], ["d", "single", 3.0], ["e", "skipped: not there"], ["f", "ours", 2.0], ["f", "single", 0.0]]
    found = evidence.ratios_of(rows, "ours", "single", 2)
    assert found["headings"] == ["video", "ours", "single", "ratio"]
    assert found["rows"] == [["a", 6, 2, 3], ["b", 1, 2, 0.5], ["c", 4, 4, 1], ["median of the ratios", None, None, 1]]
    assert evidence.ratios_of(rows[6:9], "ours", "single", 2)["rows"] == []


def test_a_pole_is_found_within_two_pixels():
    disparity, truth = np.float32([[10, 12, 12.1, -32768, 30]]), np.float32([[10, 10, 10, 10, 10]])
    assert evidence.share_found(np, disparity, truth, np.array([[1, 1, 1, 1, 0]], bool)) == pytest.approx(50)
    assert evidence.share_found(np, disparity, truth, np.zeros((1, 5), bool)) is None
