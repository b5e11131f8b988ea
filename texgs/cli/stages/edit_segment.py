"""Stage `edit_segment`: clicks on a view of a model become a segment of it."""

import sys
import time
from pathlib import Path
from typing import Any

import torch

from texgs.cli.segments import mask_model, require_new, voting_views, with_segment
from texgs.cli.stages.outcome import Outcome
from texgs.cli.stages.parts import shares
from texgs.core.camera import Camera, orbit
from texgs.core.device import torch_device
from texgs.core.errors import ArgumentError
from texgs.core.names import part_file
from texgs.edit.clicks import Clicks
from texgs.edit.lift import Lifted, lift
from texgs.edit.preview import overlay
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.render import render
from texgs.report.strip import write_strip
from texgs.scene.scene_file import Scene, read_scene, write_scene
from texgs.volume.cameras import orbit_path

DISTANCE, FOV, SIZE = 4.0311, 30.0, 800  # of the view that is clicked on
SHOWN = 3  # views of the segment around the object
POLAR = 20.0  # of these views, degrees
DIMMED = 0.15  # opacity of what is not in the segment, in its picture


def work(settings: dict[str, Any], inputs: dict[str, Path], output: Path) -> Outcome:
    """Write scene.yaml, the segment's file, and edit.png with the clicks, their mask and the segment.

    Args:
        settings: what the stage reads of the configuration.
        inputs: `scene`.
        output: folder.
    """
    edit, wanted = settings["edit"], settings["edit"]["segment"]
    device, scene = torch_device(settings["fit"]["device"]), read_scene(inputs["scene"])
    name = model_of(scene, wanted["model"])
    part = f"{name}/{wanted['name']}"
    require_new(scene, part)
    model = scene.models[name].open()[0].to(device)
    clicks = clicks_of(wanted, device)
    cameras = [camera.to(device) for camera in voting_views(wanted["views"], DISTANCE, FOV, wanted["size"])]
    start = time.monotonic()
    found = lift(
        *(model, clicks, cameras, mask_model(wanted["masks"], device)),
        light=scene.light,
        vote=wanted["vote"],
        connected=wanted["connected"],
        title=f"{settings['dataset']}: edit {edit['name']}",
    )
    seconds = time.monotonic() - start
    file = output / part_file("edit.segment.name", name, wanted["name"])
    sys.stderr.write(f"{part}: {found.basis}\n")
    after = with_segment(scene, part, model, found.mask, file, wanted)
    write_scene(output / "scene.yaml", after)
    numbers = {
        "edit": edit["name"],
        "kind": "segment",
        "method": f"{wanted['masks']}, {wanted['vote']}",
        "edit_seconds": seconds,
        "surfels": int(found.mask.sum()),
        "views": {"used": found.used, "left out": found.left_out},
    }
    return Outcome(numbers, [picture(model, clicks, found, scene, output / "edit.png")])


def model_of(scene: Scene, name: str) -> str:
    """The model to segment: the one named, or the only one.

    Raises:
        ArgumentError: if there is no such model.
    """
    if not name and len(scene.models) == 1:
        return next(iter(scene.models))
    if name not in scene.models:
        raise ArgumentError(f"edit.segment.model: expected one of {', '.join(scene.models)}, got {name!r}")
    return name


def clicks_of(wanted: dict[str, Any], device: torch.device) -> Clicks:
    """Clicks in pixels.

    Raises:
        ArgumentError: if one is no place in the view, or none is on the object.
    """
    places = shares("edit.segment.points", [*wanted["points"], *wanted["others"]])
    if not wanted["points"]:
        raise ArgumentError("edit.segment.points: expected one at least, such as [[0.5, 0.4]], got none")
    if len(wanted["view"]) != 2:
        raise ArgumentError(f"edit.segment.view: expected azimuth and polar angle, got {wanted['view']}")
    azimuth, polar = wanted["view"]
    camera = orbit(azimuth, polar, DISTANCE, FOV, SIZE, SIZE).to(device)
    points = SIZE * torch.tensor(places, dtype=torch.float32, device=device)
    positive = torch.arange(len(points), device=device) < len(wanted["points"])
    return Clicks(camera, points, positive)


@torch.no_grad()
def picture(model: Surfels, clicks: Clicks, found: Lifted, scene: Scene, path: Path) -> Path:
    """The view clicked on with its mask, and the segment in it and around the object, the rest faint."""
    faint = found.mask.new_ones(len(model), dtype=torch.float32).masked_fill(~found.mask, DIMMED)
    opacities = (model.parameters["opacities"].sigmoid() * faint).clamp(1e-6, 1 - 1e-6).logit()
    dimmed = Surfels({**model.parameters, "opacities": opacities}, model.shading, model.metadata)

    def shown(of: Surfels, camera: Camera) -> torch.Tensor:
        return render(of, camera.to(opacities.device), scene.light).color.clamp(0, 1)

    marked = overlay(shown(model, clicks.camera), found.reference, clicks.points, clicks.positive)
    around = orbit_path(SHOWN, POLAR, DISTANCE, FOV, SIZE, SIZE)
    pictures = [marked, shown(dimmed, clicks.camera), *(shown(dimmed, camera) for camera in around)]
    titles = ["clicks and mask", "segment", *(f"view {index + 1}" for index in range(SHOWN))]
    return write_strip(path, {"": [image.cpu().numpy() for image in pictures]}, titles)
