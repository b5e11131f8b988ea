"""Digest of the C++ and CUDA sources: the build puts it into the libraries, jobs carry it with their code.

    python texgs/core/native_sources.py FOLDER

prints the digest of the sources in a folder: CMake does that for each build. It is the reason why this file
imports nothing but the standard library.
"""

import ctypes
import hashlib
import re
import sys
from functools import cache
from pathlib import Path
from typing import Any

SUFFIXES = (".h", ".cpp", ".cu", ".cuh", ".txt")
LENGTH = 12  # hexadecimal digits
RASTER = Path(__file__).parents[1] / "raster"  # has the sources, or the libraries that were built from them
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")  # of native libraries
CUDA_ADVICE = "with nvcc 12 or newer: `make install CUDA=1`, or `pip install . -C cmake.define.TEXGS_CUDA=ON`"
# Comments, which do not count; then what does: literals, words, and any other character but blanks.
TOKENS = re.compile(
    r"""//[^\n]*|/\*.*?\*/|("(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'|\w+|[^\w\s])""", re.DOTALL
)


def native_digest(folder: Path) -> str:
    """Return the digest of all sources below a folder; comments and layout do not count."""
    files = sorted(path for path in folder.rglob("*") if path.suffix in SUFFIXES)
    texts = [f"{path.relative_to(folder).as_posix()}\n{essence(path)}" for path in files]
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:LENGTH]


def essence(path: Path) -> str:
    """Return the words and signs of a file, as a compiler sees them."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".txt":  # of CMake
        return " ".join(re.sub(r"#[^\n]*", " ", text).split())
    return " ".join(match[1] for match in TOKENS.finditer(text) if match[1])


@cache
def library_sources(folder: Path = RASTER) -> str:
    """Return the digest of the native sources: of the source tree, else those that the library has in it."""
    if (folder / "csrc").is_dir():
        return native_digest(folder / "csrc")
    library = folder / "_native" / f"libtexgs{SUFFIX}"
    return built_from(ctypes.CDLL(str(library)).texgs_sources) if library.is_file() else "no native library"


def built_from(texgs_sources: Any) -> str:
    """Return the digest of the sources that a native library was built from, by its function of that name."""
    texgs_sources.restype = ctypes.c_char_p
    return str(texgs_sources().decode())


if __name__ == "__main__":
    print(native_digest(Path(sys.argv[1])))
