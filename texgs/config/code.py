"""Digest of the code a stage runs: its module and all modules of texgs that it imports, however deep.

Read from the source without importing it, see sources.py. Code that calls the native library has the digest
of the C++ and CUDA sources in it; a module that reads texts of its package has these in it.
"""

import ctypes
import sys
from functools import cache
from pathlib import Path
from typing import Any

from texgs.config.native_sources import native_digest
from texgs.config.sources import PACKAGE, Sources, digest

ROOT = Path(__file__).parents[2]
NATIVE = "texgs.raster.native"  # the module that calls the native library
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")  # of native libraries
READS_TEXTS = b"importlib.resources"  # in modules that do
TEXTS = (".css", ".csv", ".html", ".j2", ".js", ".yaml")
SOURCES = Sources()


@cache
def code_digest(module: str) -> str:
    """Digest of a module such as ``texgs.volume.render`` and what it imports from texgs."""
    seen: dict[str, str] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in seen or (read := essence(name)) is None:
            continue
        seen[name], imported = read
        waiting += imported
    SOURCES.save()
    parts = [f"{name}\n{seen[name]}" for name in sorted(seen)]
    return digest("\n".join([*parts, library_sources()] if NATIVE in seen else parts))


@cache
def essence(module: str) -> tuple[str, tuple[str, ...]] | None:
    """Digest of what counts of a module, and what it imports; None for a name that is no module."""
    path = source(module)
    if path is None:
        return None
    text = path.read_bytes()
    what, *imported = SOURCES.of(text)
    return digest(what + texts_beside(path)) if READS_TEXTS in text else what, tuple(imported)


def texts_beside(path: Path) -> str:
    """The texts that are no modules in the folder of a module and below: templates, published numbers."""
    files = sorted(each for each in path.parent.rglob("*") if each.suffix in TEXTS)
    return "".join(f"{each.name}\n{each.read_text(encoding='utf-8')}" for each in files)


@cache
def library_sources() -> str:
    """Digest of the native sources: those of the source tree, else those that the library was built from."""
    folder = ROOT / PACKAGE / "raster"
    if (folder / "csrc").is_dir():
        return native_digest(folder / "csrc")
    library = folder / "_native" / f"libtexgs{SUFFIX}"
    return built_from(ctypes.CDLL(str(library)).texgs_sources) if library.is_file() else "no native library"


def built_from(texgs_sources: Any) -> str:
    """Digest of the sources that a native library was built from, by its function of that name."""
    texgs_sources.restype = ctypes.c_char_p
    return str(texgs_sources().decode())


def source(module: str) -> Path | None:
    """The file of a module of texgs; None for a name that is no module."""
    path = ROOT.joinpath(*module.split("."))
    candidates = (path.with_suffix(".py"), path / "__init__.py")
    return next((candidate for candidate in candidates if candidate.is_file()), None)
