"""A new segment of a scene, from clicks on a view of one of its models."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.edit.clicks import Clicks
from texgs.edit.lift import Lifted, lift
from texgs.edit.votes import Vote
from texgs.fields.surfels.model import Surfels
from texgs.models.masks import MaskModel
from texgs.scene.parts import require_new, split
from texgs.scene.scene import Scene
from texgs.scene.session import Session


@dataclass(frozen=True, eq=False)
class Segmented:
    """A scene with a new segment, and what that was found in."""

    scene: Scene
    model: Surfels
    lifted: Lifted


def new_segment(
    scene: Scene,
    part: str,
    clicks: Clicks,
    cameras: Sequence[Camera],
    masks: MaskModel,
    file: Path,
    facts: Mapping[str, Any],
    *,
    vote: Vote = "contribution",
    threshold: float | None = None,
    connected: bool = False,
    title: str = "segment",
) -> Segmented:
    """Find a segment of a model by clicks, write its file, and add it to the scene.

    Args:
        scene: whose light is in all views.
        part: MODEL/SEGMENT, a new name.
        clicks: on a view of the model as `clicked_model` has it.
        cameras: of the other views, on the device of the clicks.
        masks: finds the object in a view.
        file: of the segment, to be written.
        facts: what the segment comes from, JSON.
        vote: see `lift`, as for what follows.
        threshold: of the votes.
        connected: whether only connected pieces with a click are kept.
        title: of the progress bar.

    Raises:
        ArgumentError: as `lift` and `Session.make_segment`.
    """
    require_new(scene, part)
    model = clicked_model(scene, split(scene, part)[0], clicks.points.device)
    lifted = lift(
        *(model, clicks, cameras, masks),
        light=scene.light,
        vote=vote,
        threshold=threshold,
        connected=connected,
        title=title,
    )
    sys.stderr.write(f"{part}: {lifted.basis}\n")
    session = Session(scene)
    session.make_segment(part, lifted.mask, file, facts)
    return Segmented(session.scene, model, lifted)


def clicked_model(scene: Scene, name: str, device: torch.device) -> Surfels:
    """A model of a scene with the textures that it has there, alone, and without other edits of the scene.

    Clicks are on this: what an edit makes faint or hides is opaque and in front.

    Raises:
        ArgumentError, ShapeError: naming the file that is not as it should be.
    """
    return scene.models[name].surfels()[0].to(device)


def model_name(scene: Scene, name: str | None, where: str) -> str:
    """The name of the model to segment: the one given, or that of the only model.

    Raises:
        ArgumentError: naming `where` it is from, if there is no such model.
    """
    if not name and len(scene.models) == 1:
        return next(iter(scene.models))
    if name not in scene.models:
        raise ArgumentError(f"{where}: expected one of {', '.join(scene.models)}, got {name or 'none'}")
    return str(name)
