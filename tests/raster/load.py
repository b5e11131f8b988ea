"""How much work a scene is: fragments per pixel, counted by the definition on a sample of tiles."""

import torch

from texgs.raster.reference.render import composite
from texgs.raster.reference.surfels import intersect, project, visible_radii
from texgs.raster.types import DEFAULT_OPTIONS

TILE = 16


def fragments_per_pixel(surfels, camera, stride=1):
    """Blended fragments per covered pixel, and the share of covered pixels.

    Every `stride`-th tile along either axis is looked at, so an odd stride larger than 1 gives an estimate.
    """
    inputs = (surfels[name].double() for name in ("means", "quats", "scales", "opacities"))
    size = (camera.width, camera.height)
    projected = project(*inputs, camera.viewmat.double(), camera.K.double(), None, size, DEFAULT_OPTIONS)
    reach = visible_radii(projected, size, DEFAULT_OPTIONS)[:, None] + TILE / 2
    grid = torch.cartesian_prod(torch.arange(TILE), torch.arange(TILE)).double() + 0.5
    blended, covered, pixels = 0, 0, 0
    for y in range(0, camera.height, stride * TILE):
        for x in range(0, camera.width, stride * TILE):
            middle = torch.tensor([x, y]) + TILE / 2
            near = ((projected.centre - middle).abs() <= reach).all(1)
            tile = type(projected)(**{name: value[near] for name, value in vars(projected).items()})
            fragments = intersect(tile, grid + torch.tensor([x, y]), DEFAULT_OPTIONS)
            weights, _ = composite(fragments.alpha, DEFAULT_OPTIONS.transmittance_min)
            hits = (weights > 0).sum(1)
            blended, covered, pixels = (
                blended + int(hits.sum()),
                covered + int((hits > 0).sum()),
                pixels + len(hits),
            )
    return blended / max(covered, 1), covered / pixels
