# SPDX-License-Identifier: Apache-2.0
"""A street, its frames and a pipeline for each file of tests, by the file's own WIDTH, HEIGHT, FRAMES, SEED and OPTIONS."""
import egosgm
import pytest


@pytest.fixture(scope="module")
def street(request):
    file = request.module
    return egosgm.SyntheticSequence(frames=file.FRAMES, width=file.WIDTH, height=file.HEIGHT, seed=file.SEED)


@pytest.fixture(scope="module")
def frames(request, street):
    return [street.render(i) for i in range(request.module.FRAMES)]


@pytest.fixture(scope="module")
def shared_pipeline(request, street):
    return egosgm.Pipeline(street.calibration, request.module.WIDTH, request.module.HEIGHT, **request.module.OPTIONS)
