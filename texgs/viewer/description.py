"""What a page has to know of a scene, as JSON: its parts, their edits, and which edits each can show."""

from __future__ import annotations

from dataclasses import asdict, fields
from math import radians, sin
from typing import Any, get_args

import numpy as np
import torch
from torch import Tensor

from texgs.core.lens import Lens
from texgs.fields.field import Composed
from texgs.fields.files import kind_of
from texgs.fields.gaussians.model import JoinedGaussians
from texgs.fields.part_edit import NEEDS, PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.raster.shading import MATERIAL
from texgs.scene.frame import Mode
from texgs.scene.scene import Scene, SceneModel

LENS = Lens()
HOME = {"azimuth": 30.0, "polar": 20.0}  # degrees, as `texgs render` has them
STRAYS = 0.01  # part of the primitives, far from all others, that bounds leave out
MARGIN = 1.1  # of the first view around the bounds
# What a kind of field has to be capable of for a mode of frames; all others are for each.
MODES = {"unshaded": "unlit", "normal": "normals", "texture": "texture", "discs": "texture"}
MODES |= dict.fromkeys(MATERIAL, "relight")


def describe(
    name: str, scene: Scene, composed: Composed, bounds: tuple[list[float], float] | None = None
) -> dict[str, Any]:
    """Return a scene as a page needs it; bounds, as of `bounds_of`, take a while where they are not given."""
    kind = kind_of(next(iter(scene.models.values())).file)
    segments = ["segments"] if "segments" in kind.can else []
    keys = [each.name for each in fields(PartEdit) if NEEDS.get(each.name, "relight") in kind.can]
    models = []
    for (model, entry), palette, is_textured in zip(
        scene.models.items(), composed.palettes, have_palette(composed), strict=True
    ):
        # Only what has a palette has a texture, which can get a new look.
        can = [*keys, "look"] if is_textured else [key for key in keys if key != "palette"]
        models.append(describe_model(model, entry, kind.name, palette, [*can, *segments]))
    light, (center, radius) = scene.light, bounds_of(composed) if bounds is None else bounds
    distance = MARGIN * radius / sin(radians(LENS.fov_y / 2))
    return {
        "name": name,
        "background": list(scene.background),
        "light": {"azimuth": light.azimuth, "polar": light.polar} if light.kind == "directional" else None,
        "cuts": asdict(scene.cuts),
        "models": models,
        "modes": [mode for mode in get_args(Mode) if mode not in MODES or MODES[mode] in kind.can],
        "bounds": {"center": center, "radius": radius},
        "up": [0.0, 1.0, 0.0],
        "fov_y": LENS.fov_y,
        "views": [{"name": "home", "target": center, "distance": distance, **HOME}],
    }


def describe_model(
    name: str, entry: SceneModel, kind: str, palette: tuple[float, ...], can: list[str]
) -> dict[str, Any]:
    """Return a model and its segments."""
    segments = [{"name": key, "edit": asdict(segment.edit)} for key, segment in entry.segments.items()]
    return {
        "name": name,
        "kind": kind,
        "edit": asdict(entry.edit),
        "fitted_palette": list(palette),
        "can": can,
        "segments": segments,
    }


def have_palette(composed: Composed) -> list[bool]:
    """Return of each model whether its palette can be replaced: surfels without texture have none."""
    if isinstance(composed, Composition):
        return [part.palette is not None for part in composed.parts]
    return [False] * len(composed.palettes)


def bounds_of(composed: Composed) -> tuple[list[float], float]:
    """Return the centre [3] and radius of a ball that holds nearly all primitives, world units.

    Fields without means have the bounds that the paper's cameras see: volumes are centred and scaled alike.
    """
    means = means_of(composed)
    if means is None or not len(means):
        return [0.0, 0.0, 0.0], LENS.radius * sin(radians(LENS.fov_y / 2))
    places = means.double().cpu().numpy()
    center = np.quantile(places, [STRAYS, 1 - STRAYS], axis=0).mean(axis=0)
    radius = float(np.quantile(np.linalg.norm(places - center, axis=1), 1 - STRAYS))
    return center.tolist(), max(radius, 1e-3)


def means_of(composed: Composed) -> Tensor | None:
    """Return the means [N, 3] of all primitives, where they have some."""
    if isinstance(composed, Composition):
        return torch.cat([part.model.parameters["means"] for part in composed.parts])
    if isinstance(composed, JoinedGaussians):
        return composed.whole.parameters["means"]
    return None
