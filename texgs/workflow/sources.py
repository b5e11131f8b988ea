"""What counts of a Python source, and what it imports from texgs.

Comments, docstrings, help texts and layout do not count, so only a change that can change a result changes
the digest.
"""

import ast
import contextlib
import hashlib
import json
import sys
from collections.abc import Iterator
from pathlib import Path

from texgs.core.checksum import digest
from texgs.core.errors import ArgumentError
from texgs.core.folders import cache_folder
from texgs.core.io import write_bytes

PACKAGE = "texgs"
CACHE = "sources.json"  # in the cache folder
MOST = 3000  # sources in it


class Sources:
    """What is known of sources by their checksums. It is kept for later processes: parsing takes time."""

    def __init__(self) -> None:
        self._known: dict[str, list[str]] | None = None
        self._is_new = False
        self._method = f"{sys.version_info[:2]} {sha256(Path(__file__).read_bytes())}"

    def of(self, source: bytes) -> list[str]:
        """Digest of what counts of a source, then the names that it imports from texgs."""
        if self._known is None:
            self._known = self._load()
        checksum = sha256(source)
        if checksum not in self._known:
            tree = ast.parse(source)
            imported = list(imports(tree))
            self._known[checksum] = [digest(ast.unparse(WithoutWords().visit(tree))), *imported]
            self._is_new = True
        return self._known[checksum]

    def _load(self) -> dict[str, list[str]]:
        """What the cache folder has; one that is damaged, or of another Python or texgs, is empty."""
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            kept = json.loads((cache_folder() / CACHE).read_text())
            if kept["method"] == self._method and len(kept["known"]) < MOST:
                return dict(kept["known"])
        return {}

    def save(self) -> None:
        """Keep them; where the cache cannot be written, later processes parse again."""
        if self._is_new:
            kept = {"method": self._method, "known": self._known}
            with contextlib.suppress(ArgumentError, OSError):
                write_bytes(cache_folder() / CACHE, json.dumps(kept).encode())
            self._is_new = False


def sha256(text: bytes) -> str:
    """Hexadecimal SHA-256."""
    return hashlib.sha256(text).hexdigest()


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
    """Takes out docstrings, `STAGE = ...` and help: the words of `key(...)`, `help=...`, `{"help": ...}`."""

    def visit(self, node: ast.AST) -> ast.AST:
        """The node without them."""
        self.generic_visit(node)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            if is_text(node.body[0] if node.body else None):
                node.body = node.body[1:] or [ast.Pass()]
        elif isinstance(node, ast.Assign) and is_stage(node):
            return ast.Pass()
        elif isinstance(node, ast.Call):
            node.keywords = [word for word in node.keywords if word.arg not in ("help", "description")]
            if isinstance(node.func, ast.Name) and node.func.id == "key":
                node.args = node.args[:1]  # the default; then come help and unit
        elif isinstance(node, ast.Dict):
            items = zip(node.keys, node.values, strict=True)
            kept = [(k, v) for k, v in items if not (isinstance(k, ast.Constant) and k.value == "help")]
            node.keys, node.values = [k for k, _ in kept], [v for _, v in kept]
        return node


def is_stage(node: ast.Assign) -> bool:
    """Return whether a statement says what a stage is to the workflow: its job runs something else."""
    return any(isinstance(name, ast.Name) and name.id in ("STAGE", "STAGES") for name in node.targets)


def is_text(node: ast.stmt | None) -> bool:
    """Whether a statement is nothing but a text."""
    is_constant = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return is_constant and isinstance(node.value.value, str)  # type: ignore[union-attr]
