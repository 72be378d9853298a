# SPDX-License-Identifier: Apache-2.0
"""Frames to Rerun. Needs rerun-sdk."""
import re
import subprocess
import sys

import numpy as np
import pytest

import egosgm
try:
    import rerun  # noqa: F401
except ImportError as error:  # also one of its own packages that does not load; importorskip takes exc_type since pytest 8.2
    pytest.skip(str(error), allow_module_level=True)
from egosgm.viewer import RerunOutput
from refusals import expect_refused

WIDTH, HEIGHT, FRAMES, SEED = 320, 96, 3, 7
OPTIONS = dict(disparities=48, paths=4)


def test_a_recording_holds_what_came(street, frames, tmp_path):
    file = tmp_path / "street.rrd"
    output = RerunOutput(file)
    drive = egosgm.run([(frame.left, frame.right) for frame in frames], street.calibration, outputs=("disparity", "variance", "reason"), **OPTIONS)
    moved = np.eye(4)
    for frame in drive:
        output.add(frame, frame.maps, frame.motion, frame.calibration)
        moved = moved @ np.linalg.inv(frame.motion.current_from_previous) if frame.motion else moved
    output.finish()
    assert moved[2, 3] > 0.5
    rerun = [sys.executable, "-m", "rerun", "rrd"]
    assert subprocess.run([*rerun, "verify", file], capture_output=True).returncode == 0
    printed = subprocess.run([*rerun, "print", file], capture_output=True, text=True, check=True).stdout
    for name in ("/camera/image/left", "/camera/image/depth", "/camera/image/reason", "/maps/variance", "/figures/density"):
        rows = sum(int(line.split(" with ")[1].split(" ")[0]) for line in printed.splitlines() if line.startswith("Chunk(") and f" - {name} - " in line
                   and "AnnotationContext" not in line)
        assert rows == FRAMES, name
    values = subprocess.run([*rerun, "print", "-vvv", file], capture_output=True, text=True, check=True).stdout
    places = re.findall(r"┆ \[\[([-\d.e]+), ([-\d.e]+), ([-\d.e]+)\]\] +│", values)  # the last column of the camera's
    np.testing.assert_allclose([float(value) for value in places[-1]], moved[:3, 3], atol=1e-4)
    expect_refused("is there already", lambda: RerunOutput(file))
    expect_refused("no such folder", lambda: RerunOutput(tmp_path / "missing/street.rrd"))
    given_up = RerunOutput(tmp_path / "given_up.rrd")
    given_up.give_up()
    assert not (tmp_path / "given_up.rrd").exists()


def test_what_moves_is_boxed_and_led_by_arrows(tmp_path):
    traffic = egosgm.SyntheticSequence(width=480, height=180, frames=3, seed=3, moving_object=True, supersampling=1)
    file = tmp_path / "traffic.rrd"
    output, moving = RerunOutput(file), []
    for frame in egosgm.run([(pair.left, pair.right) for pair in map(traffic.render, range(3))], traffic.calibration, objects=True, disparities=64, paths=4):
        output.add(frame, frame.maps, frame.motion, frame.calibration)
        moving.append(frame.objects.moving)
    output.finish()
    assert not moving[0] and moving[2]
    printed = subprocess.run([sys.executable, "-m", "rerun", "rrd", "print", "-vvv", file], capture_output=True, text=True, check=True).stdout
    for name in ("/camera/image/objects", "/camera/objects"):
        assert sum(int(line.split(" with ")[1].split(" ")[0]) for line in printed.splitlines() if line.startswith("Chunk(") and f" - {name} - " in line) == 3
    assert f"{moving[2][0].id}: {np.linalg.norm(moving[2][0].velocity_m):.2f} m a frame" in printed


def test_without_the_package_it_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    expect_refused("pip install rerun-sdk", RerunOutput)
