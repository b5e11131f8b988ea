"""Light through a volume by rays of their own, in float64: what `texgs.volume.matter` approximates on a grid.

Single scattering: exp2(-extinction along the ray to a distant light) of it reaches a point. Extinctions are
those of the trilinear volume with its transfer functions, sampled more finely than its cells.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil, inf

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import normalize

from tests.volume.march import Exposure, inside, sample
from texgs.core.camera import orbit_direction
from texgs.core.cuts import NO_CUTS, Cuts
from texgs.core.light import Light
from texgs.volume.grid import Grid
from texgs.volume.transfer import TransferFunction

PLACES_AT_ONCE = 2_000_000  # bounds memory
LEAST_LIGHT = 1e-300  # of a unit of length; its logarithm is finite


@dataclass(frozen=True)
class LightRays:
    """What hides light: functions of a volume, each of its own channel, where no cut takes matter away.

    Places along rays are `spacing` apart, in voxels of the finest axis.
    """

    grid: Grid
    tfs: Sequence[TransferFunction]
    opacity_unit: float  # world units
    cuts: Cuts = NO_CUTS
    spacing: float = 0.25

    @property
    def half(self) -> Tensor:
        """Return half the sides of the box [3], world units."""
        return torch.tensor(self.grid.aabb[1], dtype=torch.float64)

    @cached_property
    def _values(self) -> list[Tensor]:
        """Return the samples [Z, Y, X] of each function's channel, float64."""
        return [torch.from_numpy(self.grid.channel(tf.channel).values.astype(np.float64)) for tf in self.tfs]

    def extinctions(self, points: Tensor) -> Tensor:
        """Return the logarithm to base 2, negated, of what a world unit lets through, at points [..., 3]."""
        total = torch.zeros(points.shape[:-1], dtype=torch.float64)
        for tf, values in zip(self.tfs, self._values, strict=True):
            opacity = torch.from_numpy(tf(sample(values, points / self.half))[..., 3])
            opacity[~inside(self.grid, tf, points / self.half)] = 0
            total -= (1 - opacity).clamp_min(LEAST_LIGHT).log2() / self.opacity_unit
        for plane in self.cuts.half_spaces:
            total[points @ points.new_tensor(plane.normal) > plane.offset] = 0
        return total

    def transmittance(self, points: Tensor, to_light: Tensor, reach: float = inf) -> Tensor:
        """Return which share [n] of a light in a direction [3] reaches points [n, 3].

        Only what is within reach hides it; world units, also outside of the box.
        """
        points, along = points.double(), normalize(to_light.double(), dim=0)
        along = torch.where(along.abs() < 1e-12, 1e-12, along)
        sides = torch.stack([(-self.half - points) / along, (self.half - points) / along])  # [2, n, 3]
        begin = sides.amin(dim=0).amax(dim=1).clamp_min(0)
        length = (sides.amax(dim=0).amin(dim=1).clamp_max(reach) - begin).clamp_min(0)
        voxel = float((2 * self.half / (torch.tensor(self.grid.dims) - 1)).min())
        count = ceil(float(length.max()) / (self.spacing * voxel)) + 1 if len(points) else 1
        parts = (torch.arange(count) + 0.5) / count  # of each ray, from its begin
        depth = torch.zeros_like(length)
        for some in torch.arange(len(points)).split(max(1, PLACES_AT_ONCE // count)):
            way = begin[some, None] + parts * length[some, None]
            places = points[some, None] + way[..., None] * along
            depth[some] = self.extinctions(places).mean(dim=1) * length[some]
        return torch.exp2(-depth)

    def openness(self, points: Tensor, directions: Tensor, reach: float) -> Tensor:
        """Return twice the mean share [n] of lights from unit directions [m, 3], at most 1."""
        shares = [self.transmittance(points, each, reach) for each in directions]
        return (2 * torch.stack(shares).mean(dim=0)).clamp_max(1)

    def exposure(self, light: Light, directions: Tensor, outset: float) -> Exposure:
        """Return what shadows and occlusion leave at places `outset` world units along normals."""

        def factors(points: Tensor, normals: Tensor) -> Tensor:
            places, left = points.double() + outset * normals.double(), torch.ones(len(points), 2)
            if light.shadows and light.kind == "directional":
                lamp = self.transmittance(places, orbit_direction(light.azimuth, light.polar))
                left[:, 0] = 1 - light.shadows * (1 - lamp)
            if light.occlusion:
                left[:, 1] = 1 - light.occlusion * (1 - self.openness(places, directions, light.reach))
            return left

        return factors
