"""The benchmark's scenes are as heavy as their table says."""

import pytest

from benchmarks.scenes import KINDS, camera, surfels
from tests.raster.scenes import Scene
from texgs.raster import rasterize

MEASURED = {"light": 21.8, "opaque": 38.6, "heavy": 62.2, "transl": 32.4, "translheavy": 109.6}


@pytest.mark.parametrize("kind", KINDS)
def test_fragments_per_pixel(kind):
    view = camera(400)
    scene = Scene(**surfels(kind), viewmat=view.viewmat, K=view.K, width=400, height=400)
    render = scene.render(rasterize, ("statistics",))
    covered = (render.alpha > 0).sum()
    assert float(render.statistics.pixels.sum() / covered) == pytest.approx(MEASURED[kind], rel=0.1)
    assert float(covered / 400**2) == pytest.approx(0.5, abs=0.06)
