"""Basic models as one scene: geometry and texels are joined once, and edits copy neither."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import accumulate
from math import log, sqrt
from typing import Self, get_args

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.geometry import quats_to_matrices
from texgs.core.light import Light
from texgs.fields.field import Asked, Composed, Look
from texgs.fields.part_edit import PartEdit
from texgs.fields.splats import geometry
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import material, seen_normals
from texgs.fields.surfels.variants import labels_of
from texgs.raster import Render, Texture, rasterize
from texgs.raster.shading import MATERIAL

CHANNELS = 32  # channels of marks to rasterize at once
DISC_OPACITY = 1e6  # opacity that makes a surfel a disc with a sharp rim
DISC_SCALE = 1 / sqrt(
    2 * log(DISC_OPACITY / 0.5)
)  # scale at which this disc has a radius of one standard deviation


@dataclass(frozen=True, eq=False)
class Edited:
    """A model with edits applied, independent of view and light."""

    colors: Tensor  # [N, 3] c_ind without texels
    material: tuple[Tensor, Tensor, Tensor, Tensor]  # k_a, k_d, k_s and beta, [N] or [1]
    opacities: Tensor  # [N]
    tint: Tensor | None  # [N, 3] or [3] colour of highlights; None: white

    def exposed(self, exposure: Tensor) -> Self:
        """Return the same with factors [N, 2] on the light of the lamp, and on ambient light."""
        lamp, ambient = exposure.unbind(dim=1)
        a, d, s, b = self.material
        return replace(self, material=(a * ambient, d * lamp, s * lamp, b))


class EditableModel:
    """The attributes of one relightable model that edits and lights change.

    Masks [N] bool are those of its segments. Methods take the edit of what no segment holds, and one for each
    segment behind it.
    """

    def __init__(self, model: Surfels, masks: Sequence[Tensor] = ()) -> None:
        if model.stage == "surfels":
            raise ArgumentError("model: expected stage shading or texture, got surfels; fit shading first")
        p = model.parameters
        self.model, self.segments = model, len(masks)
        self.colors, self.palette = p["colors"], p.get("palette")  # offsets from a palette, if any
        self.material = material(p, model.shading.material)  # factors, [N] or [1]
        self.opacities = p["opacities"].sigmoid()
        self.labels = labels_of(masks, len(model)) if masks else None  # [N] number of the segment, or 0

    def per_surfel(self, values: Sequence[float]) -> float | Tensor:
        """Return the value of each surfel's edit [N], or a number if all are the same."""
        if self.labels is None or all(value == values[0] for value in values):
            return values[0]
        return self.opacities.new_tensor(values)[self.labels]

    def colored(self, edits: Sequence[PartEdit]) -> Tensor:
        """Return c_ind without texels [N, 3]."""
        if self.palette is None:
            if any(edit.palette is not None for edit in edits):
                raise ArgumentError("palette: expected a model with a texture; fit its texture first")
            return self.colors
        fitted = self.palette
        palettes = [fitted if edit.palette is None else fitted.new_tensor(edit.palette) for edit in edits]
        if self.labels is None or all(edit.palette == edits[0].palette for edit in edits):
            return self.colors + palettes[0]
        return self.colors + torch.stack(palettes)[self.labels]

    def apply(self, edits: Sequence[PartEdit]) -> Edited:
        """Apply edits to the model."""
        a, d, s, b = (
            self.material[name] * self.per_surfel([getattr(edit, name) for edit in edits])
            for name in MATERIAL
        )
        tints = [edit.tint for edit in edits]
        tint = None
        if set(tints) != {PartEdit.tint}:
            tint = self.colors.new_tensor(tints)[0 if self.labels is None else self.labels]
        return Edited(self.colored(edits), (a, d, s, b), self.opacity(edits), tint)

    def shade(self, edited: Edited, camera: Camera, light: Light, look: Look) -> tuple[Tensor, Tensor]:
        """Return base [N, 3] and gain [N]: the colour of a fragment is base + gain * texel."""
        colors, n = edited.colors, len(self.model)
        if look == "unshaded":
            return colors, torch.ones_like(self.opacities)
        if look == "texture":
            return torch.full_like(colors, 0.5), torch.ones_like(self.opacities)
        if look in MATERIAL:
            value = edited.material[MATERIAL.index(look)].expand(n)
            return value[:, None].expand(n, 3), torch.zeros_like(self.opacities)
        base, gain = self.model.shading.lit(colors, edited.material, self.model.parameters, camera, light)
        if edited.tint is not None:
            matt = gain[:, None] * colors
            base = matt + edited.tint * (base - matt)
        return base.clamp_(0, 1), torch.zeros_like(gain) if look == "discs" else gain

    def opacity(self, edits: Sequence[PartEdit]) -> Tensor:
        """Return opacities [N] with the edits' factors; 0 for hidden surfels."""
        factor = self.per_surfel([edit.opacity if edit.visible else 0.0 for edit in edits])
        return (self.opacities * factor).clamp_max(1)


class Composition(Composed):
    """Relightable models as one scene on one device; `segments` are the masks [N] bool of each."""

    def __init__(self, models: Sequence[Surfels], segments: Sequence[Sequence[Tensor]] | None = None) -> None:
        if not models:
            raise ArgumentError("models: expected at least one, got none")
        passes = sorted({model.shading.low_pass for model in models})
        if len(passes) > 1:
            raise ArgumentError(f"models: expected one low_pass, got {passes}; fit them by one recipe")
        masks = [()] * len(models) if segments is None else segments
        self.parts = [EditableModel(model, own) for model, own in zip(models, masks, strict=True)]
        self.options = models[0].shading.options
        geometries = [geometry(model.parameters)[:3] for model in models]
        self.means, self.quats, self.scales = (torch.cat(x) for x in zip(*geometries, strict=True))
        self.device = self.means.device
        self.texels, self.sizes, self.offsets = join_textures(models)
        self.has_normals = any("normals" in model.parameters for model in models)
        self.exposure: Tensor | None = None  # see `under`
        self._exposed: Self | None = None
        self._latest: tuple[list[PartEdit] | None, list[Edited], Tensor] | None = None

    def __len__(self) -> int:
        return len(self.means)

    @property
    def palettes(self) -> list[tuple[float, ...]]:
        """The fitted palette of each model; black for a model without one."""
        given = (part.palette for part in self.parts)
        return [(0.0, 0.0, 0.0) if palette is None else tuple(palette.tolist()) for palette in given]

    def _draw(
        self, camera: Camera, light: Light, edits: Sequence[PartEdit] | None, look: Look, asked: Asked
    ) -> Render:
        if look not in get_args(Look):
            raise ArgumentError(f"look: expected one of {', '.join(get_args(Look))}, got {look}")
        edited, opacities = self._edited(edits)
        looks = [part.shade(own, camera, light, look) for part, own in zip(self.parts, edited, strict=True)]
        base, gain = (torch.cat(x) for x in zip(*looks, strict=True))
        background = asked.background
        if background is None:
            background = self.means.new_full((3,), float(look not in MATERIAL))
        scales = self.scales
        if look == "discs":
            scales, opacities = DISC_SCALE * scales, torch.where(opacities > 0, DISC_OPACITY, 0.0)
        draw = partial(
            rasterize,
            *(self.means, self.quats, scales, opacities),
            *(camera.viewmat, camera.K, camera.width, camera.height),
            depth_range=asked.depth_range,
            options=self.options,
        )
        texture = Texture(base, gain, self.texels, self.sizes, self.offsets)
        render = draw(texture=texture, background=background, outputs=asked.outputs)
        if render.normal is None or not self.has_normals:
            return render
        normals = torch.cat([seen_normals(part.model.parameters, camera) for part in self.parts])
        return replace(render, normal=draw(features=normals).color)

    def shares(self, camera: Camera, edits: Sequence[PartEdit] | None, marks: Tensor) -> Tensor:
        """Return the share [H, W, M] of each group of surfels, marked by 1 [N, M], in each pixel's colour."""
        pairs = zip(self.parts, by_part(self.parts, edits), strict=True)
        opacities = torch.cat([part.opacity(own) for part, own in pairs])
        splats = self.means, self.quats, self.scales, opacities
        view = camera.viewmat, camera.K, camera.width, camera.height
        planes = [
            rasterize(*splats, *view, features=some.contiguous(), options=self.options).color
            for some in marks.split(CHANNELS, dim=1)
        ]
        return torch.cat(planes, dim=-1)

    @cached_property
    def normals(self) -> Tensor:
        """The unit normals [N, 3] that light sees, each on one side of its surfel."""
        turns = [part.model.parameters.get("normals", part.model.parameters["quats"]) for part in self.parts]
        return quats_to_matrices(torch.cat(turns))[..., 2].contiguous()

    def under(self, exposure: Tensor) -> Self:
        """Return the models with factors [N, 2] on the lamp's and on ambient light; the latest are kept."""
        latest = self._exposed
        if latest is None or latest.exposure is not exposure:
            latest = copy(self)
            latest.exposure, latest._latest = exposure, None
            self._exposed = latest
        return latest

    def _edited(self, edits: Sequence[PartEdit] | None) -> tuple[list[Edited], Tensor]:
        """Return all models with their edits, and opacities [N]; kept while only the camera moves."""
        own = None if edits is None else list(edits)
        latest = self._latest  # another thread may replace it
        if latest is None or latest[0] != own:
            pairs = zip(self.parts, by_part(self.parts, own), strict=True)
            edited = [part.apply(each) for part, each in pairs]
            opacities = torch.cat([each.opacities for each in edited])
            if self.exposure is not None:
                shares = self.exposure.split([len(part.model) for part in self.parts])
                edited = [each.exposed(share) for each, share in zip(edited, shares, strict=True)]
            self._latest = latest = (own, edited, opacities)
        return latest[1:]


def by_part(parts: Sequence[EditableModel], edits: Sequence[PartEdit] | None) -> list[Sequence[PartEdit]]:
    """Return the edits of each model: its own, then one for each segment. None changes nothing."""
    counts = [1 + part.segments for part in parts]
    edits = [PartEdit()] * sum(counts) if edits is None else edits
    if len(edits) != sum(counts):
        segments = sum(counts) - len(parts)
        more = f" and {segments} segments" if segments else ""
        raise ArgumentError(f"edits: expected one for each of {len(parts)} models{more}, got {len(edits)}")
    return [edits[end - count : end] for count, end in zip(counts, accumulate(counts), strict=True)]


def join_textures(models: Sequence[Surfels]) -> tuple[Tensor, Tensor, Tensor]:
    """Join texels [T, 3], sizes [N, 2] and offsets [N] of models; untextured surfels get a texel of 0."""
    textures, count = [], 0
    for model in models:
        p, n = model.parameters, len(model)
        texels, sizes, offsets = p.get("texels"), p.get("sizes"), p.get("offsets")
        if texels is None or sizes is None or offsets is None:
            texels = torch.zeros_like(p["means"])
            sizes = torch.ones(n, 2, dtype=torch.int32, device=texels.device)
            offsets = torch.arange(n, device=texels.device)
        textures.append((texels, sizes, offsets + count))
        count += len(texels)
    texels, sizes, offsets = (torch.cat(each) for each in zip(*textures, strict=True))
    return texels, sizes, offsets
