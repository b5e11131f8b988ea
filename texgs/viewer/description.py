"""What a front end needs to know of a scene: its parts, what edits they can show, where it is in space."""

from __future__ import annotations

from dataclasses import asdict
from math import radians, sin
from typing import Any

import numpy as np
import torch
from torch import Tensor

from texgs.config.fields import Kind
from texgs.core.camera import Camera, intrinsics, look_at, orbit_direction
from texgs.core.lens import Lens
from texgs.fields.field import Composed
from texgs.fields.files import kind_of
from texgs.fields.part_edit import NEEDS, PartEdit
from texgs.scene.scene import Scene

AZIMUTH, POLAR = 30.0, 20.0  # of the first view, degrees, as `texgs render` has them
FLOATERS = 0.01  # share of the primitives at either end that bounds leave out
MARGIN = 1.2  # of the first view around the bounds


def describe(name: str, scene: Scene, composed: Composed, means: Tensor) -> dict[str, Any]:
    """A scene as JSON: every part with its edit, light, background, bounds and views.

    Args:
        name: of the scene, shown to the user.
        scene: to describe.
        composed: its models, opened.
        means: [N, 3] places of their primitives, world units.
    """
    models = [
        {
            "name": str(model),
            "kind": kind_of(entry.file).name,
            "edit": asdict(entry.edit),
            "fitted_palette": [float(x) for x in palette],
            "can": editable(kind_of(entry.file)),
            "segments": [{"name": key, "edit": asdict(each.edit)} for key, each in entry.segments.items()],
        }
        for (model, entry), palette in zip(scene.models.items(), composed.palettes, strict=True)
    ]
    light = scene.light
    bounds, fov_y = bounds_of(means), Lens().fov_y
    first = {"name": "start", "target": bounds["center"], "azimuth": AZIMUTH, "polar": POLAR}
    return {
        "name": name,
        "background": list(scene.background),
        "light": None if light.kind == "headlight" else {"azimuth": light.azimuth, "polar": light.polar},
        "models": models,
        "bounds": bounds,
        "up": [0.0, 1.0, 0.0],
        "fov_y": fov_y,
        "views": [first | {"distance": MARGIN * bounds["radius"] / sin(radians(fov_y / 2))}],
    }


def editable(kind: Kind[Any]) -> list[str]:
    """Keys of an edit that fields of a kind can show."""
    return [key for key in asdict(PartEdit()) if NEEDS.get(key, "relight") in kind.can]


def bounds_of(means: Tensor) -> dict[str, Any]:
    """Centre [3] and radius of a sphere around nearly all places [N, 3], world units."""
    places = means.detach().cpu().double().numpy()
    center = np.quantile(places, [FLOATERS, 1 - FLOATERS], axis=0).mean(axis=0)
    radius = float(np.quantile(np.linalg.norm(places - center, axis=1), 1 - FLOATERS))
    return {"center": center.tolist(), "radius": max(radius, 1e-3)}


def first_view(description: dict[str, Any], width: int, height: int) -> Camera:
    """The camera that a page begins with."""
    view = description["views"][0]
    target = torch.tensor(view["target"], dtype=torch.float64)
    position = target + view["distance"] * orbit_direction(view["azimuth"], view["polar"])
    viewmat = look_at(position, target, torch.tensor(description["up"], dtype=torch.float64))
    return Camera(viewmat.float(), intrinsics(description["fov_y"], width, height), width, height)
