"""Where numbers come from: what ran, on what, from which source and settings."""

import getpass
import os
import platform
import re
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from texgs import __version__
from texgs.core.memory import MIB, peak_memory
from texgs.edit.method import NO_METHOD
from texgs.models.weights import title_of

PACKAGES = (  # whose code decides results
    *("torch", "numpy", "scipy", "kornia", "opencv-python-headless", "pillow", "matplotlib", "av"),
    *("vtk", "pyvista", "pynrrd", "nibabel", "tifffile", "safetensors", "transformers", "diffusers"),
)


def record(
    settings: Mapping[str, Any], identity: Mapping[str, Any], made_from: Mapping[str, str], seconds: float
) -> dict[str, Any]:
    """Return where and how the result of a job came about, from its settings and identity.

    `made_from` names its inputs that are files of other results, from the folder of the job.
    """
    return {
        **facts(settings),
        "stand_in": settings.get("stand_in", ""),
        "seconds": seconds,
        "peak_memory_mib": peak_memory() / MIB,
        "device": device(settings),
        "config_sha": identity["settings"],
        "code_sha": identity["code"],
        "git_sha": git_revision(),
        "inputs": identity["inputs"],
        "made_from": made_from,
        "weights": {title_of(name): sha for name, sha in settings.get("weights", {}).items()},
        "versions": versions(),
        "machine": machine(),
    }


def facts(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return what tells a job from others: its stage, data set, recipe of the fit, edit and seed."""
    told = {key: settings[key] for key in ("stage", "dataset", "tf") if key in settings}
    fit = settings.get("fit", {})
    if "variant" in fit:
        names = {"recipe": "name", "recipe_changed": "changed", "fit_seed": "seed"}
        told |= {name: fit[names.get(name, name)] for name in (*names, "field", "variant", "sweep")}
    if "edit" in settings:
        told["edit"] = settings["edit"]["name"]
    return {**told, "seed": seed(settings)}


def device(settings: Mapping[str, Any]) -> str:
    """Return what did the work: of jobs with a fit what showed its scene, of others what rendered the volume.

    Some jobs of fits on a GPU do not use it, and then have none.
    """
    renderer = settings.get("views", {}).get("renderer")
    kind = settings.get("fit", {}).get("device") or {"gpu": "cuda", "vtk": "VTK"}.get(renderer)
    torch = sys.modules.get("torch")
    if kind == "cuda" and torch and torch.cuda.is_initialized():
        return str(torch.cuda.get_device_name())
    return "VTK" if kind == "VTK" else f"{platform.machine()} CPU"


def seed(settings: Mapping[str, Any]) -> int | None:
    """Return the seed of the stage's random numbers, where it has one."""
    if settings.get("look", NO_METHOD) != NO_METHOD:
        return int(settings["look_seed"])
    parts = [settings.get(name, {}) for name in ("edit", "fit", "volume")]
    return next((part["seed"] for part in parts if "seed" in part), None)


def versions() -> dict[str, str]:
    """Return versions of Python, texgs and what results depend on most."""
    versions = {"python": platform.python_version(), "texgs": __version__}
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            versions[package] = version(package)
    return versions


def machine() -> dict[str, Any]:
    """Return what else decides the last bits of results: processor, instruction sets, BLAS and threads.

    Of torch and numpy only what the job has loaded.
    """
    facts: dict[str, Any] = {"system": platform.platform(), "cores": os.cpu_count()}
    if torch := sys.modules.get("torch"):
        facts |= {"threads": torch.get_num_threads(), "torch_cpu": torch.backends.cpu.get_cpu_capability()}
        blas = re.search(r"\bBLAS_INFO=([^\s,]*)", torch.__config__.show())
        facts["torch_blas"] = blas and blas[1]
    if numpy := sys.modules.get("numpy"):
        facts["numpy_blas"] = numpy.show_config(mode="dicts")["Build Dependencies"]["blas"].get("name")
    native = sys.modules.get("texgs.raster.native")
    if native and native.library_path().exists():
        facts["texgs_cpu"] = native.instruction_set()
    return facts


def user() -> str:
    """Return who runs this; a number where the system has no name for it."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return str(os.getuid())


@cache
def git_revision() -> str:
    """Return the commit of the source tree, "+" after it where files differ; "unknown" outside a clone."""
    folder = Path(__file__).parents[2]
    if not (folder / ".git").exists():  # a wheel may be installed inside of the clone of something else
        return "unknown"
    command = ["git", "-C", str(folder), "describe", "--always", "--abbrev=12", "--dirty=+", "--exclude=*"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=10)
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return done.stdout.strip()
