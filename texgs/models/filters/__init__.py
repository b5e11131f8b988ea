"""The offline counterpart of a diffusion model: a guidance of procedural filters."""

from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor

from texgs.models.filters import painting
from texgs.models.filters.surface import Surface, surface_of
from texgs.models.guidance import EditViews
from texgs.models.instruction import understand

Filter = Callable[[Surface], Tensor]

FILTERS: dict[str, Filter] = {  # by the names of the vocabulary
    "stipple drawing": painting.stipple,
    "pencil hatching": painting.hatching,
    "woodcut": painting.woodcut,
    "watercolour": painting.watercolour,
    "oil painting": painting.oil,
    "cartoon": painting.cartoon,
    "marble": painting.marble,
    "wood": painting.wood,
    "glass": painting.glass,
    "mosaic": painting.mosaic,
    "gold": partial(painting.metal, tones=painting.GOLD),
    "silver": partial(painting.metal, tones=painting.SILVER),
    "copper": partial(painting.metal, tones=painting.COPPER),
}


class ProceduralFilters:
    """Edits views by filters that are anchored to the surface: no weights, milliseconds to seconds.

    Every filter is a solid texture, a function of the place in the world that a pixel shows and of light
    that is fixed there, so that all views of a call agree and a texture lifted from them is crisp; the size
    of patterns and the brightest and the mean colour are those of these views. Patterns do not depend on the
    generator of a call, so that one call goes on with what another has begun. It answers the entries of
    `vocabulary` only. It wants to see bare colours: what it paints is what light falls on.
    """

    name = "procedural filters"
    lit = False

    @torch.no_grad()
    def __call__(self, views: EditViews, instruction: str, generator: torch.Generator) -> Tensor:
        """Edit the views; see `Guidance`."""
        name, color = understand(instruction)
        function = FILTERS[name] if color is None else partial(painting.tint, color=color)
        surface, where = surface_of(views)
        edited = views.images.clone()
        alpha = views.alphas[where][:, None]
        edited[where] = function(surface) * alpha + 1 - alpha
        return edited
