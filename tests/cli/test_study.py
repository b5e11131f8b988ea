"""A user study from the command line: made of tiny scenes, answered, counted."""

import base64
import json
import re
import shutil
from itertools import permutations

import av
import numpy as np
import pytest
from PIL import Image

from tests.fields.voxels.test_voxels import ball
from tests.study.studies import WORDS, edit, fit
from texgs.cli.main import main
from texgs.fields.voxels import write_voxels
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import write_scene

EDITS = ("arf_quick", "stylesplat_quick", "texgs_style")
SMALL = ("--size", "64", "--frames", "2")


@pytest.fixture
def results(tmp_path, monkeypatch):
    """Results with three edits by a picture and two by an instruction, below the current folder."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "results"
    model = write_voxels(tmp_path / "model.safetensors", ball(side=16, spacing=0.04))
    recipe, by_words = "plenoxels_quick", ("in2n_quick", "dge_quick")
    jobs = [fit(folder, recipe), *(edit(folder, name, recipe, method="arf") for name in EDITS)]
    jobs += [edit(folder, name, recipe, "engine", WORDS, "in2n") for name in by_words]
    for job in jobs:
        write_scene(job.with_name("scene.yaml"), Scene({"TF01": SceneModel(model)}))
        Image.fromarray(np.zeros((8, 8, 3), dtype=np.uint8)).save(job.with_name("style.png"))
    return folder


def key(folder):
    return json.loads((folder / "key.json").read_text())


def vote(folder, ballot, ranks):
    """The ballot that gives methods these ranks, by the name of the edit."""
    known = key(folder)
    lines = [
        f"{known['study']},{ballot},{number},{'ABC'[place]},{ranks[option['edit']]}"
        for number, question in enumerate(known["questions"], start=1)
        for place, option in enumerate(question["options"])
    ]
    (folder / "votes").mkdir(exist_ok=True)
    path = folder / "votes" / f"ballot-{ballot}.csv"
    path.write_text("\n".join(["study,ballot,question,option,rank", *lines]))
    return path


def test_a_study_is_made_answered_and_counted(results, capsys):
    assert main(["study", *SMALL]) == 0
    out = capsys.readouterr().out
    assert "1. engine, image-driven: arf_quick, stylesplat_quick, texgs_style" in out
    assert "2. engine, text-driven: dge_quick, in2n_quick" in out
    for number, order in enumerate(permutations((2, 3))):
        ranks = {"stylesplat_quick": 1, "arf_quick": order[0], "texgs_style": order[1]}
        vote(results / "study", f"{number}", {**ranks, "in2n_quick": 2, "dge_quick": 1})
    assert main(["votes"]) == 0
    table = (results / "tables" / "user_study.md").read_text()
    assert capsys.readouterr().out.strip() == table.strip()
    assert "## User study" in table
    line = r"\| image-driven \| all 1 \| - \| plenoxels_quick \| stylesplat_quick \| arf \| 2 \| 0 \| 0 \|"
    assert re.search(line, table)
    assert "| image-driven | wood | - | - | the paper | TexGS-VolVis | 8 | 2 | 0 | 0 |" in table
    endings = {path.suffix for path in (results / "tables").glob("user_study.*")}
    assert endings == {".csv", ".md", ".png", ".tex"}


def test_what_voters_get_names_no_method(results, tmp_path):
    assert main(["study", *SMALL, "--output", "out"]) == 0
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"ballot.html", "key.json"}
    page = (tmp_path / "out" / "ballot.html").read_text()
    films = re.findall(r"<template>(.*?)</template>", page)
    assert len(films) == 2
    for film in films:
        page = page.replace(film, "")
        (tmp_path / "film.mp4").write_bytes(base64.b64decode(film))
        with av.open(str(tmp_path / "film.mp4")) as opened:
            told = str([opened.metadata, *(stream.metadata for stream in opened.streams)])
        assert not named(told), "in the film"
    page = re.sub(r"base64,[\w+/=]+", "", page)
    assert not named(page)
    questions = key(tmp_path / "out")["questions"]
    shown = {option["edit"] for question in questions for option in question["options"]}
    assert shown == {*EDITS, "in2n_quick", "dge_quick"}


def named(text):
    """Names of methods, recipes and texgs in a text, in any case; `style` is a word of HTML too."""
    names = (
        r"arf|style[_-]?splat|style[_-]?rf|in2n|igs2gs|ig2g|dge|texgs|plenoxels|voxel|surfel|gaussian|_quick"
    )
    return re.findall(rf"\b\w*(?:{names})\w*", text, flags=re.IGNORECASE)


def test_a_study_is_made_once_of_one_copy_of_results_and_counted_with_ballots(results, capsys):
    def refused(verb, told):
        assert main(verb) == 2
        assert told in capsys.readouterr().err

    refused(["study", "--edits", "arf_quick"], "engine arf_quick")
    refused(["study", "results=nothing"], "nothing: ")
    assert not (results / "study").exists()
    copy = shutil.copytree(results / "engine", results / "before" / "engine")
    refused(["study", *SMALL], "same job in")
    refused(["votes"], "results/study/key.json: ")
    shutil.rmtree(copy)
    assert main(["study", *SMALL, "--edits", *EDITS]) == 0
    before = (results / "study" / "ballot.html").read_bytes()
    refused(["study", *SMALL], "results/study/key.json: ")
    refused(["votes"], "results/study/votes")
    assert (results / "study" / "ballot.html").read_bytes() == before
    assert not (results / "tables").exists()
