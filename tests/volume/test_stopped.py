"""Casts and renders that another thread stops."""

from concurrent.futures import ThreadPoolExecutor
from ctypes import c_int32
from threading import Timer
from time import process_time

import numpy as np
import pytest
import torch

from benchmarks.scenes import surfels
from tests.volume.scenes import SHELLS, ball
from texgs.core.camera import orbit
from texgs.core.errors import Stopped
from texgs.core.light import HEADLIGHT
from texgs.raster.api import rasterize
from texgs.raster.native import stopped_by
from texgs.volume.caster import Caster
from texgs.volume.render import Appearance

CAMERA = orbit(-60, 20, 2, 34, 96, 64)
LARGE = orbit(-60, 20, 2, 34, 768, 768)


@pytest.fixture(params=[1, 2], ids=["one thread", "two threads"])
def threads(request):
    before = torch.get_num_threads()
    torch.set_num_threads(request.param)
    yield
    torch.set_num_threads(before)


def shown(caster, camera=CAMERA):
    return caster.render(SHELLS, camera, HEADLIGHT)


def test_what_is_stopped_before_raises_and_leaves_nothing_behind(threads):
    expected, caster = shown(Caster(ball(), Appearance())), Caster(ball(), Appearance())
    for _ in range(2):  # while its function is prepared, and while it casts
        with stopped_by(c_int32(1)), pytest.raises(Stopped, match="stopped by its caller"):
            shown(caster)
        np.testing.assert_array_equal(shown(caster), expected)
    with stopped_by(c_int32(0)):
        np.testing.assert_array_equal(shown(caster), expected)


def test_a_cast_stops_soon_after_another_thread_says_so(threads):
    flag, caster = c_int32(), Caster(ball(), Appearance(step=0.02))
    shown(caster)  # has prepared the function
    start = process_time()
    shown(caster, LARGE)
    whole, start = process_time() - start, process_time()
    Timer(0.02, lambda: setattr(flag, "value", 1)).start()
    with stopped_by(flag), pytest.raises(Stopped):
        shown(caster, LARGE)
    assert process_time() - start < 0.5 * whole


def test_a_flag_is_of_one_thread():
    caster = Caster(ball(), Appearance())
    expected = shown(caster)
    with stopped_by(c_int32(1)), ThreadPoolExecutor(1) as other:
        np.testing.assert_array_equal(other.submit(shown, caster).result(), expected)


def test_surfels_stop_as_well(threads):
    scene = surfels("transl", 500)
    view = {"viewmat": CAMERA.viewmat, "K": CAMERA.K, "width": CAMERA.width, "height": CAMERA.height}
    expected = rasterize(**scene, **view).color
    with stopped_by(c_int32(1)), pytest.raises(Stopped):
        rasterize(**scene, **view)
    assert torch.equal(rasterize(**scene, **view).color, expected)
