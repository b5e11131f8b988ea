"""Lattices of signed distances, fused from views of depth, against brute force."""

from operator import attrgetter

import numpy as np
import torch

from tests.raster.requirements import require_same_bits
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError, DeviceError, ShapeError
from texgs.raster.fusion import BLOCK, DepthView, Lattice

LOW, VOXEL, BLOCKS, TRUNCATION = torch.tensor([-0.4, -0.3, -0.5]), 0.03, (3, 2, 4), 0.15
CHOSEN = torch.tensor([[0, 0, 0], [2, 1, 3], [1, 0, 2], [1, 1, 1]])


def views(count):
    """Random depth around the origin, with holes, from cameras all around."""
    random = torch.Generator().manual_seed(3)
    for index in range(count):
        camera = orbit(70.0 * index, 15.0 * index - 40, 2.0, 30.0, 24, 20)
        depth = 1.6 + 0.8 * torch.rand(20, 24, generator=random)
        depth[torch.rand(20, 24, generator=random) < 0.2] = 0
        yield DepthView(camera, depth, torch.randint(256, (20, 24, 3), generator=random, dtype=torch.uint8))


def brute_force(several, chosen):
    """The same in float64, voxel by voxel, as sums."""
    shape = [BLOCK * n for n in reversed(BLOCKS)]
    distance, count, color = np.zeros(shape), np.zeros(shape), np.zeros((*shape, 3))
    for view in several:
        viewmat, K = view.camera.viewmat.double().numpy(), view.camera.K.double().numpy()
        for block in chosen.tolist():
            for inside in np.ndindex(BLOCK, BLOCK, BLOCK):
                index = BLOCK * np.array(block) + inside
                seen = viewmat[:3, :3] @ (LOW.double().numpy() + VOXEL * index) + viewmat[:3, 3]
                u, v = np.floor((K @ seen)[:2] / seen[2]).astype(int)
                if not (seen[2] > 0 and 0 <= u < 24 and 0 <= v < 20):
                    continue
                away = (view.depth[v, u].item() - seen[2]) / TRUNCATION
                if view.depth[v, u] > 0 and away > -1:
                    at = tuple(index[::-1])
                    count[at] += 1
                    distance[at] += min(away, 1)
                    color[at] += view.color[v, u].numpy()
    return np.where(count > 0, distance / count.clip(1), 1), count, color / count.clip(1)[..., None]


def fused(several, chosen):
    lattice = Lattice(BLOCKS, LOW, VOXEL)
    for view in several:
        lattice.add(view, chosen, TRUNCATION)
    return lattice


def test_means_over_views():
    several = list(views(5))
    lattice, (distance, count, color) = fused(several, CHOSEN), brute_force(several, CHOSEN)
    # A voxel on the border of two pixels, or of what is known, may fall to either side.
    same = lattice.views.numpy() == count
    assert same.mean() > 0.999
    assert 500 < (count > 0).sum() < 4 * BLOCK**3, "there are voxels that no view has seen"
    np.testing.assert_allclose(lattice.distance.numpy()[same], distance[same], atol=1e-4)
    np.testing.assert_allclose(lattice.color.numpy()[same], color[same], atol=1e-3)


def test_threads_change_nothing():
    several = list(views(3))
    require_same_bits(lambda: attrgetter("distance", "views", "color")(fused(several, CHOSEN)), threads=(3,))


def test_what_does_not_fit_is_refused():
    (view,) = views(1)
    lattice, (camera, depth, color) = Lattice(BLOCKS, LOW, VOXEL), (view.camera, view.depth, view.color)
    for error, blocks in (
        (ArgumentError, torch.tensor([[0, 2, 0]])),
        (ShapeError, torch.tensor([0, 0, 0])),
        (ArgumentError, CHOSEN[[1, 0, 1]]),
        (ArgumentError, CHOSEN.float()),
    ):
        refused(lambda blocks=blocks: lattice.add(view, blocks, TRUNCATION), "blocks: ", error)
    refused(lambda: lattice.add(view, CHOSEN, 0.0), "truncation: ")
    refused(lambda: DepthView(camera, depth, color.transpose(0, 1)), "color: ", ShapeError)
    refused(lambda: DepthView(camera, depth, color.float()), "color: ")
    refused(lambda: DepthView(camera, depth.to("meta"), color), "depth: ", DeviceError)
    refused(lambda: DepthView(camera.to("meta"), depth, color), "viewmat: ", DeviceError)
