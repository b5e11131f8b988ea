"""Rules of the design that the source can tell: layers import from their left, and functions are short."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import networkx
import pytest

ROOT = Path(__file__).parents[1]

# From left to right; a layer may import all packages to its left, but not those on its own floor.
FLOORS = (
    ("core",),
    ("raster",),
    ("volume", "models"),
    ("fields",),
    ("fitting", "scene"),
    ("metrics",),
    ("edit",),
    ("config",),
    ("report",),
    ("viewer",),
    ("study",),
    ("workflow",),
    ("api", "cli"),
)
FLOOR = {package: number for number, packages in enumerate(FLOORS) for package in packages}
ONLY_OF_CLI = "study"
MODULE = re.compile(r"texgs(\.\w+)+(:\w+)?")  # a string that names a module, or an attribute of one


@cache
def modules() -> dict[str, ast.Module]:
    """Return the parsed source of each module of texgs, by its name."""
    paths = sorted((ROOT / "texgs").rglob("*.py"))
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in paths]
    return {
        name.removesuffix(".__init__"): ast.parse(path.read_text())
        for name, path in zip(names, paths, strict=True)
    }


def package_of(module: str) -> str:
    """Return the package below texgs that a module belongs to; "" for texgs itself."""
    return module.partition(".")[2].partition(".")[0]


def docstrings(tree: ast.Module) -> set[int]:
    """Return the identities of the nodes that are docstrings."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    first = (node.body[0] for node in ast.walk(tree) if isinstance(node, documented) and node.body)
    return {id(node.value) for node in first if isinstance(node, ast.Expr)}


def imported(tree: ast.Module, module: str, is_package: bool = False) -> Iterator[str]:
    """Yield the names that a module imports, wherever it does, or names in a string or an f-string."""
    skipped = docstrings(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = module.split(".")[: len(module.split(".")) - node.level + is_package]
            base = ".".join([*(above if node.level else []), *([node.module] if node.module else [])])
            yield from (f"{base}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.JoinedStr) and isinstance(node.values[0], ast.Constant):
            start = str(node.values[0].value)
            skipped |= {id(value) for value in node.values}
            if re.match(r"texgs\.(\w+\.|$)", start):
                yield start.rstrip(".")
        elif isinstance(node, ast.Constant) and MODULE.fullmatch(str(node.value)) and id(node) not in skipped:
            name = node.value.partition(":")[0]
            yield from [name] if package_of(name) in FLOOR else []


def arrows(sources: dict[str, ast.Module]) -> set[tuple[str, str]]:
    """Return pairs of a module and one of texgs that it imports, with names taken off that are no modules."""
    packages = {name for name in sources if any(other.startswith(f"{name}.") for other in sources)}
    pairs = set()
    for module, tree in sources.items():
        for name in imported(tree, module, module in packages):
            while name not in sources and package_of(name) in FLOOR and name.count(".") > 1:
                name = name.rpartition(".")[0]
            if name.startswith("texgs") and name != "texgs.__version__":
                pairs.add((module, name))
    return pairs


def is_allowed(module: str, name: str) -> bool:
    """Whether a module may import another."""
    here, there = package_of(module), package_of(name)
    if here == there or there == "" or module == "texgs":  # which offers the interface
        return True
    if there == ONLY_OF_CLI:
        return here == "cli"
    return FLOOR.get(there, len(FLOORS)) < FLOOR.get(here, -1)


def test_imports_point_to_the_left():
    pairs = arrows(modules())
    unknown = {package_of(module) for module in modules()} - set(FLOOR) - {""}
    wrong = [f"texgs/{package} is in no layer: add it to FLOORS" for package in sorted(unknown)]
    wrong += sorted(f"{module} imports {name}" for module, name in pairs if not is_allowed(module, name))
    assert not wrong, "\n".join(wrong)


def test_stages_import_no_other_stage():
    """What several share is a library: settings, or a room below the workflow."""
    stages = {module for module, tree in modules().items() if is_stage(tree)}
    assert len(stages) > 10
    wrong = sorted(
        f"{module} imports {name}" for module, name in arrows(modules()) if {module, name} <= stages
    )
    assert not wrong, "\n".join(wrong)


def is_stage(tree: ast.Module) -> bool:
    """Return whether a module defines a stage or several."""
    targets = [each for node in tree.body if isinstance(node, ast.Assign) for each in node.targets]
    return any(isinstance(each, ast.Name) and each.id in ("STAGE", "STAGES") for each in targets)


def circles(pairs: set[tuple[str, str]]) -> list[str]:
    """Return a line for each circle: a way round, and all files that are in it."""
    graph = networkx.DiGraph(sorted(pairs))
    tied = [sorted(each) for each in networkx.strongly_connected_components(graph) if len(each) > 1]
    rounds = [networkx.find_cycle(graph.subgraph(each), each[0]) for each in tied]
    return [
        f"{' -> '.join([step[0] for step in way] + [way[0][0]])}; in circles: {', '.join(each)}"
        for each, way in zip(tied, rounds, strict=True)
    ]


def test_no_imports_in_circles():
    """Imports inside functions and those for annotations alone count as well."""
    wrong = circles(arrows(modules()))
    assert not wrong, "files import each other:\n" + "\n".join(wrong)


def test_circles_are_told():
    sources = {
        "texgs.core.a": "from texgs.core.b import B",
        "texgs.core.b": "def f():\n    from texgs.core import c",
        "texgs.core.c": "if TYPE_CHECKING:\n    from texgs.core.a import A\nfrom texgs.core.d import D",
        "texgs.core.d": "",
    }
    pairs = arrows({name: ast.parse(text) for name, text in {"texgs.core": "", **sources}.items()})
    assert circles(pairs) == [
        "texgs.core.a -> texgs.core.b -> texgs.core.c -> texgs.core.a; "
        "in circles: texgs.core.a, texgs.core.b, texgs.core.c"
    ]


@pytest.mark.parametrize(
    "line",
    [
        *("from texgs.cli import main", "from ..cli import main", "from texgs import cli"),
        *("def f():\n    import texgs.cli.main", "import_module('texgs.cli.main')"),
        *("NAME = 'texgs.cli.main:parse'", "f'texgs.cli.{name}'", "'texgs.cli'"),
    ],
)
def test_arrows_are_found(line):
    sources = {name: ast.parse("") for name in ("texgs", "texgs.cli", "texgs.cli.main", "texgs.core")}
    sources["texgs.core.io"] = ast.parse(f'"""Of texgs."""\n{line}')
    ((module, name),) = arrows(sources)
    assert name.startswith("texgs.cli")
    assert not is_allowed(module, name)
    assert not arrows({"texgs.core.io": ast.parse('"""texgs.cli"""\ndef f():\n    "texgs.cli"')})


ENGINE = "texgs.workflow"  # plans and runs jobs; what they do is in its stages and in the rooms below
OF_JOBS = {"torch", "numpy", "scipy", "kornia", "PIL", "matplotlib", "pyvista"}


def work_of_engine(sources: dict[str, ast.Module]) -> list[str]:
    """Return a line for each file of the engine that does what jobs do, or composes words on its own."""
    wrong = []
    for module, tree in sources.items():
        if not module.startswith(ENGINE):
            continue
        names = {name.partition(".")[0] for name in imported(tree, module)}
        if heavy := sorted(names & OF_JOBS) if not module.startswith(f"{ENGINE}.stages") else []:
            wrong.append(f"{module} imports {', '.join(heavy)}; put what a job does into a stage or below")
        if "texgs.config.compose.compose" in imported(tree, module):
            wrong.append(f"{module} composes words; take a Case, whose configuration is composed once")
    return wrong


def test_the_engine_of_the_workflow_has_no_code_of_jobs():
    assert not work_of_engine(modules())
    line = "def f():\n    import numpy as np\n    from texgs.config.compose import compose"
    assert len(work_of_engine({"texgs.workflow.plan": ast.parse(line)})) == 2
    assert len(work_of_engine({"texgs.workflow.stages.mesh": ast.parse(line)})) == 1


LONGEST = 40  # lines of a function without its docstring


def lines_of(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Return how many lines a function has without its docstring."""
    first = function.body[0]
    docstring = first.end_lineno - first.lineno + 1 if ast.get_docstring(function) is not None else 0
    return function.end_lineno - function.lineno + 1 - docstring


def test_functions_are_short():
    long = [
        f"{module}.{node.name}: {lines_of(node)}"
        for module, tree in modules().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and lines_of(node) > LONGEST
    ]
    assert not long, f"expected functions of at most {LONGEST} lines, got {', '.join(long)}"
