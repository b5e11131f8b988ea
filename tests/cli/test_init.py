"""`texgs init`: a project folder whose files compose, and nothing in folders of others."""

import pytest

from texgs.cli.main import main
from texgs.config.compose import compose
from texgs.config.project import groups, members


def contents(folder):
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_what_it_writes_composes(tmp_path, monkeypatch, capsys):
    assert main(["init", str(tmp_path / "mine")]) == 0
    assert "README.md" in capsys.readouterr().out
    monkeypatch.chdir(tmp_path / "mine")
    assert "example" in members("experiment")
    assert "engine" in members("dataset")
    assert "README" not in groups()
    assert compose(("experiment=example",)).fit.name == "demo"


def test_a_project_is_left_as_it_is(tmp_path, capsys):
    assert main(["init", str(tmp_path)]) == 0
    (tmp_path / "README.md").write_text("mine")
    before = contents(tmp_path)
    assert main(["init", str(tmp_path)]) == 0
    assert "is a project already" in capsys.readouterr().out
    assert contents(tmp_path) == before


def test_a_folder_of_something_else_is_refused(tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("mine")
    assert main(["init", str(tmp_path)]) == 2
    assert "got one with thesis.tex; choose another" in capsys.readouterr().err
    assert main(["init", str(tmp_path / "thesis.tex")]) == 2
    assert "got a file" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.fixture
def project(tmp_path, monkeypatch):
    (tmp_path / "conf" / "dataset").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path / "conf"


def test_the_project_may_have_defaults_of_its_own(project):
    from texgs.config.project import ROOT

    text = (ROOT / "conf" / "config.yaml").read_text().replace("dataset: turbulence", "dataset: jets")
    (project / "config.yaml").write_text(text)
    assert compose().dataset.name == "jets"
