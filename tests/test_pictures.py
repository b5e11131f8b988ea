"""The pictures of the documentation: each is made by one function, from the files that its run makes."""

import shlex
import shutil

import numpy as np
import pytest
from PIL import Image

from benchmarks.results import DOCS, RESULTS, parts
from tests.scene.balls import write_balls
from texgs.core.checksum import Checksums
from texgs.core.io import write_json
from texgs.workflow.graph import graph_of
from texgs.workflow.sweep import as_sweep
from tools import pictures
from tools.pictures import PICTURES, RUN

OF_RESULTS = sorted(name for name, picture in PICTURES.items() if picture.source not in RUN)
OF_RUNS = sorted(PICTURES.keys() - {"viewer", "workflow", *OF_RESULTS})  # those have tests of their own
SCENES = ("scene.yaml", "pse-2.yaml", "relight-5.yaml")
SHEETS = ("sheet.png", "pse.png", "comparison.png", "gallery.png")
PANELS = {"hero": 6, "looks": 10, "styles": 30}


def test_each_picture_has_a_function_and_tells_its_code():
    assert {path.stem for path in DOCS.glob("*.png")} == PICTURES.keys()
    names = {name for picture in PICTURES.values() for name in picture.code.split()}
    assert not [name for name in names if not parts(name)]


@pytest.mark.parametrize("name", OF_RESULTS)
def test_pictures_of_results_are_those_that_are_drawn_of_them(name):
    picture = PICTURES[name]
    now = np.asarray(pictures.small(picture.draw(RESULTS / picture.source))).astype(int)
    there = np.asarray(Image.open(DOCS / f"{name}.png")).astype(int)
    assert np.abs(now - there).mean() < 0.5  # of 255: letters of another version of Matplotlib


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Folders of results with a small scene or picture wherever the plan of a run has one."""
    folder = tmp_path_factory.mktemp("runs")
    balls = write_balls(tmp_path_factory.mktemp("balls"))
    jobs = []
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name in {PICTURES[each].source for each in OF_RUNS}:
            for tf in ["TF01"] if name in ("image", "text") else ["TF01", "TF04_400"]:
                write_json(folder / f"data_{name}" / "vortex" / tf / "transforms_train.json", {})
            patch.setenv("TEXGS_DATA", str(folder / f"data_{name}"))
            jobs += planned(name)
    for place in map(folder.joinpath, jobs):
        if {place.name, place.parent.name} & {"edits", "comparison", "gallery", "compose", "pse", "sheet"}:
            shutil.copytree(balls.parent, place)
            for other in SCENES:
                shutil.copy(balls, place / other)
            for other in SHEETS:
                Image.new("RGB", (40, 20), "red").save(place / other)
    return folder


def planned(name):
    """The folders that a run writes, below the one of its name."""
    words = [word for word in shlex.split(RUN[name]) if "=" in word]
    return graph_of(as_sweep((*words, f"results={name}")), Checksums.load())[1].jobs


@pytest.mark.parametrize("name", OF_RUNS)
def test_pictures_of_runs_are_drawn_from_the_files_that_their_runs_make(runs, name):
    pixels = np.asarray(PICTURES[name].draw(runs / PICTURES[name].source).convert("RGB")).astype(int)
    if name in PANELS:
        frames = (np.abs(pixels - 217).max(axis=2) < 16).sum()  # grey lines around panels, lighter if reduced
        assert frames > 1500 * PANELS[name]
        assert pixels.std() > 10
    else:
        assert (pixels[..., 0] == 255).all()
        assert (pixels[..., 1] == 0).all()
