"""Digest of the code a stage runs: its module and all modules of texgs that it imports, however deep.

Read from the source without importing it. Comments, docstrings, help texts and layout do not count, so only a
change that can change a result changes the digest. Of texgs/workflow only stages count. Code that calls the
native library has the digest of the C++ and CUDA sources in it; a module that reads files of its package has
these in it.
"""

import ast
import hashlib
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from texgs.core.cache import cache_folder, digest, keep, recall, sha256
from texgs.core.native_sources import library_sources

ROOT = Path(__file__).parents[2]
PACKAGES = ("texgs", "benchmarks")  # the second measures the first, which never imports it
STAGES = "texgs.workflow.stages."
ENGINE = "texgs.workflow."  # all but stages decides on settings and inputs, which identify jobs anyway
NATIVE = "texgs.raster.native"  # the module that calls the native library
READS_DATA = b"importlib.resources"  # in modules that do
DATA = (".css", ".csv", ".html", ".j2", ".js", ".safetensors", ".tex", ".webp", ".yaml")
CACHE = "sources.json"  # in the cache folder
MAX_SOURCES = 3000  # sources in it


class Sources:
    """What is known of sources by their checksums; it is kept for later processes.

    To parse all 300 takes 1.1 s, which is a third of the time to plan the paper; to read this 0.1 s.
    """

    def __init__(self) -> None:
        self._key = f"{sys.version_info[:2]} {sha256(__file__)}"
        self._known: dict[str, list[str]] = {}
        self._kept = 0  # how many of them are in the cache folder

    def of(self, source: bytes) -> list[str]:
        """Return the digest of what counts of a source, then the names that it imports from texgs."""
        if not self._known:
            kept = recall(cache_folder() / CACHE, self._key)
            self._known = kept if isinstance(kept, dict) and len(kept) < MAX_SOURCES else {}
            self._kept = len(self._known)
        found = hashlib.sha256(source).hexdigest()
        if found not in self._known:
            tree = WithoutWords().visit(ast.parse(source))
            self._known[found] = [digest(ast.unparse(tree)), *imports(tree)]
        return self._known[found]

    def save(self) -> None:
        """Keep them; where the cache cannot be written, later processes parse again."""
        if len(self._known) > self._kept:
            keep(cache_folder() / CACHE, self._key, self._known)
            self._kept = len(self._known)


def imports(tree: ast.AST) -> Iterator[str]:
    """Yield what a file imports from texgs, also inside functions; some of it is functions, not modules."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        yield from (name for name in names if name.split(".")[0] in PACKAGES)


class WithoutWords(ast.NodeTransformer):
    """Takes out what no job runs: docstrings, `STAGE = ...`, imports for types, and help.

    Help are the words of `key(...)`, `help=...` and `{"help": ...}`.
    """

    def visit(self, node: ast.AST) -> ast.AST:
        """Return the node without them."""
        self.generic_visit(node)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            if ast.get_docstring(node, clean=False) is not None:
                node.body = node.body[1:] or [ast.Pass()]
        elif is_planning(node):
            return ast.Pass()
        elif isinstance(node, ast.JoinedStr | ast.FormattedValue):  # Pythons quote these differently
            conversion = ast.Constant(getattr(node, "conversion", None))
            values: list[Any] = [*ast.iter_child_nodes(node), conversion]
            return ast.Call(ast.Name("f-string"), values, [])
        elif isinstance(node, ast.Call):
            node.keywords = [word for word in node.keywords if word.arg not in ("help", "description")]
            if isinstance(node.func, ast.Name) and node.func.id == "key":
                node.args = node.args[:1]  # the default; then come help and unit
        elif isinstance(node, ast.Dict):
            items = zip(node.keys, node.values, strict=True)
            kept = [(k, v) for k, v in items if not (isinstance(k, ast.Constant) and k.value == "help")]
            node.keys, node.values = [k for k, _ in kept], [v for _, v in kept]
        return node


def is_planning(node: ast.AST) -> bool:
    """Return whether a statement says what a stage is to the workflow, or imports what annotations name."""
    names = node.targets if isinstance(node, ast.Assign) else []
    is_stage = any(isinstance(name, ast.Name) and name.id in ("STAGE", "STAGES") for name in names)
    return is_stage or (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")


SOURCES = Sources()


@cache
def code_digest(module: str) -> str:
    """Return the digest of a module such as ``texgs.volume.render`` and what it imports from texgs."""
    return digest("\n".join(f"{name}\n{each}" for name, each in sorted(code_of([module]).items())))


def code_of(modules: Iterable[str], root: Path | None = None) -> dict[str, str]:
    """Return the digests of modules and of what they import from texgs, by name, and of native sources.

    `root` is the folder of another source tree, such as that of an earlier revision.
    """
    root = root or ROOT
    seen: dict[str, str] = {}
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        is_engine = name.startswith(ENGINE) and not name.startswith(STAGES)
        if name in seen or is_engine or (read := essence(name, root)) is None:
            continue
        seen[name], imported = read
        waiting += imported
    SOURCES.save()
    return seen | (
        {"texgs.raster.csrc": library_sources(root / "texgs" / "raster")} if NATIVE in seen else {}
    )


@cache
def essence(module: str, root: Path) -> tuple[str, tuple[str, ...]] | None:
    """Return the digest of what counts of a module, and what it imports; None where there is none."""
    path = source(module, root)
    if path is None:
        return None
    text = path.read_bytes()
    what, *imported = SOURCES.of(text)
    return digest(what + data_beside(path)) if READS_DATA in text else what, tuple(imported)


def data_beside(path: Path) -> str:
    """Name the files beside a module and below that are no modules, with their checksums."""
    files = sorted(each for each in path.parent.rglob("*") if each.suffix in DATA)
    return "".join(f"{each.name}\n{sha256(each)}\n" for each in files)


def source(module: str, root: Path) -> Path | None:
    """Return the file of a module of texgs; None for a name that is no module."""
    path = root.joinpath(*module.split("."))
    candidates = (path.with_suffix(".py"), path / "__init__.py")
    return next((candidate for candidate in candidates if candidate.is_file()), None)
