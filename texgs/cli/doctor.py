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
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from texgs.core.cache import cache_folder, weights_folder
from texgs.core.errors import TexgsError


@dataclass(frozen=True)
class Finding:
    """One line of the report."""

    name: str
    state: Literal["ok", "warning", "missing"]
    found: str
    advice: str = ""  # what to do; empty where nothing has to be done
    is_required: bool = False  # texgs cannot work without it


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
    except TexgsError as error:
        what, _, advice = str(error).partition("; ")
        return Finding(probe.__name__, "missing", what, advice, is_required=True)
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


def python() -> Finding:
    """Whether this Python is one texgs is tested with."""
    python = f"{platform.python_version()} on {platform.machine()} {platform.system()}"
    if (3, 11) <= sys.version_info[:2] <= (3, 13):
        return Finding("Python", "ok", python)
    return Finding("Python", "missing", python, "install Python 3.11 to 3.13", is_required=True)


def packages() -> Finding:
    """The packages that every stage needs: whether they are there, in the versions that texgs asks for."""
    from importlib import metadata

    from packaging.requirements import Requirement

    lacking = []
    for line in metadata.requires("texgs") or ():
        wanted = Requirement(line)
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
        return Finding("packages", "missing", ", ".join(lacking), "install texgs again", is_required=True)
    return Finding("packages", "ok", "all that texgs asks for")


def configuration() -> Finding:
    """The configuration, without which no stage runs, and where results go."""
    from texgs.config.compose import compose
    from texgs.config.project import folders

    results = Path(compose().results).absolute()
    existing = next(folder for folder in (results, *results.parents) if folder.exists())
    if not os.access(existing, os.W_OK):
        advice = "work in a folder that you can write to"
        return Finding(
            "configuration", "missing", f"{existing}: cannot write there", advice, is_required=True
        )
    return Finding("configuration", "ok", f"{' and '.join(map(str, folders()))}; results go to {results}")


def compiler() -> Finding:
    """The C++ compiler: needed to build from source only."""
    candidates = [os.environ.get("CXX", ""), "c++", "g++", "clang++", "cl"]
    path = next((path for name in candidates if name and (path := shutil.which(name))), None)
    if path is None:
        advice = "install g++ 11, clang++ 14 or Visual Studio 2022 to build texgs from source"
        return Finding("C++ compiler", "warning", "not found", advice)
    return Finding("C++ compiler", "ok", path)


def native() -> Finding:
    """The native library: whether it loads, and the instruction set it uses here."""
    try:
        from texgs.raster import native

        library = f"{native.instruction_set()}, {native.library_path()}"
    except ImportError as error:
        return Finding("native library", "missing", _sentence(error), "see torch below", is_required=True)
    except TexgsError as error:
        what, _, advice = str(error).partition("; ")
        return Finding("native library", "missing", what, advice, is_required=True)
    return Finding("native library", "ok", library)


def threads() -> Finding:
    """How many threads the native library uses, of how many processors."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        from texgs.raster import native

        used = native.threads()
    except (ImportError, TexgsError) as error:
        return Finding("threads", "warning", f"unknown, {_sentence(error)}")
    share = f"{used} of {available} processors"
    if used < available:
        return Finding("threads", "warning", share, "set OMP_NUM_THREADS or torch.set_num_threads to use all")
    return Finding("threads", "ok", share)


def torch() -> Finding:
    """The version of torch, and the GPU it sees."""
    try:
        import torch
    except (ImportError, OSError) as error:
        advice = "pip install torch"
        return Finding("torch", "missing", _sentence(error), advice, is_required=True)
    if torch.cuda.is_available():
        return Finding("torch", "ok", f"{torch.__version__}, {torch.cuda.get_device_name()}")
    if shutil.which("nvidia-smi"):
        advice = "install a CUDA build of torch to use this machine's GPU, see pytorch.org"
        return Finding("torch", "warning", f"{torch.__version__} does not see the GPU", advice)
    return Finding("torch", "ok", f"{torch.__version__}, no GPU, everything runs on the CPU")


def cuda() -> Finding:
    """The CUDA library: only of use with a GPU that torch sees."""
    advice = "only needed for a GPU: put nvcc (CUDA 12 or newer) on the PATH and install texgs again"
    try:
        from texgs.raster import native

        path = native.library_path("cuda")
        if not path.exists():
            return Finding("CUDA library", "missing", "not built", advice)
        return Finding("CUDA library", "ok", f"{native.instruction_set('cuda')}, {path}")
    except (ImportError, TexgsError) as error:
        return Finding("CUDA library", "missing", _sentence(error), advice)


def opengl() -> Finding:
    """Offscreen OpenGL, tried in a child process."""
    from texgs.volume.opengl import offscreen_opengl

    try:
        return Finding("offscreen OpenGL", "ok", offscreen_opengl())
    except TexgsError as error:
        trouble, _, advice = str(error).removeprefix("offscreen OpenGL: ").partition("; ")
        return Finding("offscreen OpenGL", "missing", trouble, f"only for views.mapper=vtk: {advice}")


def cache() -> Finding:
    """Whether the cache folder can be written to."""
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        advice = "set TEXGS_CACHE to a folder you can write to"
        return Finding("cache", "missing", f"{folder}: {error.strerror}", advice, is_required=True)
    return Finding("cache", "ok", str(folder))


def weights() -> Finding:
    """Weights of pretrained models that are on this machine; edits say what works without any."""
    from texgs.models.catalogue import CATALOGUE
    from texgs.models.weights import available

    try:
        there = [name for name in CATALOGUE if available(name)]
    except TexgsError as error:
        what, _, advice = str(error).partition("; ")
        return Finding("weights", "warning", what, advice)
    lacking = [name for name in CATALOGUE if name not in there]
    where = f"optional: `texgs weights NAME`, or put them into {weights_folder()}, or set TEXGS_WEIGHTS"
    if not there:
        return Finding("weights", "missing", f"none of {', '.join(lacking)}", where)
    state = f"{', '.join(there)}" + (f"; not {', '.join(lacking)}" if lacking else "")
    return Finding("weights", "ok", state, where if lacking else "")


def _sentence(error: BaseException) -> str:
    """The first line of an error's message."""
    return (str(error) or type(error).__name__).splitlines()[0]


PROBES = (python, packages, configuration, compiler, native, threads, torch, cuda, opengl, cache, weights)
