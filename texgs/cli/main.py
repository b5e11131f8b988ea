"""`texgs VERB`: picks the verb and turns errors into one sentence and an exit code."""

import argparse
import importlib
import sys
from collections.abc import Sequence

from texgs import __version__
from texgs.core.errors import TexgsError

# Verb: what `texgs --help` says. Its module texgs.cli.VERB has `add_arguments(parser)` and `run(arguments)`.
VERBS = {
    "demo": "render a small built-in scene to a turntable",
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
        module = importlib.import_module(f"texgs.cli.{name}")
        verb = verbs.add_parser(name, help=summary, description=module.__doc__)
        module.add_arguments(verb)
        verb.set_defaults(run=module.run)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb.

    Args:
        argv: words after `texgs`; default those of the process.

    Returns:
        Exit code: 0 done, 1 the verb says no, 2 a mistake of the user or a limit of the machine (told in one
        sentence on stderr), 130 interrupted.
    """
    arguments = parser().parse_args(argv)
    try:
        return int(arguments.run(arguments))
    except TexgsError as error:
        print(f"texgs {arguments.verb}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"texgs {arguments.verb}: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
