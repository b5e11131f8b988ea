import shutil

import pytest

from texgs.config.compose import compose
from texgs.workflow import code
from texgs.workflow.code import CACHE, Sources, WithoutWords
from texgs.workflow.stage_table import STAGES


def forget():
    """Read all sources anew."""
    for cached in (code.code_digest, code.essence, code.library_sources):
        cached.cache_clear()
    code.SOURCES = Sources()


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """A package with a stage that imports one module of two."""
    monkeypatch.setattr(code, "ROOT", tmp_path)
    monkeypatch.setenv("TEXGS_CACHE", str(tmp_path / "cache"))
    files = {
        "texgs/__init__.py": "",
        "texgs/volume/__init__.py": '"""Volumes."""',
        "texgs/volume/stage.py": "from texgs.volume.used import double\ndef work(x):\n    return double(x)\n",
        "texgs/volume/used.py": "from texgs.core import deep\ndef double(x):\n    return 2 * x\n",
        "texgs/core/__init__.py": "",
        "texgs/core/deep.py": "LIMIT = 3\n",
        "texgs/volume/unused.py": "X = 1\n",
    }
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    def edit(name, old, new):
        path = tmp_path / name
        assert old in path.read_text()
        path.write_text(path.read_text().replace(old, new))
        forget()
        return code.code_digest("texgs.volume.stage")

    forget()
    yield edit, code.code_digest("texgs.volume.stage")
    forget()
    shutil.rmtree(tmp_path)


def test_a_changed_line_counts_however_deep(tree):
    edit, before = tree
    after = edit("texgs/core/deep.py", "3", "4")
    assert after != before
    assert edit("texgs/volume/used.py", "2 * x", "x + x") not in (before, after)


def test_comments_docstrings_and_layout_do_not_count(tree):
    edit, before = tree
    assert (
        edit("texgs/volume/used.py", "def double(x):", "# twice\n\n\ndef double( x ):\n    'Twice.'")
        == before
    )
    assert edit("texgs/volume/__init__.py", "Volumes", "Grids") == before


def test_what_is_not_imported_does_not_count(tree):
    edit, before = tree
    assert edit("texgs/volume/unused.py", "1", "2") == before


def test_imports_for_types_do_not_count(tree):
    edit, before = tree
    guarded = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from texgs.volume.unused import X\n"
    with_types = edit("texgs/volume/used.py", "from texgs.core", f"{guarded}from texgs.core")
    assert with_types != before, "the import of TYPE_CHECKING itself runs"
    assert edit("texgs/volume/unused.py", "1", "2") == with_types


def test_stages_exist_and_differ():
    digests = {code.code_digest(stage.module) for stage in STAGES.values()}
    assert len(digests) == len({stage.module for stage in STAGES.values()})
    for stage in STAGES.values():
        assert code.source(stage.module) is not None, stage.module


@pytest.mark.parametrize(
    ("changed", "stages"),
    [
        ("texgs.fields.surfels.composition", {"compose", "timing", "edit_text", "edit_metrics"}),
        ("texgs.fields.gaussians.model", set()),
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
    other = lambda module: ("changed", ()) if module == changed else real(module)  # noqa: E731
    monkeypatch.setattr(code, "essence", other)
    code.code_digest.cache_clear()
    assert {name for name in names if STAGES[name].code(settings[name]) != before[name]} == stages
    code.code_digest.cache_clear()


@pytest.mark.parametrize("ending", ["js", "png"])
def test_files_beside_a_module_that_reads_some_count(tree, tmp_path, ending):
    edit, _ = tree
    (tmp_path / "texgs/core/web").mkdir()
    page = tmp_path / f"texgs/core/web/page.{ending}"
    page.write_bytes(b"\x89 1")
    before = edit("texgs/core/deep.py", "LIMIT = 3", "from importlib.resources import files\nLIMIT = 3")
    page.write_bytes(b"\x89 2")
    after = edit("texgs/core/deep.py", "LIMIT = 3", "LIMIT = 3")
    assert after != before
    page.with_suffix(".orig").write_text("left by an editor")
    assert edit("texgs/core/deep.py", "LIMIT = 3", "LIMIT = 3") == after


def test_help_texts_do_not_count_and_defaults_do(tree):
    edit, _ = tree
    before = edit(
        "texgs/core/deep.py",
        "LIMIT = 3",
        "LIMIT = 3\nsize: int = key(64, 'samples', 'voxels', least=16)\n"
        "parser.add_argument('--size', help='samples', default=64)\n"
        "X = field(metadata={'help': 'samples'})\n",
    )
    assert edit("texgs/core/deep.py", "samples", "samples along each side") == before
    assert edit("texgs/core/deep.py", "voxels", "samples") == before
    assert edit("texgs/core/deep.py", "least=16", "least=8") != before
    before = edit("texgs/core/deep.py", "least=8", "least=16")
    assert edit("texgs/core/deep.py", "key(64", "key(65") != before


def test_native_sources_count_where_the_native_library_is_called(tree, tmp_path):
    edit, _ = tree
    csrc = tmp_path / "texgs" / "raster" / "csrc"
    csrc.mkdir(parents=True)
    (csrc / "maths.h").write_text("int a = 1;")
    before = edit("texgs/core/deep.py", "3", "3")
    edit("texgs/raster/csrc/maths.h", "1", "2")
    assert edit("texgs/core/deep.py", "3", "3") == before, "nothing calls the library yet"
    (tmp_path / "texgs" / "raster" / "native.py").write_text("X = 1\n")
    before = edit("texgs/core/deep.py", "LIMIT = 3", "import texgs.raster.native\nLIMIT = 3")
    assert edit("texgs/raster/csrc/maths.h", "2", "3") != before
    assert edit("texgs/raster/csrc/maths.h", "3", "2 /* three */") == before


def test_later_processes_parse_nothing(tree, tmp_path, monkeypatch):
    _, before = tree
    forget()
    monkeypatch.setattr(WithoutWords, "visit", lambda *_: pytest.fail("parsed again"))
    assert code.code_digest("texgs.volume.stage") == before


@pytest.mark.parametrize("damage", [("{", "x{"), ('"value"', '"values"'), ('"key": "', '"key": "3')])
def test_a_damaged_cache_is_an_empty_one(tree, tmp_path, damage):
    _, before = tree
    path = tmp_path / "cache" / CACHE
    path.write_text(path.read_text().replace(*damage, 1))
    forget()
    assert code.code_digest("texgs.volume.stage") == before
