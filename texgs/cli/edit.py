"""Edit a scene by words such as TF01.palette=#ff8800 and write it to a new file; nothing is trained."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The scene, the edits, the new file."""
    parser.add_argument("scene", type=Path, help="scene.yaml")
    parser.add_argument(
        "overrides",
        nargs="*",
        metavar="KEY=VALUE",
        help="MODEL.KEY=VALUE with visible, palette (r,g,b from 0 to 1, or #rrggbb), opacity, ambient, "
        "diffuse, specular, shininess (factors), texture (a file) or file (another model); light=headlight "
        "or light=AZIMUTH,POLAR; background=#rrggbb; MODEL.KEY= takes an edit back; MODEL/SEGMENT.KEY=VALUE "
        "edits a segment, MODEL/SEGMENT=FILE adds one from a file and MODEL/SEGMENT= removes it",
    )
    parser.add_argument("--output", type=Path, required=True, help="the new scene.yaml")


def run(arguments: argparse.Namespace) -> int:
    """Write the edited scene."""
    from texgs.scene.changes import apply_all
    from texgs.scene.session import Session

    session = Session.open(arguments.scene)
    apply_all(session, arguments.overrides)
    if any(word.partition("=")[0].endswith(".file") for word in arguments.overrides):
        _ = session.composition  # which the new model may not go into
    print(session.save(arguments.output))
    return 0
