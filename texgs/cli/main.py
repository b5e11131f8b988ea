"""`texgs VERB`: picks the verb and turns errors into one sentence and an exit code."""

import argparse
import importlib
import signal
import sys
from collections.abc import Sequence

from texgs import __version__
from texgs.core.errors import TexgsError
from texgs.core.memory import keep_freed_memory, told

# Verb: what `texgs --help` says. Its module texgs.cli.VERB has `add_arguments(parser)` and `run(arguments)`;
# the verbs of stages share the module texgs.cli.stage.
STAGE_VERBS = {
    "volume": "make or read the volume of a data set, and check it",
    "transfer": "plot the histogram with the basic transfer functions, and export these",
    "views": "render the training and test views of basic transfer functions",
    "sheet": "show views on one contact sheet",
    "surfels": "seed surfels and fit them with spherical harmonics",
    "shading": "fit relightable surfels with Blinn-Phong shading",
    "texture": "give relightable surfels textures",
    "figure": "show a fit beside test views, with its maps",
    "compose": "make one scene of the basic models of a data set",
    "pse": "edit colours, opacities and lights of a scene beside those of its volume",
    "timing": "measure how long frames of a scene and of its volume take",
    "edit_image": "give a scene the style of a picture",
    "edit_text": "give a scene the look that an instruction asks for",
    "edit_segment": "make a segment of a model of a scene, by clicks of the configuration",
    "edit_metrics": "measure an edited scene: CLIP, style, consistency, time, size",
}
VERBS = {
    "new": "start a data set from a volume file of your own, with suggested transfer functions",
    **STAGE_VERBS,
    "edit": "change colours, opacities and lights of a scene",
    "segment": "segment a model of a scene by clicks, to edit a part of it",
    "render": "render a scene to PNG, GIF or MP4",
    "export": "export a scene or a model as Gaussians, points, a mesh or a compact file",
    "tables": "write the tables that metrics files hold",
    "report": "write one HTML file with the pictures, tables and provenance of all jobs",
    "download": "download a file and compare it with its checksum",
    "weights": "list pretrained weights, and download those that are named",
    "doctor": "show what is installed, what is missing and what to do about it",
}


def parser() -> argparse.ArgumentParser:
    """The parser of all verbs. Their modules are imported here and must stay light: no torch at the top."""
    top = argparse.ArgumentParser(
        prog="texgs",
        description="Editable 3D scenes of textured 2D Gaussians from scientific volumes.",
    )
    top.add_argument("--version", action="version", version=f"texgs {__version__}")
    verbs = top.add_subparsers(dest="verb", metavar="VERB", required=True)
    for name, summary in VERBS.items():
        module = importlib.import_module(f"texgs.cli.{'stage' if name in STAGE_VERBS else name}")
        about = f"{summary[0].upper()}{summary[1:]}." if name in STAGE_VERBS else module.__doc__
        verb = verbs.add_parser(name, help=summary, description=about, conflict_handler="resolve")
        module.add_arguments(verb)
        verb.set_defaults(run=module.run)
    return top


def parse(argv: Sequence[str] | None) -> argparse.Namespace:
    """The arguments; KEY=VALUE may stand anywhere, also behind options, where argparse alone gives up."""
    top = parser()
    arguments, rest = top.parse_known_args(argv)
    overrides: list[str] | None = getattr(arguments, "overrides", None)
    if rest and (overrides is None or any(word.startswith("-") for word in rest)):
        top.error(f"unrecognized arguments: {' '.join(rest)}")
    if rest:
        arguments.overrides = [*(overrides or ()), *rest]
    return arguments


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb.

    Args:
        argv: words after `texgs`; default those of the process.

    Returns:
        Exit code: 0 done, 1 the verb says no, 2 a mistake of the user or a limit of the machine (told in one
        sentence on stderr), 130 interrupted.
    """
    arguments = parse(argv)
    if argv is None:  # a process of its own: told to end, it ends as if interrupted, and its run as killed
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        keep_freed_memory()
    try:
        with told():
            return int(arguments.run(arguments))
    except TexgsError as error:
        print(f"texgs {arguments.verb}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"texgs {arguments.verb}: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
