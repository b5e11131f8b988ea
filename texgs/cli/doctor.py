"""Show what texgs found on this machine, one line per thing, and what to do where something is missing.

With --experiment, show what a run of the workflow would find, what it would do, and about how long it takes.
"""

import argparse
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Literal

from texgs.core.cache import cache_folder, weights_folder
from texgs.core.errors import TexgsError, first_line
from texgs.core.native_sources import CUDA_ADVICE

AGAIN = "install texgs again"


@dataclass(frozen=True)
class Finding:
    """The result of a probe."""

    state: Literal["ok", "warning", "missing"]
    found: str
    advice: str = ""  # what to do; empty where nothing has to be done
    is_broken: bool = False  # the probe itself


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the run to look at, if any."""
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
    return show((name, examine(probe)) for name, probe in PROBES.items())


def examine(probe: Callable[[], Finding]) -> Finding:
    """Return what a probe finds. One that raises does not stop the others."""
    try:
        return probe()
    except TexgsError as error:
        return finding_of(error)
    except ImportError as error:
        return Finding("missing", first_line(error), "pip install torch")
    except Exception as error:
        return Finding("missing", f"the probe failed with {type(error).__name__}: {error}", AGAIN, True)


def finding_of(error: TexgsError) -> Finding:
    """Return the finding of an error, whose message is `what; what to do`."""
    what, _, advice = str(error).partition("; ")
    return Finding("missing", what, advice)


def show(findings: Iterable[tuple[str, Finding]]) -> int:
    """Print findings by name; return 1 if something is missing that texgs cannot work without, else 0."""
    broken = []
    for name, finding in findings:
        advice = f" -> {finding.advice}" if finding.advice else ""
        print(f"{finding.state:8} {name:16} {finding.found}{advice}", flush=True)
        if finding.state == "missing" and (name in REQUIRED or finding.is_broken):
            broken.append(name)
    if broken:
        print(f"texgs cannot work yet: {', '.join(broken)}", file=sys.stderr)
    return 1 if broken else 0


def python() -> Finding:
    """Find out whether this Python is one texgs is tested with."""
    python = f"{platform.python_version()} on {platform.machine()} {platform.system()}"
    if (3, 11) <= sys.version_info[:2] <= (3, 14):
        return Finding("ok", python)
    return Finding("missing", python, "install Python 3.11 to 3.14")


def packages() -> Finding:
    """Find out whether the required packages are there, in versions that texgs asks for."""
    from packaging.requirements import Requirement

    lacking = []
    for wanted in map(Requirement, metadata.requires("texgs") or ()):
        if wanted.marker is not None and not wanted.marker.evaluate({"extra": ""}):
            continue
        try:
            installed = metadata.version(wanted.name)
        except metadata.PackageNotFoundError:
            lacking.append(f"no {wanted.name}")
            continue
        if not wanted.specifier.contains(installed, prereleases=True):
            lacking.append(f"{wanted.name} {installed}, expected {wanted.specifier}")
    if lacking:
        return Finding("missing", ", ".join(lacking), AGAIN)
    return Finding("ok", "all that texgs asks for")


def configuration() -> Finding:
    """Find the configuration, without which no stage runs, and where results go."""
    from texgs.config.compose import compose
    from texgs.config.project import folders

    results = Path(compose().results).absolute()
    existing = next(folder for folder in (results, *results.parents) if folder.exists())
    if not os.access(existing, os.W_OK):
        advice = "work in a folder that you can write to"
        return Finding("missing", f"{existing}: cannot write there", advice)
    return Finding("ok", f"{' and '.join(map(str, folders()))}; results go to {results}")


def compiler() -> Finding:
    """Find the C++ compiler, which is needed to build from source only."""
    candidates = [os.environ.get("CXX", ""), "c++", "g++", "clang++", "cl"]
    path = next((path for name in candidates if name and (path := shutil.which(name))), None)
    if path is None:
        advice = "install g++ 11, clang++ 14 or Visual Studio 2022 to build texgs from source"
        return Finding("warning", "not found", advice)
    return Finding("ok", path)


def native() -> Finding:
    """Find out whether the native library loads, and the instruction set it uses here."""
    from texgs.raster import native

    return Finding("ok", f"{native.instruction_set()}, {native.library_path()}")


def threads() -> Finding:
    """Find out how many threads the native library uses, of how many processors."""
    from texgs.raster import native

    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    used = native.threads()
    share = f"{used} of {available} processors"
    if used < available:
        return Finding("warning", share, "set OMP_NUM_THREADS or torch.set_num_threads to use all")
    return Finding("ok", share)


def torch() -> Finding:
    """Find the version of torch, and the GPU it sees."""
    import torch

    if torch.cuda.is_available():
        return Finding("ok", f"{torch.__version__}, {torch.cuda.get_device_name()}")
    if shutil.which("nvidia-smi"):
        advice = "install a CUDA build of torch to use this machine's GPU, see pytorch.org"
        return Finding("warning", f"{torch.__version__} does not see the GPU", advice)
    return Finding("ok", f"{torch.__version__}, no GPU, everything runs on the CPU")


def cuda() -> Finding:
    """Find the CUDA library, which is only of use with a GPU that torch sees."""
    try:
        from texgs.raster import native

        path = native.library_path("cuda")
        if not path.exists():
            return Finding("missing", "not built", f"only needed for a GPU: {CUDA_ADVICE}")
        return Finding("ok", f"{native.instruction_set('cuda')}, {path}")
    except (ImportError, TexgsError) as error:
        return Finding("missing", first_line(error), f"only needed for a GPU: {CUDA_ADVICE}")


def opengl() -> Finding:
    """Try offscreen OpenGL in a child process."""
    from texgs.volume.opengl import offscreen_opengl

    try:
        return Finding("ok", offscreen_opengl())
    except TexgsError as error:
        trouble, _, advice = str(error).removeprefix("offscreen OpenGL: ").partition("; ")
        return Finding("missing", trouble, f"only for views.renderer=vtk: {advice}")


def cache() -> Finding:
    """Find out whether the cache folder can be written to."""
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return Finding("ok", str(folder))
    except OSError as error:
        advice = "set TEXGS_CACHE to a folder you can write to"
        return Finding("missing", f"{folder}: {error.strerror}", advice)


def weights() -> Finding:
    """Find weights of pretrained models on this machine; edits say what works without any."""
    from texgs.models.catalogue import CATALOGUE
    from texgs.models.weights import find, title_of

    try:
        there = {name: title_of(name) for name in CATALOGUE if find(name)}
    except TexgsError as error:
        return replace(finding_of(error), state="warning")
    lacking = ", ".join(name for name in CATALOGUE if name not in there)
    where = f"optional: `texgs weights NAME`, or put them into {weights_folder()}, or set TEXGS_WEIGHTS"
    if not there:
        return Finding("missing", f"none of {lacking}", where)
    state = f"{', '.join(there.values())}; not {lacking}" if lacking else ", ".join(there.values())
    return Finding("ok", state, where if lacking else "")


PROBES = {
    "Python": python,
    "packages": packages,
    "configuration": configuration,
    "C++ compiler": compiler,
    "native library": native,
    "threads": threads,
    "torch": torch,
    "CUDA library": cuda,
    "offscreen OpenGL": opengl,
    "cache": cache,
    "weights": weights,
}
REQUIRED = {"Python", "packages", "configuration", "native library", "torch", "cache"}
