"""Which results of earlier runs tables show: not those of a fit that is another one now."""

import shutil
from os.path import relpath
from pathlib import Path
from types import SimpleNamespace

import pytest

from texgs.core.cache import Checksums
from texgs.core.io import write_json
from texgs.workflow import result
from texgs.workflow.graph import Graph, earlier_results

VIEWS, FIT, EDIT = (
    Path("results/engine", name) for name in ("TF01/views", "TF01/quick/texture", "edits/gold")
)


def make(folder, identity, stage="texture", **made_from):
    """A complete result."""
    work = result.claim(folder, identity)
    (work / "model.safetensors").write_text(str(identity))
    inputs = {name: result.fingerprint(path, Checksums()) for name, path in made_from.items()}
    paths = {name: relpath(path, folder) for name, path in made_from.items()}
    write_json(work / result.METRICS, {"stage": stage, "inputs": inputs, "made_from": paths})
    result.publish(folder)


def job(folder, identity, *inputs):
    files = {str(index): path / "model.safetensors" for index, path in enumerate(inputs)}
    return {folder.as_posix(): SimpleNamespace(inputs=files, output=folder, identity=lambda: identity)}


@pytest.fixture(autouse=True)
def results(tmp_path, monkeypatch):
    """Views, a fit, and an edit of it."""
    monkeypatch.chdir(tmp_path)
    make(VIEWS, {"settings": "v"}, "views")
    make(FIT, {"settings": "a"})
    make(EDIT, {"settings": "e"}, "edit_text", model=FIT / "model.safetensors")


def shown(jobs):
    """Folders of the results that tables show beside those of some jobs, and those that they do not."""
    files, outdated = earlier_results("results", Graph(jobs, {"": list(jobs)}), Checksums())
    return {str(Path(file).parent) for file in files}, {entry.what for entry in outdated}


def test_whole_results_of_other_runs_are_shown():
    assert shown({}) == ({str(VIEWS), str(FIT), str(EDIT)}, set())
    assert shown(job(FIT, {"settings": "a"}, VIEWS) | job(VIEWS, {"settings": "v"})) == ({str(EDIT)}, set())
    (EDIT / "model.safetensors").write_text("damaged")
    assert shown({}) == ({str(VIEWS), str(FIT)}, {str(EDIT)})
    (entry,) = earlier_results("results", Graph(), Checksums())[1]
    assert entry.why == "model.safetensors is damaged or missing; run its job again"


def test_an_edit_of_a_fit_that_has_been_made_anew_is_left_out_and_told():
    make(FIT, {"settings": "b"})
    assert shown({}) == ({str(VIEWS), str(FIT)}, {str(EDIT)})
    (entry,) = earlier_results("results", Graph(), Checksums())[1]
    assert entry.why == f"comes from {FIT}, which has been made anew since; run its job again"


def test_what_comes_from_it_is_left_out_however_far():
    make(VIEWS, {"settings": "v"}, "views")
    make(FIT, {"settings": "a"}, views=VIEWS / "model.safetensors")
    make(EDIT, {"settings": "e"}, "edit_text", model=FIT / "model.safetensors")
    assert shown({}) == ({str(VIEWS), str(FIT), str(EDIT)}, set())
    make(VIEWS, {"settings": "w"}, "views")
    assert shown({}) == ({str(VIEWS)}, {str(FIT), str(EDIT)})
    assert {entry.why.partition(",")[0] for entry in earlier_results("results", Graph(), Checksums())[1]} == {
        f"comes from {VIEWS}"
    }


@pytest.mark.parametrize(
    "jobs",
    [job(FIT, {"settings": "b"}), job(FIT, {"settings": "a"}, VIEWS) | job(VIEWS, {"settings": "w"})],
    ids=["the fit", "its views"],
)
def test_an_edit_of_a_fit_that_this_run_replaces_is_left_out(jobs):
    assert shown(jobs)[1] == {str(EDIT)}


def test_an_edit_of_a_fit_that_is_gone_is_shown():
    for file in FIT.iterdir():
        file.unlink()
    assert str(EDIT) in shown({})[0]


def test_a_copy_is_of_its_own_results():
    """Whatever becomes of those that it was copied from."""
    shutil.copytree("results", "kept")
    make(FIT, {"settings": "b"})
    assert not earlier_results("kept", Graph(), Checksums())[1]
    copies = [Path("kept", *folder.parts[1:]) for folder in (FIT, EDIT)]
    make(copies[0], {"settings": "b"})
    assert [entry.what for entry in earlier_results("kept", Graph(), Checksums())[1]] == [str(copies[1])]


def test_a_result_of_a_stage_that_is_gone_is_left_out_and_told():
    make(Path("results/engine/projection"), {"settings": "p"}, "projection")
    (entry,) = earlier_results("results", Graph(), Checksums())[1]
    assert entry.why == "is of the stage projection, which is not there any more; remove the folder"
