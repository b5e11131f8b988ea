"""Colours and normals of surfels from their volume; fits learn the differences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from torch import Tensor
from torch.nn.functional import normalize

from texgs.core.geometry import nearest
from texgs.fields.surfels.material import nearest_material
from texgs.fields.surfels.shading import raw_material
from texgs.raster.shading import MATERIAL
from texgs.volume.caster import Caster
from texgs.volume.lookup import Lookup
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

HELD_ATTRIBUTES = ("colors", "normals")
NEIGHBOURS = 3  # neighbours whose normals are compared with a surfel's own
# In smooth data, normals of the volume are better than learned ones. In noisy or strongly curved data,
# learned normals are better, because they average many samples. Between these two coherences the strength of
# the hold grows from none to all.
ROUGH_COHERENCE, SMOOTH_COHERENCE = 0.96, 0.98
FULL_HOLD = 0.02  # share of a difference that an iteration removes at full strength


@dataclass(frozen=True, eq=False)
class Attributes:
    """Attributes of surfels from a volume, and how strongly a fit holds surfels to them."""

    lookup: Lookup
    appearance: Appearance
    coherence: float  # similarity of normals of neighbouring surfels, 0 to 1
    hold: float  # share of a difference that an iteration removes; 0: the volume is only the start

    @classmethod
    def of(
        cls,
        caster: Caster,
        appearance: Appearance,
        tf: TransferFunction,
        means: Tensor,
        hold: float | None = None,
    ) -> Attributes:
        """Look up attributes of a volume under a function, for surfels with means [N, 3].

        Without `hold`, the coherence of normals decides how strongly surfels are held.
        """
        lookup = Lookup(caster, tf)
        alike = coherence(lookup, means)
        share = min(max((alike - ROUGH_COHERENCE) / (SMOOTH_COHERENCE - ROUGH_COHERENCE), 0.0), 1.0)
        return cls(lookup, appearance, alike, FULL_HOLD * share if hold is None else hold)

    @property
    def held(self) -> Attributes | None:
        """The attributes that a fit holds surfels to."""
        return self if self.hold > 0 else None

    def start(self, means: Tensor, kind: str) -> dict[str, Tensor]:
        """Return colours, normals and one raw material of surfels with means [N, 3], before a fit.

        The material is that of the views, or the nearest that materials of a kind can express.
        """
        factors = {name: getattr(self.appearance, name) for name in MATERIAL}
        material = raw_material(**nearest_material(factors, kind), kind=kind)
        return {**self.at(means), **{name: x.to(means) for name, x in material.items()}}

    def at(self, means: Tensor) -> dict[str, Tensor]:
        """Return `colors` [N, 3] and `normals` [N, 4], quaternions whose third axis is the gradient."""
        seen = self.lookup.at(means, ("colors", "quats"))
        return {"colors": seen["colors"], "normals": seen["quats"]}

    def differences(self, parameters: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Replace colours and normals in parameters by their differences from the volume."""
        own = self.at(parameters["means"])
        return {name: x - own[name] if name in own else x for name, x in parameters.items()}

    def added_to(self, differences: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Add the volume's colours and normals to parameters with differences."""
        own = self.at(differences["means"])
        return {name: x + own[name] if name in own else x for name, x in differences.items()}


def coherence(lookup: Lookup, means: Tensor) -> float:
    """Return the mean cosine of the angle between the normals at points [N, 3] and at their neighbours.

    Light sees no difference between a normal and its opposite, so that cosines count without their sign. It
    is 0 for fewer points than have neighbours.
    """
    if len(means) <= NEIGHBOURS:
        return 0.0
    normals = normalize(lookup.at(means, ("gradients",))["gradients"].cpu(), dim=1)
    _, near = nearest(means, means, 1 + NEIGHBOURS)
    cosines = (normals[:, None] * normals[near[:, 1:]]).sum(dim=2)
    return float(cosines.abs().mean())
