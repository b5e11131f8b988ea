"""Digest of the code a stage runs: its module and all modules of texgs that it imports, however deep.

Read from the source without importing it. Comments, docstrings, help texts and layout do not count, so only a
change that can change a result changes the digest. Code that calls the native library has the digest of the
C++ and CUDA sources in it.
"""

import ast
import ctypes
import hashlib
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from texgs.config.native_sources import native_digest

ROOT = Path(__file__).parents[2]
PACKAGE = "texgs"
LENGTH = 12  # hexadecimal digits of all digests
NATIVE = "texgs.raster.native"  # the module that calls the native library
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")  # of native libraries


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
    parts = [f"{name}\n{seen[name]}" for name in sorted(seen)]
    return digest("\n".join([*parts, library_sources()] if NATIVE in seen else parts))


@cache
def essence(module: str) -> tuple[str, tuple[str, ...]] | None:
    """What counts of a module's source, and what it imports from texgs; None for a name that is no module."""
    path = source(module)
    if path is None:
        return None
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return ast.unparse(WithoutWords().visit(tree)), tuple(imports(tree))


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


def digest(text: str) -> str:
    """Short hexadecimal SHA-256."""
    return hashlib.sha256(text.encode()).hexdigest()[:LENGTH]


def source(module: str) -> Path | None:
    """The file of a module of texgs; None for a name that is no module."""
    path = ROOT.joinpath(*module.split("."))
    candidates = (path.with_suffix(".py"), path / "__init__.py")
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def imports(tree: ast.AST) -> Iterator[str]:
    """Names in texgs that a file imports anywhere, also inside functions; some are functions, not modules."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        yield from (name for name in names if name.split(".")[0] == PACKAGE)


class WithoutWords(ast.NodeTransformer):
    """Takes out docstrings and help texts: the words of `key(...)`, `help=...` and `{"help": ...}`."""

    def visit(self, node: ast.AST) -> ast.AST:
        """The node without them."""
        self.generic_visit(node)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            if is_text(node.body[0] if node.body else None):
                node.body = node.body[1:] or [ast.Pass()]
        elif isinstance(node, ast.Call):
            node.keywords = [word for word in node.keywords if word.arg not in ("help", "description")]
            if isinstance(node.func, ast.Name) and node.func.id == "key":
                node.args = node.args[:1]  # the default; then come help and unit
        elif isinstance(node, ast.Dict):
            items = zip(node.keys, node.values, strict=True)
            kept = [(k, v) for k, v in items if not (isinstance(k, ast.Constant) and k.value == "help")]
            node.keys, node.values = [k for k, _ in kept], [v for _, v in kept]
        return node


def is_text(node: ast.stmt | None) -> bool:
    """Whether a statement is nothing but a text."""
    is_constant = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return is_constant and isinstance(node.value.value, str)  # type: ignore[union-attr]
