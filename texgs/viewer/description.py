"""A scene for a page, as JSON: its parts, their edits, and the edits that each can show."""

from contextlib import suppress
from dataclasses import asdict, fields
from typing import Any, get_args

import numpy as np

from texgs.core.errors import TexgsError
from texgs.core.lens import Frame, Lens
from texgs.core.light import HIDING
from texgs.fields.field import Composed
from texgs.fields.files import kind_of
from texgs.fields.part_edit import NEEDS, PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.raster.shading import MATERIAL
from texgs.scene.bounds import STRAY_SHARE, models_of, span_of
from texgs.scene.legend import legend_of
from texgs.scene.scene import Scene, SceneModel, SceneSegment
from texgs.scene.scene_file import plain_functions
from texgs.scene.shot import Mode, Shot
from texgs.volume.grid import closest
from texgs.volume.space import LETTERS, Space

LENS = Lens()
# What a kind of field has to be capable of for a mode of frames; all others are for each.
MODES = {"unshaded": "unlit", "normal": "normals", "texture": "texture", "discs": "texture"}
MODES |= dict.fromkeys(MATERIAL, "relight")
MODES["volume"] = "a volume"  # of the scene, not of a field: see `Beside`
# Colour maps of matplotlib by the names that ParaView has for them.
PRESETS = {
    "Cool to Warm": "coolwarm",
    "Viridis": "viridis",
    "Inferno": "inferno",
    "Magma": "magma",
    "Plasma": "plasma",
    "Turbo": "turbo",
    "Grayscale": "gray",
    "X Ray": "binary",
}
COLOR_STOPS = 9


def presets() -> dict[str, list[list[float]]]:
    """Return points [share of the range, r, g, b] of colour maps by name."""
    from matplotlib import colormaps

    shares = [i / (COLOR_STOPS - 1) for i in range(COLOR_STOPS)]
    return {name: [[x, *colormaps[key](x)[:3]] for x in shares] for name, key in PRESETS.items()}


def bounds(scene: Scene, composed: Composed) -> dict[str, Any]:
    """Return the ball that the first view shows, the corners of a box, and its world units per physical unit.

    The box is that of the scene's volume, else that of the models: these have no physical units.
    """
    framed = scene.framed(composed)
    ball = {"center": list(framed.target), "radius": framed.radius, "azimuth": framed.azimuth}
    with suppress(TexgsError):  # the error is told to whoever shows the volume
        if scene.volume is not None:
            grid = scene.volume.open()
            return {**ball, "low": grid.aabb[0], "high": grid.aabb[1], "scale": grid.scale}
    low, high = zip(
        *(span_of(models_of(composed), framed, axis, STRAY_SHARE) for axis in np.eye(3).tolist()), strict=True
    )
    return {**ball, "low": low, "high": high, "scale": None}


def describe(
    name: str, scene: Scene, composed: Composed, known: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Return a scene as a page needs it; its `bounds` may take a while to find."""
    kind = kind_of(next(iter(scene.models.values())).file)
    segments = ["segments"] if "segments" in kind.can else []
    keys = [each.name for each in fields(PartEdit) if NEEDS.get(each.name, "relight") in kind.can]
    models, parts = [], composed.parts if isinstance(composed, Composition) else [None] * len(scene.models)
    for (model, entry), palette, part in zip(scene.models.items(), composed.palettes, parts, strict=True):
        # Only what has a palette has a texture, which can get a new look.
        is_textured = part is not None and part.palette is not None
        can = [*keys, "look"] if is_textured else [key for key in keys if key != "palette"]
        own = [_part(key, segment) for key, segment in entry.segments.items()]
        said = {**_part(model, entry), "kind": kind.name, "fitted_palette": list(palette)}
        models.append({**said, "can": [*can, *segments], "segments": own})
    known = known or bounds(scene, composed)
    light, target = scene.light, known["center"]
    distance = Frame(target, known["radius"]).lens(LENS.fov_y).radius
    angles = {"azimuth": known["azimuth"], "polar": Shot.polar}  # as `texgs render` has them
    return {
        "name": name,
        "background": list(scene.background),
        "light": {"azimuth": light.azimuth, "polar": light.polar} if light.kind == "directional" else None,
        **{key: getattr(light, key) for key in HIDING},
        "can_shadow": "relight" in kind.can and scene.volume is not None,
        "cuts": {key: x for key, x in asdict(scene.cuts).items() if key != "window" or x},
        "models": models,
        "functions": plain_functions(scene.functions),
        "markers": [asdict(each) for each in scene.markers],
        "legend": [asdict(each) for each in legend_of(scene.as_fitted, composed.palettes)],
        "time": scene.time,
        "steps": list(scene.series.steps) if scene.series else [],
        "tfs": plain_functions(scene.volume.tfs) if scene.volume else {},
        "modes": [mode for mode in get_args(Mode) if MODES.get(mode, "") in ("", *kind.can)],
        "bounds": known,
        "space": drawn(scene.space) if scene.space else None,
        "fov_y": LENS.fov_y,
        "views": [{"name": "home", "target": target, "distance": distance, **angles}],
    }


def _part(name: str, entry: SceneModel | SceneSegment) -> dict[str, Any]:
    """Return what a page needs of a model or a segment alone."""
    return {"name": name, "edit": asdict(entry.edit), "styled": entry.texture is not None}


def drawn(space: Space) -> dict[str, Any]:
    """Return a space with what axes are drawn by: names of its own, and at both ends of the world's."""
    ahead, behind = LETTERS.get(space.name, ("xyz", ["", "", ""]))
    ends = [["", ""]] * 3
    for front, back, (axis, sign) in zip(ahead, behind, closest(space.turn.T), strict=True):
        ends[axis] = [front, back][::sign]
    return asdict(space) | {"axes": ahead, "ends": ends, "scale": space.scale}
