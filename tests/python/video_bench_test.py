# SPDX-License-Identifier: Apache-2.0
"""What bench/accuracy --video compares with: averages in time, and wrong motions. What its tables hold where a row fails."""
import pathlib
import re
import sys
import types

import numpy as np
import pytest

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[2] / "bench" / folder) for folder in ("accuracy", "")]
import ablation  # noqa: E402
import inputs  # noqa: E402
import tables  # noqa: E402
import video  # noqa: E402
import video_figures as figures  # noqa: E402

NO = figures.egosgm.INVALID_DISPARITY


def test_an_average_keeps_what_jumps_and_what_is_behind_a_hole():
    before, now = np.float32([[10, 10, 10, NO, NO]]), np.float32([[10.5, 11, NO, 7, NO]])
    np.testing.assert_allclose(video.averaged(figures, before, now, False, 20 / 32), [[10.2, 11, 10, 7, NO]], rtol=1e-6)
    np.testing.assert_allclose(video.averaged(figures, before, now, True, 20), [[10.2, 10.4, NO, 7, NO]], rtol=1e-6)


@pytest.mark.parametrize("degrees, metres", [(0, 0), (1, 0), (0, 0.1), (0.5, 0.02)])
def test_every_motion_is_off_by_so_much(degrees, metres):
    poses = np.stack([np.eye(4)] * 4)
    poses[:, 2, 3] = 0, 1, 3, 4
    wrong = video.disturbed(np, poses, degrees, metres)
    for k in range(1, len(poses)):
        true_motion, motion = (np.linalg.inv(p[k]) @ p[k - 1] for p in (poses, wrong))
        off = motion @ np.linalg.inv(true_motion)
        assert np.degrees(np.arccos(np.clip((np.trace(off[:3, :3]) - 1) / 2, -1, 1))) == pytest.approx(degrees, abs=1e-5)
        assert np.linalg.norm(off[:3, 3]) == pytest.approx(metres, abs=1e-12)
        np.testing.assert_allclose(off[:3, :3] @ off[:3, :3].T, np.eye(3), atol=1e-12)


def test_maps_of_an_earlier_build_are_no_figures_of_this_one(tmp_path):
    left = tmp_path / "video/street/EgoSGM"
    left.mkdir(parents=True)
    video.video_tables(types.SimpleNamespace(work=tmp_path, data=tmp_path), re.compile("no video"))
    assert not left.exists()


def fail(*_):
    raise KeyError("depth")


def refuse():
    raise inputs.Failed("egosgm synth: no room")


def test_a_row_that_raises_says_so_and_the_others_are_written(monkeypatch):
    monkeypatch.setattr(video, "Maps", lambda bench, opened: opened)
    monkeypatch.setattr(video, "videos_of", lambda bench: {"rendered a": lambda: "a", "rendered b": refuse, "street, seed 1": lambda: "c", "no curve": fail})
    rows = video.curve(None, re.compile(""), {"whole": 1.0, "broken": None, "no row": 0}, lambda bench, maps, step: [maps, "whole", 1 / step] if step != 0 else None)
    broken = "broken: failed: TypeError: unsupported operand type(s) for /: 'int' and 'NoneType'"
    assert rows == [["a", "whole", 1], ["rendered a", broken], ["rendered b", "failed: egosgm synth: no room"], ["c", "whole", 1], ["street, seed 1", broken]]


def test_a_group_of_limits_that_raises_says_so():
    table = tables.Table()
    table.fill("street", fail)
    assert table.rows == [{"input": "street", "figure": "failed: KeyError: 'depth'", "passed": False}]
    assert table.exit_code() == 1


def test_an_ablation_keeps_what_was_measured_of_other_kinds(monkeypatch):
    cases = [ablation.Case(kind, kind, None, [], []) for kind in ("KITTI", "streets", "never")]

    def counts(figures, case, options):
        if (case.kind == "never" and not options) or (case.kind == "streets" and options.get("paths") == 8):
            fail()
        return np.array([[100, 100], [80, 90], [options.get("paths", 4), 4], [10, 10], [10, 10]])
    monkeypatch.setattr(ablation, "cases", lambda bench, pattern: (cases, []))
    monkeypatch.setattr(ablation, "counts_by_block", counts)
    monkeypatch.setattr(ablation, "ABLATION", [("default", {}, ""), ("eight paths", {"paths": 8}, ""), ("no gate", {"gate_px": 0}, "")])
    egosgm = types.SimpleNamespace(devices=lambda: [types.SimpleNamespace(name="a", driver="b")])
    rows, skipped = ablation.ablation(types.SimpleNamespace(video_figures=lambda: types.SimpleNamespace(np=np, egosgm=egosgm)), "")
    assert [[list(row["kinds"][kind])[0] for kind in ("KITTI", "streets", "never")] for row in rows] == [
        ["bad_or_missing", "bad_or_missing", "skipped"], ["bad_or_missing", "skipped", "skipped"], ["bad_or_missing", "bad_or_missing", "skipped"]]
    assert rows[1]["kinds"]["KITTI"]["bad_of_valid"]["above"] == pytest.approx(100 * 4 / 170)
    assert skipped[:2] == ["default, never: failed: KeyError: 'depth'", "eight paths, streets: failed: KeyError: 'depth'"]
    assert rows[2]["kinds"]["never"]["skipped"] == "failed: the default, which all others are compared with"
