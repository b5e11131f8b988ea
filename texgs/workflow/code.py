"""Digest of the code a stage runs: its module and all modules of texgs that it imports, however deep.

Read from the source without importing it, see sources.py. The rest of texgs/workflow does not count. Code
that calls the native library has the digest of the C++ and CUDA sources in it; a module that reads files of
its package has these in it.
"""

from functools import cache
from pathlib import Path

from texgs.core.checksum import digest, sha256
from texgs.core.native_sources import library_sources
from texgs.workflow.sources import Sources

ROOT = Path(__file__).parents[2]
STAGES = "texgs.workflow.stages."
PLANNING = "texgs.workflow."  # what else is there decides settings and inputs, which jobs are known by anyway
NATIVE = "texgs.raster.native"  # the module that calls the native library
READS_DATA = b"importlib.resources"  # in modules that do
DATA = (".css", ".csv", ".html", ".j2", ".js", ".png", ".yaml")
SOURCES = Sources()


@cache
def code_digest(module: str) -> str:
    """Digest of a module such as ``texgs.volume.render`` and what it imports from texgs."""
    seen: dict[str, str] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        is_planning = name.startswith(PLANNING) and not name.startswith(STAGES)
        if name in seen or is_planning or (read := essence(name)) is None:
            continue
        seen[name], imported = read
        waiting += imported
    SOURCES.save()
    parts = [f"{name}\n{seen[name]}" for name in sorted(seen)]
    parts += [library_sources(ROOT / "texgs" / "raster")] if NATIVE in seen else []
    return digest("\n".join(parts))


@cache
def essence(module: str) -> tuple[str, tuple[str, ...]] | None:
    """Digest of what counts of a module, and what it imports; None for a name that is no module."""
    path = source(module)
    if path is None:
        return None
    text = path.read_bytes()
    what, *imported = SOURCES.of(text)
    return digest(what + data_beside(path)) if READS_DATA in text else what, tuple(imported)


def data_beside(path: Path) -> str:
    """Name the files beside a module and below that are no modules, with their checksums."""
    files = sorted(each for each in path.parent.rglob("*") if each.suffix in DATA)
    return "".join(f"{each.name}\n{sha256(each)}\n" for each in files)


def source(module: str) -> Path | None:
    """The file of a module of texgs; None for a name that is no module."""
    path = ROOT.joinpath(*module.split("."))
    candidates = (path.with_suffix(".py"), path / "__init__.py")
    return next((candidate for candidate in candidates if candidate.is_file()), None)
