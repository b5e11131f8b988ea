"""Segment a model of a scene by clicks on a view of it, so that the segment can be edited on its own."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.cli.edit import require_scene
from texgs.cli.options import add_device, add_keys, keys_of, require_own_place
from texgs.core.errors import ArgumentError
from texgs.core.lens import LensKeys
from texgs.core.names import new_part_file, require_name
from texgs.edit.mask_keys import MaskKeys

if TYPE_CHECKING:
    import torch

    from texgs.core.lens import Lens
    from texgs.edit.clicks import Clicks

CLICKED = ("view", "point", "other", "box")  # arguments that a segment's file says


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what is clicked on, and how masks are found and lifted."""
    parser.add_argument("scene", type=Path, help="scene.yaml, a folder with one, or a model file")
    parser.add_argument("--model", help="name of the model; may be left out where there is one")
    parser.add_argument("--name", help="of the new segment")
    add_clicks(parser)
    parser.add_argument("--output", type=Path, help="the new scene.yaml; the segment's file is put beside it")
    parser.add_argument("--preview", type=Path, metavar="PNG", help="write the view with the mask, no scene")
    add_keys(parser, MaskKeys)
    parser.add_argument("--threshold", type=float, help="of votes; default 0.5, of vote centre 0.7")
    add_keys(parser, LensKeys)  # of the view clicked on
    add_device(parser)


def add_clicks(parser: argparse.ArgumentParser) -> None:
    """Add the view that is clicked on, and where."""
    parser.add_argument(
        "--view",
        type=numbers,
        metavar="AZIMUTH,POLAR",
        help="degrees, of the view clicked on; default as texgs render, which shows the model alone so",
    )
    pixels: dict[str, Any] = {"action": "append", "type": numbers, "default": [], "metavar": "X,Y"}
    seen, other = "pixel on the object, counted from 0,0", "pixel that is not of the object"
    parser.add_argument("--point", **pixels, help=f"{seen}; repeat for several")
    parser.add_argument("--not", dest="other", **pixels, help=f"{other}; repeat for several")
    parser.add_argument("--box", nargs=4, type=float, metavar=("X0", "Y0", "X1", "Y1"), help="box around it")


def numbers(text: str) -> tuple[float, float]:
    """Return two numbers with a comma between them."""
    first, _, second = text.partition(",")
    return float(first), float(second)


def run(arguments: argparse.Namespace) -> int:
    """Write the scene with the segment, and the segment's file; or a preview of the mask."""
    keys = keys_of(arguments, MaskKeys)
    require_output(arguments)
    from texgs.core.check import torch_device
    from texgs.core.image import write_png
    from texgs.edit.new_segment import clicked_model, model_name, new_segment, preview
    from texgs.models.sam import mask_model
    from texgs.scene.session import Session
    from texgs.scene.shot import Shot

    session = Session.open(arguments.scene)
    name = model_name(session.scene, arguments.model, "--model")
    framed = session.scene.framed()
    arguments.view = arguments.view or (framed.azimuth, Shot.polar)
    lens = keys_of(arguments, LensKeys).lens(framed)
    device = torch_device(arguments.device)
    clicks, masks = clicks_of(arguments, lens, device), mask_model(keys.masks, device)
    if arguments.preview:
        model = clicked_model(session.scene, name, device)
        print(write_png(arguments.preview, preview(model, clicks, masks, session.scene.light)))
        return 0
    output, part = arguments.output, f"{name}/{arguments.name}"
    file = partial(new_part_file, "--name", output.parent, output.stem, part)
    facts = {key: getattr(arguments, key) for key in CLICKED}
    threshold, title = arguments.threshold, f"segment {arguments.name}"
    new_segment(session, part, clicks, keys, lens, file, facts, threshold=threshold, title=title)
    made = session.scene.models[name].segments[arguments.name]
    print(session.save(output), made.file, sep="\n")
    return 0


def clicks_of(arguments: argparse.Namespace, lens: Lens, device: torch.device) -> Clicks:
    """Return the clicks, each in the middle of its pixel."""
    import torch

    from texgs.core.camera import orbit
    from texgs.edit.clicks import Clicks, inside_of

    if not arguments.point and not arguments.box:
        raise ArgumentError("--point: expected one at least, or --box, got none; name a pixel on the object")
    azimuth, polar = arguments.view
    camera = orbit(azimuth, polar, *lens).to(device)
    pixels = torch.tensor([*arguments.point, *arguments.other], device=device).reshape(-1, 2)
    positive = torch.arange(len(pixels), device=device) < len(arguments.point)
    held = None
    if arguments.box:
        x0, y0, x1, y1 = arguments.box
        corners = [(x0, y0), (x1 + 1, y0), (x1 + 1, y1 + 1), (x0, y1 + 1)]
        held = inside_of(torch.tensor(corners, device=device), camera)
    return Clicks(camera, pixels + 0.5, positive, held)


def require_output(arguments: argparse.Namespace) -> None:
    """Require a name and a file for the segment and its scene, unless there is a preview only."""
    if arguments.preview:
        if arguments.preview.suffix != ".png":
            raise ArgumentError(f"--preview: expected a file that ends in .png, got {arguments.preview}")
        require_own_place(arguments.preview, "--preview")
        return
    require_name(arguments.name, "--name")
    if not arguments.output:
        raise ArgumentError("--output: expected the new scene.yaml, or --preview and a PNG file; got neither")
    require_scene(arguments.output)
