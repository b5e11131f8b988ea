import shutil

import pytest

from texgs.config import code


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """A package with a stage that imports one module of two."""
    monkeypatch.setattr(code, "ROOT", tmp_path)
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
        code.code_digest.cache_clear()
        return code.code_digest("texgs.volume.stage")

    code.code_digest.cache_clear()
    yield edit, code.code_digest("texgs.volume.stage")
    code.code_digest.cache_clear()
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


def test_stages_exist_and_differ():
    from texgs.config.stages import STAGES

    digests = {stage.code for stage in STAGES.values()}
    assert len(digests) == len(STAGES)
    for stage in STAGES.values():
        assert code.source(stage.module) is not None, stage.module
