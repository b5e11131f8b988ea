"""3D Gaussians of several models as one scene: joined once, sorted and blended together."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import torch
from torch import Tensor
from torch.nn.functional import pad

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.fields.gaussians.model import Gaussians
from texgs.fields.part_edit import MOST_OPAQUE, PartEdit, opacity_factors
from texgs.fields.unlit import UnlitScene
from texgs.raster import Render


class JoinedGaussians(UnlitScene[Gaussians]):
    """Models as one scene on one device, see `UnlitScene`.

    Raises:
        ArgumentError: if there is no model, their filters differ, or there is a segment.
    """

    def __init__(self, models: Sequence[Gaussians], segments: Sequence[Sequence[Tensor]] = ()) -> None:
        super().__init__(models, segments)
        if len({model.shading for model in models}) > 1:
            raise ArgumentError(
                "models: expected all with the antialiased filter or none, got both; fit them by one recipe"
            )
        self.whole = joined(models)

    def _blend(
        self, factors: Sequence[float], camera: Camera, background: Tensor | None, outputs: Collection[str]
    ) -> Render:
        opacity = self._per_gaussian(factors)
        return self.whole.render(camera, background=background, outputs=outputs, opacity=opacity)

    def edited(self, edits: Sequence[PartEdit]) -> Gaussians:
        """Return what is visible as one model, opacities as edited.

        Raises:
            ArgumentError: as `render`; or if nothing is visible.
        """
        factors = self._per_gaussian(opacity_factors(edits, len(self.counts), self.kind))
        shown = factors > 0
        if not bool(shown.any()):
            raise ArgumentError("models: expected at least one visible Gaussian, got none; show a model")
        parameters = {name: x[shown] for name, x in self.whole.parameters.items()}
        raw, factor = parameters["opacities"], factors[shown]
        changed = (raw.sigmoid() * factor).clamp_max(MOST_OPAQUE).logit()
        parameters["opacities"] = torch.where(factor == 1, raw, changed)
        return replace(self.whole, parameters=parameters)

    def _per_gaussian(self, factors: Sequence[float]) -> Tensor:
        """Return the factor [N] of each Gaussian's opacity; 0 for what is hidden, which is not drawn."""
        pairs = zip(factors, self.counts, strict=True)
        return torch.cat([torch.full((n,), factor, device=self.device) for factor, n in pairs])


def joined(models: Sequence[Gaussians]) -> Gaussians:
    """One model of all; harmonics that a model has not are zero."""
    most = max(model.parameters["sh"].shape[1] for model in models)
    parameters = {
        name: torch.cat([model.parameters[name] for model in models])
        for name in models[0].parameters
        if name != "sh"
    }
    harmonics = [model.parameters["sh"] for model in models]
    parameters["sh"] = torch.cat([pad(sh, (0, 0, 0, most - sh.shape[1])) for sh in harmonics])
    return Gaussians(parameters, models[0].shading)
