"""Run the workflow for a configuration: from the volume to the report, whatever is not done yet.

Words with = choose the configuration, such as dataset=engine fit=quick views.width=400; all other words are
options and targets of snakemake, such as --dry-run or results/report.html.
`texgs views --help` lists all keys.
"""

import argparse
import logging
import os
import re
import shlex
import signal
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from functools import partialmethod
from itertools import pairwise
from pathlib import Path
from types import FrameType

from texgs.cli.options import Parser
from texgs.core.errors import ArgumentError
from texgs.core.names import close

INTERRUPTED = ": interrupted; "  # of `texgs.cli.main`: the end of a run says so by itself
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
            return  # snakemake is ending; a second exception would stop that half-way
        interruptions.append(True)
        logging.getLogger("snakemake.logging").setLevel(logging.CRITICAL)  # jobs that end now have no fault
        raise KeyboardInterrupt  # snakemake ends its jobs, and then itself as if one had failed

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
    try:
        from snakemake.cli import CliException, args_to_api, get_argument_parser, parse_args, parse_cores
        from snakemake.common import argparse as theirs
        from snakemake.exceptions import WorkflowError

        theirs.ArgumentParser.error = Parser.error
        sys.argv[:1] = ["snakemake"]  # what these parsers are of
        given, unknown = get_argument_parser().parse_known_intermixed_args(list(words))
        require_pairs([word for word in words if word in (*given.targets, *unknown)])
        require_free([word for word in words if word not in (*given.targets, *(given.config or ()))])
        require_targets(given.targets)
        chosen = [word for word in given.targets if WORD.fullmatch(word)]
        rest = [word for word in words if word not in chosen]
        sys.argv = ["snakemake", *rest]  # the Snakefile looks there
        if not unknown and {*(given.profile or ())} == {profile := os.environ.get("SNAKEMAKE_PROFILE")}:
            theirs.ArgumentParser.error = partialmethod(Parser.error, where=f"SNAKEMAKE_PROFILE={profile}: ")
        end = [*rest, "--"].index("--")
        parser, options = parse_args([*defaults(given), *rest[:end], *profile_of(given), *rest[end:]])
    except RuntimeError as error:  # it looks for its own configuration in the user's home
        raise ArgumentError(f"HOME: snakemake needs a home folder ({error}); set HOME to one") from error
    except (CliException, WorkflowError) as error:
        raise ArgumentError(f"{str(error).rstrip('. ')}; see snakemake --help") from error
    options.config = [*(options.config or ()), *overrides(chosen, options.config or ())]
    if options.cores is None and options.jobs is None:
        options.cores = parse_cores("all")
    with told_errors(given.targets):
        return bool(args_to_api(options, parser))


@contextmanager
def told_errors(targets: Sequence[str] = ()) -> Iterator[None]:
    """Raise one sentence for a place that snakemake cannot use, or a target that it does not know.

    It would print the one with a traceback, the other without the targets that there are.
    """
    from snakemake.api import SnakemakeApi
    from snakemake.exceptions import MissingRuleException

    printed = SnakemakeApi.print_exception

    def note(api: SnakemakeApi, error: Exception) -> None:
        unknown = targets if isinstance(error, MissingRuleException) else ()
        for target in (each for each in unknown if f" {each} " in str(error)):
            raise ArgumentError(no_target(target)) from error
        if isinstance(error, BrokenPipeError):  # as `| head` leaves it
            raise error
        if isinstance(error, OSError) and error.strerror:
            place = error.filename or f"{tempfile.gettempdir()}, the temporary folder"
            raise ArgumentError(
                f"{place}: the run cannot work there ({error.strerror}); make room, or choose another folder"
            ) from error
        printed(api, error)

    SnakemakeApi.print_exception = note
    try:
        yield
    finally:
        SnakemakeApi.print_exception = printed


def no_target(word: str) -> str:
    """Return that a word is no target, with the name that is most like it, or all of them."""
    names = target_names()
    hint = close(word, names) or f"; expected {', '.join(names)} or a file that the run makes"
    return f"{word}: no such target{hint}"


def target_names() -> list[str]:
    """Return the names of what a run can be asked to make."""
    from texgs.workflow.stage_table import RULES

    own = (each.target for each in RULES.values() if each.target)
    return [*dict.fromkeys(("all", "downloads", "tables", "report", *own))]


def require_targets(words: Sequence[str]) -> None:
    """Require that no word is a rule for one result: a target names those of all data sets."""
    from texgs.workflow.stage_table import RULES

    for word in words:
        if word in ("download", *RULES) and word not in target_names():
            raise ArgumentError(no_target(word))


def require_pairs(words: Sequence[str]) -> None:
    """Require that none of the words is the key of a choice alone, as in `dataset engine`, `--fit quick`."""
    from texgs.workflow.plan import GROUPS

    for word, after in pairwise((*words, "NAME")):
        if (key := word.removeprefix("--")) in GROUPS:
            raise ArgumentError(f"{word}: expected {key}={after} in one word, got {word} alone")


def require_free(words: Sequence[str]) -> None:
    """Require that no option has taken an override for one of its values, as `--set-threads` takes many."""
    from texgs.config.schema import Config
    from texgs.workflow.plan import GROUPS

    keys = {*GROUPS, *(each.name for each in fields(Config))}
    for word in filter(WORD.fullmatch, words):
        key, _, value = word.lstrip("+~").partition("=")
        is_of_rule = key in GROUPS and value.isdecimal()  # threads, such as edit=2
        if key.partition(".")[0] in keys and not is_of_rule:
            raise ArgumentError(
                f"{word}: the option before takes it for a value of its own; put {word} first"
            )


def defaults(given: argparse.Namespace) -> list[str]:
    """Return options that hold where the user says nothing else, such as the Snakefile of texgs.

    A dry run counts jobs by their rules; `--quiet host` lists each.
    """
    from texgs.config.project import SNAKEFILE

    quiet = ["--quiet", "host", "reason", "rules"] if given.dryrun and given.quiet is None else []
    return [*quiet, "--snakefile", str(SNAKEFILE)]


def profile_of(given: argparse.Namespace) -> list[str]:
    """Return the option for a profile of texgs: the local one, or that of which only the name is given."""
    from texgs.config.project import PROFILES

    option, name = "--workflow-profile", given.workflow_profile
    if name is None:
        return [] if given.profile else [option, str(PROFILES / "local")]
    if name == "none" or Path(name).exists():
        return []
    if not (PROFILES / name).is_dir():
        known = ", ".join(sorted(each.name for each in PROFILES.iterdir()))
        raise ArgumentError(f"{option}: expected {known} or a folder, got {name}")
    return [option, str(PROFILES / name)]


def overrides(words: Sequence[str], config: Sequence[str]) -> list[str]:
    """Return the words as one entry of snakemake's `--config`, which reads values as YAML."""
    import yaml
    from snakemake.cli import parse_config

    try:
        parse_config(config)
    except ValueError as error:
        given = " ".join(config)
        raise ArgumentError(f"--config: expected KEY=VALUE, such as fit=quick, got {given}") from error
    if not words:
        return []
    if any(entry.startswith("overrides=") for entry in config):
        raise ArgumentError('--config overrides="...": give its words to texgs run itself')
    text = yaml.safe_dump(shlex.join(words), default_style='"', allow_unicode=True, width=10**9)
    return [f"overrides= {text.strip()} "]  # in spaces: snakemake strips quotes from the ends


def tell_last_words(logs: Iterable[Path]) -> None:
    """Print the last line of each log on stderr, but of jobs that were interrupted; the same one once."""
    for line in dict.fromkeys(filter(None, map(last_line, logs))):
        print(line, file=sys.stderr)


def last_line(log: Path) -> str:
    """Return the last line with text of a log; empty where there is none, or the job was interrupted."""
    text = log.read_text(encoding="utf-8", errors="replace") if log.is_file() else ""
    line = text.rstrip().rpartition("\n")[2]
    return "" if INTERRUPTED in line else line
