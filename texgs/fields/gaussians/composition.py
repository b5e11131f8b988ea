"""3D Gaussians of several models as one scene: joined once, sorted and blended together."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import torch
from torch import Tensor
from torch.nn.functional import pad

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.field import Look
from texgs.fields.gaussians.model import Gaussians
from texgs.fields.part_edit import MOST_OPAQUE, PartEdit, opacity_factors
from texgs.raster import Render


class JoinedGaussians:
    """Models as one scene on one device.

    Args:
        models: with one filter; their harmonics may have different degrees.
        segments: of each model; there may be none.

    Raises:
        ArgumentError: if there is no model, their filters differ, or there is a segment.
    """

    def __init__(self, models: Sequence[Gaussians], segments: Sequence[Sequence[Tensor]] = ()) -> None:
        if not models:
            raise ArgumentError("models: expected at least one, got none")
        if len({model.shading for model in models}) > 1:
            raise ArgumentError(
                "models: expected all with the antialiased filter or none, got both; fit them by one recipe"
            )
        if any(segments):
            raise ArgumentError("segments: 3D Gaussians have none; remove them, or fit surfels")
        self.counts = [len(model) for model in models]
        self.whole = joined(models)

    def __len__(self) -> int:
        return len(self.whole)

    @property
    def device(self) -> torch.device:
        """Where the Gaussians are."""
        return self.whole.device

    @property
    def palettes(self) -> list[tuple[float, ...]]:
        """Black for each model: none has a palette."""
        return [(0.0, 0.0, 0.0)] * len(self.counts)

    @torch.no_grad()
    def render(
        self,
        camera: Camera,
        light: Light = HEADLIGHT,
        edits: Sequence[PartEdit] | None = None,
        *,
        look: Look = "shaded",
        background: Tensor | None = None,
        outputs: Collection[str] = (),
    ) -> Render:
        """Render all visible models.

        Args:
            camera: on the models' device.
            light: changes nothing: the colours are those of the views.
            edits: one for each model, of opacity and visibility; by default nothing is changed.
            look: only "shaded".
            background: [3]; white by default.
            outputs: of the rasterizer, without "normal".

        Raises:
            ArgumentError: if there are not as many edits as models, or 3D Gaussians cannot show what is
                asked for.
        """
        if look != "shaded":
            raise ArgumentError(f"look: 3D Gaussians have light in their colours, so no {look}; fit surfels")
        opacity = 1.0 if edits is None else self._opacity(edits)
        return self.whole.render(camera, light, background=background, outputs=outputs, opacity=opacity)

    def edited(self, edits: Sequence[PartEdit]) -> Gaussians:
        """What is visible as one model, opacities as edited.

        Raises:
            ArgumentError: as `render`; or if nothing is visible.
        """
        factors = self._opacity(edits)
        shown = factors > 0
        if not bool(shown.any()):
            raise ArgumentError("models: expected at least one visible Gaussian, got none; show a model")
        parameters = {name: x[shown] for name, x in self.whole.parameters.items()}
        raw, factor = parameters["opacities"], factors[shown]
        changed = (raw.sigmoid() * factor).clamp_max(MOST_OPAQUE).logit()
        parameters["opacities"] = torch.where(factor == 1, raw, changed)
        return replace(self.whole, parameters=parameters)

    def _opacity(self, edits: Sequence[PartEdit]) -> Tensor:
        """Factors [N] on opacities; 0 for what is hidden, so that nothing of it is drawn."""
        factors = opacity_factors(edits, len(self.counts), self.whole.kind)
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
