"""Show what texgs found on this machine, one line per thing, and what to do where something is missing.

With --experiment, show what a run of the workflow would find, what it would do, and about how long it takes.
"""

import argparse
import sys
from collections.abc import Callable, Iterable

from texgs.cli.probes import PROBES, Finding


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The run to look at, if any."""
    parser.add_argument("--experiment", metavar="NAME", help="file of conf/experiment, such as paper")
    parser.add_argument(
        "words", nargs="*", metavar="KEY=VALUE", help="configuration of the run, as for `texgs run`"
    )


def run(arguments: argparse.Namespace) -> int:
    """Print every finding as soon as it is known; 1 if something texgs cannot work without is missing."""
    if arguments.experiment or arguments.words:
        from texgs.workflow import forecast

        chosen = (f"experiment={arguments.experiment}",) if arguments.experiment else ()
        return forecast.show((*chosen, *arguments.words))
    return show(examine(probe) for probe in PROBES)


def examine(probe: Callable[[], Finding]) -> Finding:
    """What a probe found; one that raises is broken, and the others still have something to say."""
    try:
        return probe()
    except Exception as error:
        trouble = f"the probe failed with {type(error).__name__}: {error}"
        return Finding(probe.__name__, "missing", trouble, "install texgs again", is_required=True)


def show(findings: Iterable[Finding]) -> int:
    """Print findings; 1 if a required one is missing, else 0."""
    broken = []
    for finding in findings:
        advice = f" -> {finding.advice}" if finding.advice else ""
        print(f"{finding.state:8} {finding.name:16} {finding.found}{advice}", flush=True)
        if finding.is_required and finding.state == "missing":
            broken.append(finding.name)
    if broken:
        print(f"texgs cannot work yet: {', '.join(broken)}", file=sys.stderr)
    return 1 if broken else 0
