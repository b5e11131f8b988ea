"""Rules of the design that the source can tell: layers import from their left, and functions are short."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# Package: the packages it may import from, besides itself.
LEFT = {
    "core": set(),
    "config": {"core"},
    "raster": {"core"},
    "volume": {"config", "core", "raster"},
    **{name: {"config", "core", "volume", "raster"} for name in ("fields", "models")},
}
LEFT["scene"] = LEFT["fields"] | {"fields"}
for name in ("fit", "edit", "metrics"):
    LEFT[name] = LEFT["scene"] | {"scene", "models"}
LEFT["report"] = LEFT["fit"] | {"fit", "edit", "metrics"}
for name in ("methods", "kinds", "viewer"):
    LEFT[name] = LEFT["report"] | {"report"}
LEFT["workflow"] = LEFT["methods"] | {"methods", "kinds"}
LEFT["study"] = LEFT["report"] | {"report"}
LEFT["cli"] = LEFT["workflow"] | {"workflow", "viewer", "study"}


def package_of(path: Path) -> str:
    """The layer a file belongs to; "" for texgs/__init__.py."""
    parts = path.relative_to(ROOT / "texgs").parts
    return parts[0].removesuffix(".py").replace("__init__", "")


def imports(tree: ast.AST, module: str) -> set[str]:
    """Absolute names of all modules imported anywhere in a file."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            parent = ".".join(module.split(".")[: -node.level]) + "." if node.level else ""
            base = f"{parent}{node.module or ''}".rstrip(".")
            names |= {base} | {f"{base}.{alias.name}" for alias in node.names}
    return names


FILES = sorted((ROOT / "texgs").rglob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_point_to_the_left(path):
    package = package_of(path)
    module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    packages = {
        name.split(".")[1]
        for name in imports(ast.parse(path.read_text()), module)
        if name.startswith("texgs.")
    }
    assert package == "" or package in LEFT, f"{package} is in no layer: add it to LEFT"
    allowed = LEFT.get(package, set()) | {package, "__version__"}
    assert packages <= allowed, (
        f"{path} imports {sorted(packages - allowed)}; {package} may import {sorted(allowed)}"
    )


LONGEST = 40  # lines of a function without its docstring


def lines_of(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of a function without its docstring."""
    first = function.body[0]
    docstring = first.end_lineno - first.lineno + 1 if ast.get_docstring(function) is not None else 0
    return function.end_lineno - function.lineno + 1 - docstring


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_functions_are_short(path):
    nodes = ast.walk(ast.parse(path.read_text()))
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    long = [f"{each.name}: {lines_of(each)}" for each in functions if lines_of(each) > LONGEST]
    assert not long, f"{path}: expected functions of at most {LONGEST} lines, got {', '.join(long)}"
