"""A function of a scene goes into the file of its data set, where everything else stays as it is."""

import difflib
import json
import os
from dataclasses import replace

import numpy as np
import pytest
import yaml

from tests.config.kept import DATA_SET, TRIED, project
from tests.refusals import refused
from tests.viewer.pages import on_page
from texgs.cli.main import main
from texgs.config.compose import recompose
from texgs.config.dataset_text import as_yaml
from texgs.config.kept_function import keep
from texgs.config.project import ROOT
from texgs.core.errors import TexgsError
from texgs.edit.function_model import with_model
from texgs.scene.scene_file import write_scene
from texgs.volume.basic_tfs import basic_tfs_of
from texgs.volume.generate import sphere
from texgs.volume.grid import Grid
from texgs.volume.prepare import prepare_channels
from texgs.volume.slabs import ArraySource
from texgs.volume.summaries import write_summaries
from texgs.volume.transfer import TransferFunction
from texgs.workflow.checks import check_basic_tfs

IN_DATA = DATA_SET.replace("tf_values: fraction\n", "")
FLOW = "basic_tfs: {TF01: {opacity: [[0.3, 0.0], [0.4, 0.1]], color: [[0.3, 0, 0, 1]]}}\n"
INHERITED = "defaults: [jets, _self_]\nname: mine\n"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def scene_file(here):
    return write_scene(here / "scene.yaml", project(here))


def channels_of(folder, is_scaled):
    """A project whose volume has a second channel, ten times as large, with a scene that tries a function."""
    scene = project(folder)
    sources = [ArraySource(Grid(sphere(16).values * factor)) for factor in (1, 10)]
    first, second = prepare_channels(sources, scene.volume.file)
    write_summaries(scene.volume.file, [first, second], ["DAPI", "GFP"])
    document = {**yaml.safe_load(DATA_SET), "volume": {"file": "cells.zarr"}}
    for tf, channel in zip(document["basic_tfs"].values(), ("DAPI", "GFP"), strict=True):
        tf["channel"] = channel
    if not is_scaled:
        del document["tf_values"]
        for tf, known in zip(document["basic_tfs"].values(), (first, second), strict=True):
            for points in (tf["opacity"], tf["color"]):
                for point in points:
                    point[0] = known.minimum + point[0] * (known.maximum - known.minimum)
    file_of(folder).write_text(as_yaml(document))
    points = [
        (second.minimum + share * (second.maximum - second.minimum), alpha) for share, alpha in TRIED["TF03"]
    ]
    return replace(scene, functions={"TF03": TransferFunction(points, ((0, 1, 0, 0),), 1)})


@pytest.mark.parametrize("is_scaled", [True, False])
def test_a_function_of_a_channel_names_it(here, is_scaled):
    scene = channels_of(here, is_scaled)
    assert "TF03 is a basic transfer function" in keep(scene, "TF03")
    dataset = recompose(("dataset=mine",)).dataset
    check_basic_tfs(dataset)
    assert [tf.channel for tf in dataset.basic_tfs.values()] == ["DAPI", "GFP", "GFP"]
    made = basic_tfs_of(scene.volume.file, {"TF03": dataset.basic_tfs["TF03"]}, dataset.tf_values)["TF03"]
    assert made.channel == 1
    np.testing.assert_allclose(made.opacity, scene.functions["TF03"].opacity, rtol=1e-5)


def test_a_scene_of_other_channels_than_its_data_set_has_now_is_refused(here):
    """Functions name channels by number: those of labels would be of another one without a word."""
    scene = channels_of(here, is_scaled=False)
    document = yaml.safe_load(file_of(here).read_text())
    del document["basic_tfs"]["TF01"]
    file_of(here).write_text(as_yaml(document))
    refused(
        lambda: keep(scene, "TF03"), "expected those of the scene's volume, of DAPI, GFP, got others, of GFP;"
    )


def file_of(folder):
    return folder / "conf" / "dataset" / "mine.yaml"


@pytest.mark.parametrize(
    ("text", "name"),
    [
        *((DATA_SET, name) for name in ("TF03", "touching")),
        (IN_DATA, "TF03"),
        (DATA_SET.replace("\n", "\r\n"), "TF03"),
        (DATA_SET[: DATA_SET.index("\n\n# How")], "TF03"),  # no break at the end
        (DATA_SET.replace("# How edits look.\n", ""), "TF03"),
        (DATA_SET + "framed_by: [TF01]\n", "TF03"),
    ],
)
def test_one_function_is_added_and_nothing_else_changes(here, text, name):
    scene = project(here, text)
    before = yaml.safe_load(text)
    said = keep(scene, name)
    assert (
        said == f"conf/dataset/mine.yaml: {name} is a basic transfer function; then: texgs run dataset=mine"
    )
    written = file_of(here).read_bytes().decode()
    changes = difflib.ndiff(text.splitlines(), written.splitlines())
    assert [line for line in changes if line[0] == "-"] == []
    assert written.count("\r") == (written.count("\n") if "\r" in text else 0)
    after = yaml.safe_load(written)
    added = after["basic_tfs"].pop(name)
    assert after == {"framed_by": ["TF01", "TF02"], **before}
    width = 1.0 if "fraction" in text else 0.9674606
    assert np.array(added["opacity"]) == pytest.approx(np.array(TRIED[name]) * (width, 1), abs=1e-6)
    assert added["color"] == [[0, 0.2, 0.4, 0.6]]


def test_comments_stay_with_what_they_are_about(here):
    keep(project(here), "TF03")
    lines = file_of(here).read_text().splitlines()
    at = lines.index("    TF03:")
    assert lines[at - 1] == "        # its colours are from elsewhere"
    assert lines[at + 3 : at + 6] == ["framed_by: [TF01, TF02]", "", "# How edits look."]


def test_the_workflow_has_the_function_as_the_scene_shows_it(here):
    scene = project(here)
    keep(scene, "TF03")
    dataset = recompose(("dataset=mine",)).dataset
    check_basic_tfs(dataset)
    read = basic_tfs_of(scene.volume.file, dataset.basic_tfs, dataset.tf_values)["TF03"]
    values = np.linspace(0, 1, 1001)
    assert read(values) == pytest.approx(scene.functions["TF03"](values), abs=2e-5)
    assert dataset.framing == ["TF01", "TF02"]


def test_a_second_function_moves_no_views_either_and_may_be_a_model(here):
    """A server that runs all day reads the file anew."""
    scene = project(here)
    keep(scene, "TF03")
    refused(lambda: keep(scene, "touching"), "TF03 and touching")
    made = with_model(scene, "outer", scene.models["TF01"].file, scene.functions["outer"])
    assert "outer" not in made.functions
    said = keep(made, "outer")
    dataset = recompose(("dataset=mine",)).dataset
    assert list(dataset.basic_tfs) == ["TF01", "TF02", "TF03", "outer"]
    assert dataset.framed_by == ["TF01", "TF02"]
    assert "It reaches 0." in said
    assert said.endswith("add it to dataset.framed_by.")


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("none", DATA_SET, "functions: .*got none"),
        ("no name", DATA_SET, "function: .*'no name'"),
        ("TF02", DATA_SET, r"conf/dataset/mine\.yaml: basic_tfs: TF02"),
        ("over", DATA_SET, r"TF02 and over: .*\(0\.773968458, 0\.967460573\)"),
        ("beyond", DATA_SET, r"opacity\[2\]: .*1\.5"),
        ("nowhere", IN_DATA, "visible"),
        ("TF03", "name: mine\n" + FLOW, "basic_tfs: .*lines below"),
        ("outer", INHERITED, "basic_tfs: .*lines below"),
        ("TF03", DATA_SET.replace("mine", "yours", 2), "mine"),
        ("TF03", DATA_SET + "colour: 1\n", "colour: "),
        ("TF03", DATA_SET + "a: [\n", r"conf/dataset/mine\.yaml:25: "),
        ("TF03", DATA_SET + "framed_by: []\n", "framed_by"),
        ("TF03", DATA_SET + "framed_by: [TF3]\n", r"dataset\.framed_by: .*TF3"),
    ],
)
def test_what_cannot_be_kept_is_told_and_nothing_is_written(here, name, text, told):
    scene = project(here, text)
    refused(lambda: keep(scene, name), told, TexgsError)
    assert file_of(here).read_bytes() == text.encode()
    assert [path.name for path in file_of(here).parent.iterdir()] == ["mine.yaml"]


@pytest.mark.parametrize(
    ("facts", "told"),
    [
        ({"dataset": "engine"}, f"copy {ROOT / 'conf' / 'dataset' / 'engine.yaml'}"),
        ({"dataset": "yours"}, "conf/dataset/yours.yaml: "),
        ({"dataset": "../../x"}, "its name: "),
        ([], "its name: "),
        (None, "volume: "),
    ],
)
def test_a_volume_of_another_data_set(here, facts, told):
    scene = project(here)
    metrics = scene.volume.file.with_name("metrics.json")
    metrics.unlink() if facts is None else metrics.write_text(json.dumps(facts))
    refused(lambda: keep(scene, "TF03"), told, TexgsError)
    assert file_of(here).read_text() == DATA_SET


def test_a_file_that_is_read_only_stays_and_a_scene_needs_a_volume(here, monkeypatch):
    scene = project(here)
    refused(lambda: keep(replace(scene, volume=None), "TF03"), r"functions: .*none")
    monkeypatch.setattr(os, "access", lambda path, mode: path.suffix != ".yaml")
    refused(lambda: keep(scene, "TF03"), r"mine\.yaml: ", TexgsError)
    assert file_of(here).read_text() == DATA_SET


def test_the_command_line(here, scene_file, capsys):
    assert main(["model", str(scene_file), "over", "--keep"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("texgs model: conf/dataset/mine.yaml: basic_tfs: TF02 and over: ")
    assert file_of(here).read_text() == DATA_SET
    assert main(["model", str(scene_file), "TF03", "--keep"]) == 0
    assert capsys.readouterr().out.endswith("then: texgs run dataset=mine\n")
    assert "TF03" in yaml.safe_load(file_of(here).read_text())["basic_tfs"]
    for words in ([], ["--keep", "--output", "new.yaml"]):
        refused(lambda words=words: main(["model", str(scene_file), "outer", *words]), "2", SystemExit)


@on_page
async def test_the_viewer(browser, client, scene_file, here):
    await browser.send(type="keep", function="over")
    notice = await browser.next("notice")
    assert notice["level"] == "error"
    assert "TF02 and over: " in notice["text"]
    while (await browser.next("job"))["done"] is not None:
        pass
    assert file_of(here).read_text() == DATA_SET
    await browser.send(type="keep", function="TF03")
    notice = await browser.next("notice")
    assert (notice["level"], notice["text"][:28]) == ("info", "conf/dataset/mine.yaml: TF03")
    assert client.server_side.edits.scene.functions.keys() == TRIED.keys()
    assert "TF03" in yaml.safe_load(file_of(here).read_text())["basic_tfs"]
