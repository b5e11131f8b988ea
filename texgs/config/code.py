"""Digest of the code a stage runs: its module and all modules of texgs that it imports, however deep.

Read from the source without importing it. Comments, docstrings and layout do not count, so only a change that
can change a result changes the digest.
"""

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from texgs.config.kept import kept_by_source

ROOT = Path(__file__).parents[2]
PACKAGE = "texgs"
LENGTH = 12  # hexadecimal digits of all digests


@cache
@kept_by_source(lambda: ROOT)
def code_digest(module: str) -> str:
    """Digest of a module such as ``texgs.volume.render`` and what it imports from texgs."""
    seen: dict[str, str] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in seen or (path := source(name)) is None:
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        waiting += imports(tree)
        seen[name] = ast.unparse(without_docstrings(tree))
    return digest("\n".join(f"{name}\n{seen[name]}" for name in sorted(seen)))


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


def without_docstrings(tree: ast.Module) -> ast.Module:
    """The same tree with the docstrings of modules, classes and functions taken out."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if (
                isinstance(first, ast.Expr)
                and isinstance(first.value, ast.Constant)
                and isinstance(first.value.value, str)
            ):
                node.body = node.body[1:] or [ast.Pass()]
    return tree
