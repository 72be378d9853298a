# SPDX-License-Identifier: Apache-2.0
"""Whose memory is whose: what a frame fills stays alive and is its own, whatever the caller does meanwhile."""
import gc
import random
import threading

import numpy as np
import pytest

import egosgm
from refusals import expect_refused

WIDTH, HEIGHT, FRAMES = 96, 48, 4
SEED = 3
OPTIONS = dict(disparities=32, paths=4)


@pytest.fixture
def pipeline(shared_pipeline):
    """As if it were new: nothing under way, no belief."""
    while shared_pipeline.under_way:
        shared_pipeline.collect()
    shared_pipeline.reset()
    return shared_pipeline


def empty(kind=np.float32):
    return np.zeros((HEIGHT, WIDTH), kind)


def test_a_dict_may_be_changed_as_soon_as_it_was_submitted(pipeline, street, frames):
    wanted = [pipeline.process(f.left, f.right, street.motion(i) if i else None).disparity for i, f in enumerate(frames[:2])]
    pipeline.reset()
    maps = {"disparity": empty()}
    pipeline.submit(frames[0].left, frames[0].right, None, maps)
    maps["disparity"] = empty()
    victims = [empty() for _ in range(4)]
    pipeline.submit(frames[1].left, frames[1].right, street.motion(1), maps)
    maps.clear()
    gc.collect()
    first, second = pipeline.collect(), pipeline.collect()
    assert first.disparity is not second.disparity
    np.testing.assert_array_equal(first.disparity, wanted[0])
    np.testing.assert_array_equal(second.disparity, wanted[1])
    assert not any(victim.any() for victim in victims)


def test_maps_that_share_memory_are_refused_and_change_nothing(pipeline, frames):
    left, right = frames[0].left, frames[0].right
    one = empty()
    expect_refused("variance shares memory", lambda: pipeline.process(left, right, None, {"disparity": one, "variance": one}))
    pipeline.submit(left, right, None, {"disparity": one})
    expect_refused("disparity shares memory.*collect it first", lambda: pipeline.submit(left, right, None, {"disparity": one[:]}))
    assert pipeline.under_way == 1
    assert pipeline.collect().disparity is one


def test_rows_that_overlap_are_copied_from_and_not_written_to(pipeline, frames):
    row = np.arange(WIDTH, dtype=np.uint8)
    broadcast = np.broadcast_to(row, (HEIGHT, WIDTH))
    assert broadcast.strides[0] == 0
    wanted = pipeline.process(broadcast.copy(), broadcast.copy()).disparity
    pipeline.reset()
    np.testing.assert_array_equal(pipeline.process(broadcast, broadcast).disparity, wanted)
    overlapping = np.lib.stride_tricks.as_strided(np.zeros(2 * WIDTH, np.float32), (HEIGHT, WIDTH), (4, 4))
    expect_refused("disparity", lambda: pipeline.process(frames[0].left, frames[0].right, None, {"disparity": overlapping}))


def test_arrays_that_are_not_aligned(pipeline, frames):
    images = [(f.astype(np.uint16) * 256) for f in (frames[0].left, frames[0].right)]
    wanted = pipeline.process(*images).disparity
    pipeline.reset()

    def shifted(array):
        memory = np.zeros(array.nbytes + 1, np.uint8)
        view = memory[1:].view(array.dtype).reshape(array.shape)
        view[:] = array
        assert not view.flags.aligned
        return view

    np.testing.assert_array_equal(pipeline.process(*map(shifted, images)).disparity, wanted)
    expect_refused("disparity", lambda: pipeline.process(*images, None, {"disparity": shifted(empty())}))


def test_numbers_of_any_type_set_options(street):
    for value in (150, 150.0, np.int64(150), np.uint8(150), np.float32(150)):
        pipeline = egosgm.Pipeline(street.calibration, WIDTH, HEIGHT, p2=value, disparities=np.int32(32))
        assert pipeline.options["p2"] == 150
    for value in (150.5, float("nan"), "many"):
        expect_refused("option p2", lambda: egosgm.Pipeline(street.calibration, WIDTH, HEIGHT, p2=value))
    egosgm.StereoOdometry(street.calibration, max_features=np.float64(500))
    expect_refused("max_features", lambda: egosgm.StereoOdometry(street.calibration, max_features=0.5))


def test_threads_that_share_an_odometry_take_turns(street, frames):
    odometry = egosgm.StereoOdometry(street.calibration)

    def work():
        for frame in frames * 3:
            odometry.process(frame.left, frame.right)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def test_a_pipeline_may_go_with_frames_under_way(street, frames):
    for _ in range(3):
        pipeline = egosgm.Pipeline(street.calibration, WIDTH, HEIGHT, **OPTIONS)
        for frame in frames[:2]:
            pipeline.submit(frame.left, frame.right, None, {"disparity": empty(), "variance": empty()})
        del pipeline
        gc.collect()


def test_random_submits_and_collects(pipeline, frames):
    """Dicts and arrays used again, changed and dropped, images overwritten, wrong arguments between: every map that is
    collected is that of its frame, and nothing else is written to."""
    source = random.Random(29)
    maps = {}
    under_way, collected = [], []
    bystanders = [np.full((HEIGHT, WIDTH), 7, np.float32) for _ in range(8)]

    def collect():
        collected.append((under_way.pop(0), pipeline.collect()))

    for _ in range(200):
        action = source.randrange(8)
        if action < 4 and pipeline.under_way < 2:
            index = source.randrange(FRAMES)
            left, right = frames[index].left.copy(), frames[index].right.copy()
            names = source.choice(["disparity", ("disparity", "variance"), maps])
            if names is maps:
                maps["disparity"] = empty()
                if source.randrange(2):
                    maps["variance"] = empty()
                else:
                    maps.pop("variance", None)
            pipeline.submit(left, right, None, names)
            under_way.append(index)
            left[:] = right[:] = 0
            if source.randrange(2):
                maps.clear()
        elif action < 6 and under_way:
            collect()
        elif action == 6:
            with pytest.raises((egosgm.InvalidArgument, TypeError)):
                pipeline.submit(source.choice([None, frames[0].left[:-1], frames[0].left.astype(np.float32)]), frames[0].right,
                                None, {"disparity": empty()})
            expect_refused("", lambda: pipeline.submit(frames[0].left, frames[0].right, None, {"disparity": empty()[:, ::2]}))
            assert pipeline.under_way == len(under_way)
        else:
            bystanders[source.randrange(len(bystanders))] = np.full((HEIGHT, WIDTH), 7, np.float32)
            gc.collect(0)
    while under_way:
        collect()
    expect_refused("", pipeline.collect)
    pipeline.reset()
    for index, result in collected:
        wanted = pipeline.process(frames[index].left, frames[index].right)
        np.testing.assert_array_equal(result.disparity, wanted.disparity)
        if result.variance is not None:
            np.testing.assert_array_equal(result.variance, wanted.variance)
    assert all((each == 7).all() for each in bystanders)


def test_constants_of_the_method_are_set_by_name(street):
    pipeline = egosgm.Pipeline(street.calibration, WIDTH, HEIGHT, constants={"coarse_match.p1": 7}, **OPTIONS)
    assert pipeline.options["constants.coarse_match.p1"] == 7
    expect_refused("no constant", lambda: egosgm.Pipeline(street.calibration, WIDTH, HEIGHT, constants={"coarse_match.p9": 7}))
