"""What is left of the data in pictures: which function a pixel shows, and to which side they get lighter."""

from collections.abc import Sequence
from dataclasses import replace
from statistics import fmean

import torch
from torch import Tensor

from texgs.core.oklab import chromaticity, oklab
from texgs.fields.surfels.composition import Composition
from texgs.metrics.metric import MeasuredScene
from texgs.metrics.retrieval import smoothing
from texgs.raster import Render
from texgs.scene.legend import legend_of
from texgs.scene.scene import Scene, volume_of
from texgs.scene.scene_file import read_scene
from texgs.scene.twin import Twin

OBJECT_ALPHA = 0.5  # alpha above which a pixel shows the object
ONE_FUNCTION = 2 / 3  # least share of a pixel's colour that makes it one function's; others show several
EDGE_SIGMA = 1 / 100  # of the Gaussian that smooths lightness, in image sides
GREY = (0.0, 0.5, 0.5, 0.5)  # colour of all functions where light alone counts


def legend_colors(measured: MeasuredScene) -> dict[str, Tensor]:
    """Return the colours [K, 3] of each function in the legend before the edit; {} if they are all alike."""
    colors: dict[str, list[tuple[float, ...]]] = {}
    for entry in legend_of(measured.scenes[0], measured.compositions[0].palettes):
        colors.setdefault(entry.name.partition("/")[0], []).extend(entry.colors)
    is_told = len({*map(tuple, colors.values())}) > 1
    return {name: torch.tensor(each) for name, each in colors.items()} if is_told else {}


def shares_of(measured: MeasuredScene, at: int, names: list[str]) -> list[Tensor]:
    """Return the share [H, W, M] of each named model in each measured view, by surfels.

    A scene of another field has those of its geometry with the same edits; [] if these are no surfels.
    """
    scene, shown = measured.scenes[at], measured.compositions[at]
    if not isinstance(shown, Composition):
        fitted = read_scene(measured.geometry_file).models
        known = {name: each.edit for name, each in scene.models.items() if name in fitted}
        scene = Scene({name: replace(fitted[name], edit=edit) for name, edit in known.items()})
        shown = scene.open(shown.device)
    if not isinstance(shown, Composition):
        return []
    counts = torch.tensor([len(part.model) for part in shown.parts])
    marks = torch.tensor([[name == model for name in names] for model in scene.models])
    marks = marks.repeat_interleave(counts, dim=0).to(shown.means)
    return [shown.shares(camera, scene.edits, marks) for camera in measured.some]


def under_light_alone(measured: MeasuredScene, at: int) -> list[Render]:
    """Render the volume before the edit with the light and opacities of a scene, its functions in one grey.

    It has a white background, and no models that are not of the volume.
    """
    scene, volume, device = measured.scenes[at], volume_of(measured.scenes[0]), measured.shown.device
    known = {n: each for n, each in scene.models.items() if n in volume.tfs}
    models = {n: replace(each, edit=replace(each.edit, palette=None)) for n, each in known.items()}
    grey = {n: volume.tfs[n].with_points(volume.tfs[n].opacity, (GREY,)) for n in known}
    bare = Scene(models, scene.light.unhidden, volume=volume)
    twin, palettes = Twin(bare, device), [GREY[1:]] * len(grey)
    return [twin.render(camera, bare, palettes, functions=grey) for camera in measured.some]


def told_by_hue(seen: Render, shares: Tensor, legend: list[Tensor], least: float = ONE_FUNCTION) -> Tensor:
    """Return [2, n] the functions of object pixels, and those that hue tells there.

    A pixel shows the function with the largest share [H, W, M] of it, if that is at least so much of all. Hue
    tells the one with the nearest chromaticity among its colours [K, 3] in the legend.
    """
    largest, total = shares.amax(-1), shares.sum(-1)
    where = (seen.alpha > OBJECT_ALPHA) & (total > OBJECT_ALPHA) & (largest >= least * total)
    own = chromaticity(straight(seen)[where])
    far = [torch.cdist(own, chromaticity(colors.to(own))).amin(dim=1) for colors in legend]
    return torch.stack([shares[where].argmax(dim=1), torch.stack(far, dim=1).argmin(dim=1)])


def mean_told(views: Sequence[Tensor]) -> float:
    """Return the share of each function's pixels that are told in all views, mean over the functions."""
    shown, told = torch.cat([*views], dim=1)
    return fmean(float((told[shown == each] == each).float().mean()) for each in shown.unique())


def keeps_order(seen: Render, reference: Render) -> Tensor:
    """Return whether lightness rises to the same side as in a reference at each edge [n] bool.

    Edges are the half of the object where the reference changes most. By chance half are true.
    """
    where = (seen.alpha > OBJECT_ALPHA) & (reference.alpha > OBJECT_ALPHA)
    ours, theirs = (slopes(each)[:, where] for each in (seen, reference))
    strength = theirs.norm(dim=0)
    return (ours * theirs).sum(dim=0)[strength >= strength.median()] > 0


def slopes(seen: Render) -> Tensor:
    """Return the slopes [2, H, W] of an object's smoothed lightness; the white behind it does not count."""
    sigma = EDGE_SIGMA * max(seen.alpha.shape)
    down, along = (smoothing(size, sigma).to(seen.alpha) for size in seen.alpha.shape)
    planes = torch.stack([oklab(straight(seen))[..., 0] * seen.alpha, seen.alpha])
    lightness, share = down @ planes @ along
    return torch.stack(torch.gradient(lightness / share.clamp_min(1e-6)))


def straight(seen: Render) -> Tensor:
    """Return the colours [H, W, 3] in [0, 1] of a picture over white without the white behind."""
    alpha = seen.alpha[..., None]
    return ((seen.color - (1 - alpha)) / alpha.clamp_min(1e-6)).clamp(0, 1)
