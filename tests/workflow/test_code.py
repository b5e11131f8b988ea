"""The digest of the code of a stage: what counts, and what is kept for later processes."""

import ast

import pytest

from texgs.config.compose import compose
from texgs.workflow import code
from texgs.workflow.code import CACHE, Sources, WithoutWords
from texgs.workflow.stage_table import STAGES

FILES = {
    "__init__": "",
    "volume/__init__": '"""Volumes."""',
    "volume/stage": "from texgs.volume.used import double\ndef work(x):\n    return double(x)\nSTAGE = 3\n",
    "volume/used": "from typing import TYPE_CHECKING\nfrom texgs.core import deep\n"
    "if TYPE_CHECKING:\n    from texgs.volume.unused import X\n\ndef double(x):\n    return 2 * x\n",
    "volume/unused": "X = 1\n",
    "core/__init__": "",
    "core/deep": "LIMIT = 3\nsize: int = key(64, 'samples', 'voxels', least=16)\n"
    "parser.add_argument('--size', help='samples', default=64)\nX = field(metadata={'help': 'samples'})\n"
    'X = f"{LIMIT}"\n',
}


def forget():
    """Read all sources anew."""
    for cached in (code.code_digest, code.essence, code.library_sources):
        cached.cache_clear()
    code.SOURCES = Sources()


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """A package with a stage that imports one module of two; the digest after an edit of a file."""
    monkeypatch.setattr(code, "ROOT", tmp_path)
    monkeypatch.setenv("TEXGS_CACHE", str(tmp_path / "cache"))
    for name, text in FILES.items():
        path = tmp_path / "texgs" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def edited(name, old="", new=""):
        path = tmp_path / "texgs" / (name if "." in name else f"{name}.py")
        assert old in path.read_text()
        path.write_text(path.read_text().replace(old, new) if old else path.read_text())
        forget()
        return code.code_digest("texgs.volume.stage")

    yield edited
    forget()


@pytest.mark.parametrize(
    ("name", "old", "new", "counts"),
    [
        ("volume/stage", "double(x)\n", "double(x) + 0\n", True),
        ("volume/used", "2 * x", "x + x", True),
        ("core/deep", "3", "4", True),  # however deep
        ("core/deep", "least=16", "least=8", True),
        ("core/deep", "default=64", "default=65", True),
        ("core/deep", "samples", "samples along each side", False),  # help texts
        ("volume/used", "def double(x):", "# twice\n\n\ndef double( x ):\n    'Twice.'", False),
        ("volume/__init__", "Volumes", "Grids", False),
        ("volume/stage", "STAGE = 3", "STAGE = 4", False),  # what it is to the workflow
        ("volume/unused", "1", "2", False),  # imported for types alone
        ("core/deep", 'f"{LIMIT}"', "f'{LIMIT}'", False),
        ("core/deep", "{LIMIT}", "{LIMIT!r}", True),
    ],
)
def test_what_can_change_a_result_counts(tree, name, old, new, counts):
    before = tree(name)
    assert (tree(name, old, new) != before) is counts


def test_stages_exist_and_differ():
    digests = {code.code_digest(stage.module) for stage in STAGES.values()}
    assert len(digests) == len({stage.module for stage in STAGES.values()})
    for stage in STAGES.values():
        assert code.source(stage.module, code.ROOT) is not None, stage.module


@pytest.mark.parametrize(
    ("changed", "stages"),
    [
        ("texgs.fields.surfels.composition", {"compose", "timing", "edit_text", "edit_metrics"}),
        ("texgs.fields.gaussians.composition", set()),
        ("texgs.edit.methods.text", {"edit_text", "edit_metrics"}),
    ],
)
def test_what_settings_name_counts(monkeypatch, changed, stages):
    """The kind of field and the method are imported by their names, which no source of a stage tells."""
    config = compose(("dataset=turbulence", "edit=gold"))
    names = ("volume", "compose", "timing", "edit_text", "edit_metrics")
    settings = {name: STAGES[name].settings(config) for name in names}
    before = {name: STAGES[name].code(settings[name]) for name in names}
    real = code.essence.__wrapped__
    other = lambda module, root: ("changed", ()) if module == changed else real(module, root)  # noqa: E731
    monkeypatch.setattr(code, "essence", other)
    code.code_digest.cache_clear()
    assert {name for name in names if STAGES[name].code(settings[name]) != before[name]} == stages
    code.code_digest.cache_clear()


def test_files_beside_a_module_that_reads_some_count(tree, tmp_path):
    page = tmp_path / "texgs/core/web/page.webp"
    page.parent.mkdir()
    page.write_bytes(b"\x89 1")
    before = tree("core/deep", "LIMIT = 3", "from importlib.resources import files\nLIMIT = 3")
    page.write_bytes(b"\x89 2")
    after = tree("core/deep")
    assert after != before
    page.with_suffix(".orig").write_text("left by an editor")
    assert tree("core/deep") == after


def test_native_sources_count_where_the_native_library_is_called(tree, tmp_path):
    csrc = tmp_path / "texgs" / "raster" / "csrc"
    csrc.mkdir(parents=True)
    (csrc / "maths.h").write_text("int a = 1;")
    before = tree("core/deep")
    assert tree("raster/csrc/maths.h", "1", "2") == before, "nothing calls the library yet"
    (tmp_path / "texgs" / "raster" / "native.py").write_text("X = 1\n")
    before = tree("core/deep", "LIMIT = 3", "import texgs.raster.native\nLIMIT = 3")
    after = tree("raster/csrc/maths.h", "2", "3")
    assert after != before
    assert tree("raster/csrc/maths.h", "3", "3 /* three */") == after


def test_later_processes_parse_nothing(tree, monkeypatch):
    before = tree("core/deep")
    forget()
    monkeypatch.setattr(WithoutWords, "visit", lambda *_: pytest.fail("parsed again"))
    assert code.code_digest("texgs.volume.stage") == before


@pytest.mark.parametrize("damage", [("{", "x{"), ('"value"', '"values"'), ('"key": "', '"key": "3')])
def test_a_damaged_cache_is_an_empty_one(tree, tmp_path, damage):
    before = tree("core/deep")
    path = tmp_path / "cache" / CACHE
    path.write_text(path.read_text().replace(*damage, 1))
    forget()
    assert code.code_digest("texgs.volume.stage") == before


def test_what_a_stage_imports_to_do_its_work_counts():
    """Imports at the top decide settings and inputs; those in functions are of the work."""
    for stage in (code.ROOT / "texgs" / "workflow" / "stages").glob("*.py"):
        for function in ast.walk(ast.parse(stage.read_text(encoding="utf-8"))):
            if isinstance(function, ast.FunctionDef):
                used = {name for name in code.imports(function) if code.source(name, code.ROOT)}
                assert used <= code.code_of([f"texgs.workflow.stages.{stage.stem}"]).keys(), stage
    assert "texgs.fitting.series" in code.code_of(["texgs.workflow.stages.steps"])
    assert "texgs.report.differences" in code.code_of(["texgs.cli.tables"])
