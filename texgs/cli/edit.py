"""Edit a scene by words such as TF01.palette=#ff8800 and write it to a new file; nothing is trained."""

from __future__ import annotations

import argparse
from pathlib import Path

from texgs.cli.options import require_own_place
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.names import SCENES
from texgs.fields.part_edit import require_part_key


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the scene, the edits, and the new file."""
    parser.add_argument("scene", type=Path, help="scene.yaml, a folder with one, or a model file")
    parser.add_argument(
        "overrides",
        nargs="*",
        metavar="KEY=VALUE",
        help="MODEL.KEY=VALUE with visible, palette (r,g,b from 0 to 1, #rrggbb or a name such as red), "
        "opacity, ambient, diffuse, specular, shininess (factors), tint (a colour, of highlights), "
        "texture (a file) or file (another model); light=headlight or light=AZIMUTH,POLAR; "
        "shadows=SHARE (0 to 1) of the light, and occlusion=SHARE of ambient light, that matter takes away; "
        "reach=DISTANCE (world units) within which matter hides ambient light; background=COLOUR; time=STEP; "
        "cut=AXIS,POSITION (x, -x, y, ...; world units, or samples as in 64v; or R, A, S, L, P, "
        "I, X, Y, Z, of the volume's file, in its unit, as in S,-12mm) or "
        "cut=NX,NY,NZ,OFFSET adds a plane, cut.1=... replaces it, cut= takes all back; "
        "cut.box=X0,Y0,Z0,X1,Y1,Z1; cut.faces=shaded, unlit or slice; cut.window=LOW,HIGH, "
        "values of slices in black and in white; marker=TEXT@X,Y,Z and distance=X,Y,Z:X,Y,Z, in the space "
        "and unit of the volume's file, marker=none takes all away; MODEL.KEY= takes an edit back; "
        "MODEL/SEGMENT.KEY=VALUE edits a segment, MODEL/SEGMENT=FILE adds one from a file and MODEL/SEGMENT= "
        "removes it",
    )
    parser.add_argument("--output", type=Path, required=True, help="the new scene.yaml")


def run(arguments: argparse.Namespace) -> int:
    """Write the edited scene."""
    for word in arguments.overrides:  # before torch, which takes a second to load
        with errors_at(word):
            require_part_key(word)
    require_scene(arguments.output)
    from texgs.scene.changes import apply_all
    from texgs.scene.session import Session

    session = Session.open(arguments.scene)
    apply_all(session, arguments.overrides)
    with errors_at(arguments.scene):
        _ = session.composition  # raises what is wrong with its models, before anything is written
    print(session.save(arguments.output))
    return 0


def require_scene(output: Path) -> None:
    """Require the path of a scene file, so that no file of another kind is replaced."""
    if output.suffix not in SCENES or output.is_dir():
        raise ArgumentError(f"--output: expected a file that ends in .yaml, got {output}")
    if output.is_file() and b"texgs-scene" not in output.read_bytes():
        raise ArgumentError(f"--output: {output} is a file of another kind, which stays; choose another")
    require_own_place(output)
