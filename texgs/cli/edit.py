"""Edit a scene by words such as TF01.palette=#ff8800 and write it to a new file; nothing is trained."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.cli.options import add_device, add_lens, lens_of, option, require_only_files, require_own_place
from texgs.core.errors import ArgumentError, located
from texgs.core.lens import Lens
from texgs.core.names import SCENES, new_part_file, require_name

if TYPE_CHECKING:
    import torch

    from texgs.edit.clicks import Clicks

KEPT = ("view", "point", "other", "box", "masks", "vote", "connected")  # arguments that a segment's file says


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the scene, the edits, and the new file."""
    parser.add_argument("scene", type=Path, help="scene.yaml, a folder with one, or a model file")
    parser.add_argument(
        "overrides",
        nargs="*",
        metavar="KEY=VALUE",
        help="MODEL.KEY=VALUE with visible, palette (r,g,b from 0 to 1, or #rrggbb), opacity, ambient, "
        "diffuse, specular, shininess (factors), tint (a colour, of highlights), texture (a file) or file "
        "(another model); light=headlight or light=AZIMUTH,POLAR; background=#rrggbb; time=STEP of a "
        "series; cut=AXIS,POSITION (x, -x, y, ...; world units, or samples as in 64v; or R, A, S, L, P, "
        "I, X, Y, Z, of the volume's file, in its unit, as in S,-12mm) or "
        "cut=NX,NY,NZ,OFFSET adds a plane, cut.1=... replaces it, cut= takes all back; "
        "cut.box=X0,Y0,Z0,X1,Y1,Z1; cut.faces=shaded or unlit; MODEL.KEY= takes an edit back; "
        "MODEL/SEGMENT.KEY=VALUE edits a segment, MODEL/SEGMENT=FILE adds one from a file and MODEL/SEGMENT= "
        "removes it",
    )
    parser.add_argument("--output", type=Path, required=True, help="the new scene.yaml")


def run(arguments: argparse.Namespace) -> int:
    """Write the edited scene."""
    from texgs.scene.changes import apply_all
    from texgs.scene.session import Session

    require_scene(arguments.output)
    session = Session.open(arguments.scene)
    apply_all(session, arguments.overrides)
    with located(arguments.scene):
        _ = session.composition  # what is wrong with its models is told before anything is written
    print(session.save(arguments.output))
    return 0


def add_model_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the scene, the function, and the new file."""
    parser.add_argument("scene", type=Path, help="scene.yaml, whose key functions has functions to try")
    parser.add_argument("name", help="of the function, which becomes that of the model")
    option(parser, "--size", 400, "of the views, pixels")
    goal = parser.add_mutually_exclusive_group(required=True)
    goal.add_argument("--output", type=Path, help="the new scene.yaml; models are put beside it")
    goal.add_argument("--keep", action="store_true", help="put the function into the file of its data set")
    add_device(parser)


def run_model(arguments: argparse.Namespace) -> int:
    """Fit a model of a function that a scene tries, into the scene; or keep the function in a data set."""
    from texgs.config.kept_function import keep
    from texgs.core.check import torch_device
    from texgs.edit.function_model import models_of, overlap_of, tried, with_model
    from texgs.fields.surfels.model_file import write_model
    from texgs.scene.scene_file import read_scene, write_scene

    if arguments.keep:
        print(keep(read_scene(arguments.scene), arguments.name))
        return 0
    require_scene(arguments.output)
    scene, output = read_scene(arguments.scene), arguments.output
    require_name(arguments.name, "NAME")
    if arguments.size < 16:
        raise ArgumentError(f"--size: expected at least 16, got {arguments.size}")
    with located(arguments.scene):
        tf = tried(scene, arguments.name)
        *_, model = models_of(scene, arguments.name, torch_device(arguments.device), arguments.size)
    file = write_model(new_part_file("model", output.parent, output.stem, arguments.name), model)
    scene = with_model(scene, arguments.name, file, tf)
    print(f"{write_scene(output, scene)}{overlap_of(scene, arguments.name)}")
    return 0


def add_series_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the scene of one step, the files of all, and the folder of the series."""
    parser.add_argument("scene", type=Path, help="scene.yaml, whose volume is that of one of the steps")
    keys = "how the scene's volume was read, as for texgs new, such as up=+z; of a data set that is known"
    parser.add_argument("overrides", nargs="*", metavar="KEY=VALUE", help=keys)
    words = "volume of each step, a pattern such as 'step_*.nrrd' or 'visit_*/', or a file or folder with all"
    parser.add_argument("--files", nargs="+", required=True, metavar="FILE", help=words)
    parser.add_argument(
        "--output", type=Path, required=True, help="folder; the same again goes on where it stopped"
    )
    add_device(parser)


def run_series(arguments: argparse.Namespace) -> int:
    """Follow the models of a scene through the volumes of a series in time, with the same surfels and texels.

    `texgs edit time=3` shows a step of the new scene, `texgs render --path time` all of them.
    """
    from texgs.config.compose import compose
    from texgs.core.check import torch_device
    from texgs.edit.series import make_series
    from texgs.scene.scene_file import read_scene
    from texgs.volume.moments import matching

    require_only_files(arguments.files)
    with located("--files"):
        files = matching(arguments.files)
    words = [f"dataset.volume.{word.removeprefix('dataset.volume.')}" for word in arguments.overrides]
    settings = compose(("dataset.volume.generator=null", *words)).dataset.volume if words else None
    scene, device = read_scene(arguments.scene), torch_device(arguments.device)
    print(make_series(scene, files, arguments.output, device, settings))
    return 0


def add_segment_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what is clicked on, and how masks are found and lifted."""
    parser.add_argument("scene", type=Path, help="scene.yaml, a folder with one, or a model file")
    parser.add_argument("--model", help="name of the model; may be left out where there is one")
    parser.add_argument("--name", help="of the new segment")
    add_clicks(parser)
    parser.add_argument("--output", type=Path, help="the new scene.yaml; the segment's file is put beside it")
    parser.add_argument("--preview", type=Path, metavar="PNG", help="write the view with the mask, no scene")
    masks = "mobile_sam, sam_vit_h, a folder with a SAM of transformers, or grabcut, which needs no weights"
    option(parser, "--masks", "mobile_sam", masks)
    option(parser, "--vote", "contribution", "", choices=("contribution", "centre"))
    parser.add_argument("--threshold", type=float, help="of votes; default 0.5, of vote centre 0.7")
    parser.add_argument(
        "--connected", action="store_true", help="keep only the connected pieces that hold a point"
    )
    option(parser, "--views", 42, "number of views that vote, 10 f^2 + 2: 12, 42, 92, 162, ...")
    option(parser, "--size", 512, "of these views, pixels")
    add_lens(parser, "of the view clicked on", "default the width")
    add_device(parser)


def add_clicks(parser: argparse.ArgumentParser) -> None:
    """Add the view that is clicked on, and where."""
    parser.add_argument(
        "--view",
        type=numbers,
        default=(30.0, 20.0),
        metavar="AZIMUTH,POLAR",
        help="degrees, of the view clicked on (30,20): what texgs render shows of the model alone",
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


def run_segment(arguments: argparse.Namespace) -> int:
    """Segment a model of a scene by clicks on a view of it, so that the segment can be edited on its own."""
    from texgs.core.check import torch_device
    from texgs.core.image import write_png
    from texgs.edit.new_segment import clicked_model, model_name, new_segment, preview
    from texgs.models.sam import mask_model
    from texgs.scene.scene_file import read_scene, write_scene
    from texgs.volume.cameras import icosphere_of

    scene, device = read_scene(arguments.scene), torch_device(arguments.device)
    name = model_name(scene, arguments.model, "--model")
    require_output(arguments)
    lens = lens_of(arguments, scene.framed())
    clicks, masks = clicks_of(arguments, lens, device), mask_model(arguments.masks, device)
    if arguments.preview:
        model = clicked_model(scene, name, device)
        print(write_png(arguments.preview, preview(model, clicks, masks, scene.light)[1]))
        return 0
    output = arguments.output
    file = new_part_file("--name", output.parent, output.stem, name, arguments.name)
    made = new_segment(
        *(scene, f"{name}/{arguments.name}", clicks),
        [camera.to(device) for camera in icosphere_of(arguments.views, lens.square(arguments.size))],
        *(masks, file, {key: getattr(arguments, key) for key in KEPT}),
        vote=arguments.vote,
        threshold=arguments.threshold,
        connected=arguments.connected,
        title=f"segment {arguments.name}",
    )
    print(write_scene(arguments.output, made.scene), file, sep="\n")
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


def require_scene(output: Path) -> None:
    """Require the path of a scene file, so that no file of another kind is replaced."""
    if output.suffix not in SCENES or output.is_dir():
        raise ArgumentError(f"--output: expected a file that ends in .yaml, got {output}")
    if output.is_file() and b"texgs-scene" not in output.read_bytes():
        raise ArgumentError(f"--output: {output} is a file of another kind, which stays; choose another")
    require_own_place(output)
