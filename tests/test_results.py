"""The index of committed results: nothing is missing, and the documentation marks what is of older code."""

import re
import shlex
import subprocess
import sys
from types import SimpleNamespace

import pytest

from benchmarks import machine, results
from benchmarks.results import DOCS, INDEX, RESULTS, marked, older, pages
from texgs.workflow import code
from texgs.workflow.sweep import as_sweep
from tools.pictures import PICTURES, RUN

REMEDY = "python -m benchmarks.results"
GIT = ("git", "-c", "user.name=x", "-c", "user.email=x@x.org", "-c", "commit.gpgsign=false")


def test_each_result_and_picture_is_in_the_index():
    files = [*RESULTS.iterdir(), *DOCS.glob("*.png"), *DOCS.glob("*.webp")]
    assert set(results.index().index) == {path.name for path in files} - {INDEX.name}, (
        f"enter what is new: {REMEDY} --help"
    )


@pytest.mark.parametrize("file", results.index().index)
def test_each_is_on_a_page(file):
    assert any(f"{file})" in page.read_text(encoding="utf-8") for page in pages()), (
        "delete it: no page links it"
    )


def test_each_picture_has_a_function_that_tells_its_code_and_a_run_that_can_be_composed():
    assert {path.stem for path in DOCS.glob("*.png")} == PICTURES.keys()
    names = {name for picture in PICTURES.values() for name in picture.code.split()}
    assert not [name for name in names if not results.parts(name)]
    for words in RUN.values():
        as_sweep(tuple(word for word in shlex.split(words) if "=" in word))


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_results_of_older_code_are_marked(page):
    """Links that lead nowhere are found in tests/test_readme.py."""
    text = page.read_text(encoding="utf-8")
    assert text == marked(page, older(results.index())), f"run {REMEDY} --mark"


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """A repository with a stage that imports a module, a result of it, a picture of that, and a page."""
    files = {
        "texgs/workflow/stages/shading.py": "from texgs.fitting import loop\n",
        "texgs/fitting/loop.py": "RATE = 1\n",
        "texgs/fitting/other.py": "RATE = 1\n",
        "benchmarks/results/a.csv": "",
        "benchmarks/results/index.csv": "file,command,machine,revision,code,digest,same\n",
        "docs/b.png": "",
        "docs/page.md": "([a](../benchmarks/results/a.csv)), ![b](b.png), [c](c.png)\n",
        "docs/accuracy.md": "[a](../benchmarks/results/a.csv)\n",
        "README.md": "![b](docs/b.png)\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    for module in (results, machine):
        monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(results, "RESULTS", tmp_path / "benchmarks/results")
    monkeypatch.setattr(results, "INDEX", tmp_path / "benchmarks/results/index.csv")
    monkeypatch.setattr(results, "DOCS", tmp_path / "docs")
    for words in (["init", "--quiet"], ["add", "."], ["commit", "--quiet", "--message", "x"]):
        subprocess.run([*GIT, *words], cwd=tmp_path, check=True)
    return tmp_path


def called(monkeypatch, capsys, *words):
    """What the program prints."""
    code.essence.cache_clear()
    monkeypatch.setattr(sys, "argv", ["results", *map(str, words)])
    results.main()
    return capsys.readouterr().out


def change(clone, text, name="texgs/fitting/loop.py"):
    (clone / name).write_text(text)


def test_a_result_and_its_picture_are_of_older_code_until_it_is_measured_again(clone, monkeypatch, capsys):
    path, picture = clone / "benchmarks/results/a.csv", clone / "docs/b.png"
    enter = (path, "--command", "texgs run", "--code", "shading")
    called(monkeypatch, capsys, *enter)
    assert "0 of 2" in called(monkeypatch, capsys, picture, "--code", "a.csv")
    assert list(results.index().loc["a.csv"])[:1] == ["texgs run"]
    change(clone, "RATE = 2\n")
    assert re.findall(r"^\S+", called(monkeypatch, capsys), flags=re.MULTILINE)[:2] == ["a.csv", "b.png"]
    told = called(monkeypatch, capsys, path, "--mark")
    assert told.startswith(f"a.csv {results.index().revision['a.csv']} texgs.fitting.loop\n")
    page, about, readme = (clone / name for name in ("docs/page.md", "docs/accuracy.md", "README.md"))
    dagger = "[†](accuracy.md)"
    assert page.read_text() == (
        f"([a](../benchmarks/results/a.csv){dagger}), ![b](b.png){dagger}, [c](c.png)\n"
    )
    assert about.read_text() == "[a](../benchmarks/results/a.csv)†\n"
    assert readme.read_text() == "![b](docs/b.png)[†](docs/accuracy.md)\n"
    called(monkeypatch, capsys, "--mark")
    assert readme.read_text().count("†") == 1
    called(monkeypatch, capsys, *enter, "--mark")
    assert results.index().revision["a.csv"].endswith("-dirty")  # of no commit
    assert "†" not in page.read_text() + about.read_text() + readme.read_text()


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("texgs/fitting/other.py", "RATE = 2\n"),
        ("texgs/fitting/loop.py", "RATE  =  1  # one\n"),
        ("docs/page.md", ""),
    ],
)
def test_other_changes_do_not_count(clone, monkeypatch, capsys, name, text):
    called(monkeypatch, capsys, clone / "benchmarks/results/a.csv", "--code", "shading")
    change(clone, text, name)
    assert "0 of 1" in called(monkeypatch, capsys)
    assert not results.index().revision["a.csv"].endswith("-dirty")


def test_a_result_of_an_earlier_commit_has_its_digest(clone, monkeypatch, capsys):
    path, now = clone / "benchmarks/results/a.csv", ("--code", "shading")
    called(monkeypatch, capsys, path, *now)
    before = results.index().loc["a.csv"]
    change(clone, "RATE = 2\n")
    called(monkeypatch, capsys, path, *now, "--revision", before.revision)
    assert list(results.index().loc["a.csv"])[2:] == list(before)[2:]


def test_results_may_be_those_of_later_code_that_was_compared(clone, monkeypatch, capsys):
    path = clone / "benchmarks/results/a.csv"
    called(monkeypatch, capsys, path, "--code", "shading")
    before = results.index().loc["a.csv"]
    change(clone, "RATE = 1.0\n")
    assert "0 of 1" in called(monkeypatch, capsys, path, "--same", before.revision)
    now = results.index().loc["a.csv"]
    assert (now.revision, now.same) == (before.revision, f"{before.revision}-dirty")
    change(clone, "RATE = 2\n")
    with pytest.raises(SystemExit, match=r"--same: .*a\.csv"):
        called(monkeypatch, capsys, path, "--same", before.revision)
    assert "1 of 1" in called(monkeypatch, capsys)


def test_only_files_of_the_folder_enter_themselves(clone, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["benchmarks", "--sections", "views"])
    monkeypatch.setattr(sys.modules["__main__"], "__spec__", SimpleNamespace(name="benchmarks.__main__"))
    (clone / "a.csv").write_text("")
    results.note(clone / "a.csv", "shading")
    assert results.index().empty
    results.note(clone / "benchmarks/results/a.csv", "shading")
    assert results.index().command["a.csv"] == "python -m benchmarks --sections views"
