"""The benchmark's scenes are as heavy as their table says."""

import pytest
import torch

from benchmarks.scenes import KINDS, camera, surfels
from tests.raster.load import fragments_per_pixel

MEASURED = {"light": 21.8, "opaque": 38.6, "heavy": 62.2, "transl": 32.4, "translheavy": 109.6}


@pytest.mark.parametrize("kind", KINDS)
def test_fragments_per_pixel(kind):
    fragments, covered = fragments_per_pixel(surfels(kind), camera(400), stride=3)
    assert fragments == pytest.approx(MEASURED[kind], rel=0.1)  # a ninth of the tiles
    assert covered == pytest.approx(0.5, abs=0.06)


def test_scenes_are_reproducible_and_of_any_size():
    first, second = surfels("opaque", n=1001, seed=3), surfels("opaque", n=1001, seed=3)
    for name, tensor in first.items():
        assert len(tensor) == 1001
        assert torch.equal(tensor, second[name])
    assert {len(tensor) for tensor in surfels("light", n=0).values()} == {0}
