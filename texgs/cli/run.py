"""Run the workflow for a configuration: from the volume to the report, whatever is not done yet.

Words with = choose the configuration, such as dataset=engine fit=quick views.width=400; all other words are
options and targets of snakemake, such as --dry-run or results/report.html.
`texgs views --help` lists all keys.
"""

import argparse
import logging
import re
import signal
import sys
from collections.abc import Sequence
from dataclasses import fields
from itertools import pairwise, takewhile
from pathlib import Path
from types import FrameType

from texgs.core.errors import ArgumentError
from texgs.core.names import close

# Hydra's words: key=value, +key=value to add a key, ~key to take one away. Paths of targets have a slash.
WORD = re.compile(r"(\+{0,2}[A-Za-z_][\w.@-]*=.*|~[A-Za-z_][\w.@-]*(=.*)?)", re.DOTALL)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add whatever snakemake takes."""
    parser.add_argument(
        "words",
        nargs="*",
        metavar="KEY=VALUE, OPTION or TARGET",
        help="see snakemake --help; the profile is `local` unless --workflow-profile says otherwise",
    )


def run(arguments: argparse.Namespace) -> int:
    """Call snakemake in this process; its exit code."""
    interruptions = list[bool]()

    def note(_signal: int, _frame: FrameType | None) -> None:
        if interruptions:
            return  # a second exception would interrupt the end of snakemake
        interruptions.append(True)
        logging.getLogger("snakemake.logging").setLevel(logging.CRITICAL)  # jobs that end now have not failed
        raise KeyboardInterrupt  # snakemake ends its jobs, then itself, as after a failure

    before = signal.signal(signal.SIGINT, note)
    try:
        is_done = snakemake(arguments.words)
    finally:
        signal.signal(signal.SIGINT, before)
    if interruptions:
        raise KeyboardInterrupt
    return 0 if is_done else 1


def snakemake(words: Sequence[str]) -> bool:
    """Run the workflow of texgs in this process; return whether it ended well."""
    require_composed(words)
    from texgs.cli.snakemake import execute, option_errors, overrides, parser_of
    from texgs.config.project import no_project

    with option_errors():
        parser = parser_of()
        given, unknown = parser.parse_known_intermixed_args(list(words))
        require_pairs([word for word in words if word in (*given.targets, *unknown)])
        if unknown:
            parser.error(f"unrecognized arguments: {' '.join(unknown)}")
        require_free([word for word in words if word not in (*given.targets, *(given.config or ()))])
        chosen = [word for word in given.targets if WORD.fullmatch(word)]
        targets = [word for word in given.targets if word not in chosen]
        require_targets(targets)
        rest = [word for word in words if word != "--"]
        for word in given.targets:
            rest.remove(word)
        if outside := no_project():
            print(f"texgs: {outside}; results are written here", file=sys.stderr)
        if (profiles := profiles_of(given)) and (given.profile or given.workflow_profile):
            print(f"Using profile {' and '.join(profiles)} for options that are not given", file=sys.stderr)
        options = parser_of(profiles).parse_args([*defaults(given), *rest])
    options.targets = targets
    options.config = [*(options.config or ()), *overrides(chosen, options.config or ())]
    sys.argv = ["snakemake", *rest]  # the Snakefile looks there
    is_quiet = given.quiet or "all" in map(str, options.quiet or ())  # profiles of texgs are so in parts
    asked = (is_quiet, options.verbose, options.dryrun, options.logger, options.printshellcmds)
    options.verbose = False  # it asks for Snakemake's log, whose own `verbose` is for its developers
    return execute(options, own_log=not any(asked))


def require_composed(words: Sequence[str]) -> None:
    """Compose the words, where none may be the value of an option: Snakemake takes long and writes a log."""
    from texgs.workflow.cases import split_aimed
    from texgs.workflow.sweep import as_sweep

    chosen = [*takewhile(WORD.fullmatch, words)]
    if chosen and not any(map(WORD.fullmatch, words[len(chosen) :])):
        _ = split_aimed(as_sweep(tuple(chosen)))[0].config


def target_names() -> list[str]:
    """Return the names of targets."""
    from texgs.workflow.stage_table import RULES

    own = (each.target for each in RULES.values() if each.target)
    return [*dict.fromkeys(("all", "downloads", "tables", "report", *own))]


def require_targets(words: Sequence[str]) -> None:
    """Require names of targets or paths of files."""
    names = target_names()
    for word in words:
        if word not in names and "/" not in word:
            hint = close(word, names) or f"; expected {', '.join(names)} or the path of a file of the run"
            raise ArgumentError(f"{word}: no such target{hint}")


def require_pairs(words: Sequence[str]) -> None:
    """Refuse keys of choices without `=`, as in `dataset engine` or `--fit quick`."""
    from texgs.workflow.plan import GROUPS

    for word, after in pairwise((*words, "NAME")):
        if (key := word.removeprefix("--")) in GROUPS:
            raise ArgumentError(f"{word}: expected {key}={after} in one word, got {word} alone")


def require_free(words: Sequence[str]) -> None:
    """Refuse an override that an option such as `--set-threads` has taken for a value."""
    from texgs.config.schema import Config
    from texgs.workflow.plan import GROUPS

    keys = {*GROUPS, *(each.name for each in fields(Config))}
    for word in filter(WORD.fullmatch, words):
        key, _, value = word.lstrip("+~").partition("=")
        is_threads = value.isdecimal() and "." not in key  # of a rule, such as edit=2
        if key.partition(".")[0] in keys and not is_threads:
            raise ArgumentError(
                f"{word}: the option before takes it for a value of its own; put {word} first"
            )


def defaults(given: argparse.Namespace) -> list[str]:
    """Return default options, such as the Snakefile of texgs.

    A dry run counts jobs by their rules; `--quiet host` lists each.
    """
    from texgs.config.project import SNAKEFILE

    quiet = ["--quiet", "host", "reason", "rules"] if given.dryrun and given.quiet is None else []
    return [*quiet, "--snakefile", str(SNAKEFILE)]


def profiles_of(given: argparse.Namespace) -> list[str]:
    """Return the folders of profiles: the given ones, and one of texgs, by default `local`."""
    from texgs.config.project import PROFILES

    own = [each for each in dict.fromkeys(given.profile or ()) if each != "none"]
    name = given.workflow_profile
    if name == "none" or (name is None and given.profile):
        return own
    if name is not None and Path(name).exists():
        return [*own, name]
    if not (folder := PROFILES / (name or "local")).is_dir():
        known = ", ".join(sorted(each.name for each in PROFILES.iterdir()))
        raise ArgumentError(f"--workflow-profile: expected {known} or a folder, got {name}")
    return [*own, str(folder)]
