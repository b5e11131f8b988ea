"""`texgs VERB`: picks the verb and turns errors into one sentence and an exit code."""

import argparse
import importlib
import io
import os
import re
import signal
import sys
from collections.abc import Sequence

from texgs import __version__
from texgs.cli.options import Parser
from texgs.core.errors import ArgumentError, TexgsError
from texgs.core.memory import as_out_of_memory, collect_rarely, keep_freed_memory, waiting
from texgs.core.names import close, require_scene
from texgs.edit.method import methods
from texgs.fields.kinds import kinds

try:
    from texgs.workflow.stage_table import STAGES
except TexgsError as error:  # in a file of the user's own
    print(f"texgs: {error}", file=sys.stderr)
    sys.exit(2)

NUMBER = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")  # such as -1e-3, of which argparse knows -90 alone
NUMBERS = re.compile(rf"(?!{NUMBER.pattern})-[\d.][-\d.,eE]*")  # such as -90,20
# Verb: what `texgs --help` says. Its module texgs.cli.VERB has `add_arguments(parser)` and `run(arguments)`.
# Verbs in the module of another have `add_VERB_arguments` and `run_VERB` there; those of stages share one.
SHARED = {"init": "new", "series": "model", "report": "tables", "votes": "study", "download": "weights"}
STAGE_VERBS = {stage.name: stage.help for stage in STAGES.values()}
FIRST_VERBS = {
    "init": "start a folder with configurations of your own",
    "new": "start a data set from a volume file of your own, with suggested transfer functions",
    "run": "run the workflow: from the volume to the report, whatever is not done yet",
    "view": "look at a scene and edit it in the browser",
    "edit": "change colours, opacities and lights of a scene",
    "render": "render a scene to PNG, GIF or MP4",
    "export": "export a scene or a model as Gaussians, points, a mesh or a compact file",
    "check": "check how far a scene is from its volume",
    "segment": "segment a model of a scene by clicks, to edit a part of it",
    "model": "fit a model of a transfer function that a scene tries, in about a minute",
    "series": "follow the models of a scene through the volumes of a series in time",
    "doctor": "show what is installed, what is missing and what to do about it",
}
LATER_VERBS = {
    "tables": "write the tables that metrics files hold",
    "report": "write one HTML file with the pictures, tables and provenance of all jobs",
    "study": "make a user study of edited scenes: a page for voters, and its key",
    "votes": "count the ballots of a user study",
    "download": "download a file and compare it with its checksum",
    "weights": "list pretrained weights, and download those that are named",
}
VERBS = {**FIRST_VERBS, **STAGE_VERBS, **LATER_VERBS}
if taken := STAGE_VERBS.keys() & {*FIRST_VERBS, *LATER_VERBS}:
    stage = STAGES[min(taken)]
    print(f"texgs: {stage.module}: STAGE has the name of the verb {stage.name}; rename it", file=sys.stderr)
    sys.exit(2)


def overview() -> argparse.ArgumentParser:
    """Return the parser that lists the verbs."""
    about = "Editable 3D scenes of textured 2D Gaussians from scientific volumes."
    top = Parser(prog="texgs", usage="texgs [-h] [--version] VERB ...", description=about)
    top.add_argument("--version", action="version", version=f"texgs {__version__}")
    others = {*kinds(), *(f"edit_{name}" for name, each in methods().items() if each.fields)} - {"surfels"}
    for title, names in {
        "everyday verbs": FIRST_VERBS,
        "results, studies and weights": LATER_VERBS,
        "steps of texgs run, one at a time": [name for name in STAGE_VERBS if name not in others],
        "steps of other fields and methods, to compare with": [
            name for name in STAGE_VERBS if name in others
        ],
    }.items():
        group = top.add_argument_group(title)
        for name in names:
            group.add_argument(name, nargs="?", help=VERBS[name])
    return top


def parser(verb: str) -> Parser:
    """Return the parser of a verb. Its module is imported here and must stay light: no torch at the top."""
    home = "stage" if verb in STAGE_VERBS else SHARED.get(verb, verb)
    module = importlib.import_module(f"texgs.cli.{home}")
    add, run = (f"add_{verb}_arguments", f"run_{verb}") if verb in SHARED else ("add_arguments", "run")
    about = getattr(module, run).__doc__ if verb in SHARED else module.__doc__
    if verb in STAGE_VERBS:
        about = f"{VERBS[verb][0].upper()}{VERBS[verb][1:]}."
    made = Parser(prog=f"texgs {verb}", description=about, conflict_handler="resolve")
    made._negative_number_matcher = NUMBER
    getattr(module, add)(made)
    made.set_defaults(verb=verb, run=getattr(module, run))
    return made


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """Return the arguments; KEY=VALUE may stand anywhere, also between and behind options."""
    verb, *words = argv or ["-"]
    if verb not in VERBS:
        if not verb.startswith("-"):
            raise ArgumentError(f"no such verb{close(verb, VERBS) or '; texgs --help lists all'}")
        overview().parse_args(argv)
        overview().error("the following arguments are required: VERB")
    if verb == "run" and words[:1] not in (["-h"], ["--help"]):
        return parser(verb).parse_args(["--", *words])  # its options are those of snakemake
    made = parser(verb)
    made.require_options(words)
    return made.parse_intermixed_args(join_numbers(words))


def join_numbers(words: Sequence[str]) -> list[str]:
    """Join options with several negative numbers to one word: argparse takes --view -90,20 for two options.

    It knows a single one, of which an option may have several, as --target -1 0 -1.
    """
    made: list[str] = []
    for word in words:
        if NUMBERS.fullmatch(word) and made and made[-1].startswith("--") and "=" not in made[-1]:
            made[-1] += f"={word}"
        else:
            made.append(word)
    return made


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb.

    Args:
        argv: words after `texgs`; default those of the process.

    Returns:
        Exit code: 0 done, 1 the verb says no, 2 a mistake of the user or a limit of the machine (told in one
        sentence on stderr), 130 interrupted, 141 nobody reads the output any more.
    """
    if argv is None:
        own_process()
    words = list(sys.argv[1:] if argv is None else argv)
    verb = next(iter(words), "")
    try:
        try:
            arguments = parse(words)
            if "scene" in arguments:
                require_scene(arguments.scene)  # here, as its own code takes a second to load
            with as_out_of_memory():
                return int(arguments.run(arguments))
        finally:
            sys.stdout.flush()
    except TexgsError as error:
        print(f"texgs {verb}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        goes_on = verb in STAGE_VERBS or verb in ("run", "series")
        end = "goes on with what is not done" if goes_on else "starts again"
        print(f"texgs {verb}: interrupted; the same command {end}", file=sys.stderr)
        return 130
    except BrokenPipeError:  # by `| head`; the rest of the buffers goes nowhere
        for stream in (sys.stdout, sys.stderr):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        return 141


def open_closed_streams() -> None:
    """Open closed streams, as after `>&-`, to nowhere: else other files get their numbers."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(number, True)
        setattr(sys, ("stdin", "stdout", "stderr")[number], os.fdopen(number, "rww"[number], closefd=False))
    os.close(number)


def own_process() -> None:
    """Set up the process."""
    open_closed_streams()
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C
    for stream in (sys.stdout, sys.stderr):  # letters that a terminal cannot show are escaped
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    os.environ.update(waiting())
    keep_freed_memory()
    collect_rarely()


if __name__ == "__main__":
    sys.exit(main())
