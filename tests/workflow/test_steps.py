"""A data set that is a series in time: its scene and edits have all steps, and a table tells of them."""

import numpy as np
import pytest
import yaml

from tests.cli.conftest import DEMO, VIEWS, copied, hide_weights, numbers
from tests.refusals import refused
from tests.report.written import read
from tests.volume.test_motion import blob
from texgs.cli.main import main
from texgs.config.compose import compose
from texgs.core.errors import ArgumentError, ConfigError, MissingDataError
from texgs.fitting import series
from texgs.report.tables import tables_of
from texgs.scene.scene_file import read_scene
from texgs.volume.generate import flame
from texgs.volume.nrrd_file import open_grid
from texgs.volume.prepare import prepare
from texgs.volume.slabs import ArraySource
from texgs.workflow.inputs import fitted_scene, scene_before
from texgs.workflow.locate import series_files
from texgs.workflow.stage_table import jobs

RINGS = ["dataset=rings", *VIEWS[1:], *DEMO, "fit.shading.iterations=60"]
RINGS += ["dataset.volume.size=24", "dataset.volume.steps=3", "dataset.volume.time=1"]
GOLD = ["edit_text", *RINGS, "edit=gold", "edit.text.size=64"]
MINE = """\
name: mine
volume: {file: step_9.nrrd}
series: [step_*.nrrd]
basic_tfs:
  TF01: {opacity: [[0.2, 0.0], [0.5, 0.5]], color: [[0.2, 0.8, 0.3, 0.2]]}
"""


@pytest.fixture(scope="module")
def rings(tmp_path_factory):
    """The scene of three steps, a look of it and its page."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("rings")
        patch.chdir(folder)
        hide_weights(patch, folder)
        patch.setattr("texgs.report.before_after.TURNTABLE_FRAMES", 4)
        for name, value in {"VIEW_SIZE": 32, "ROUNDS": 1}.items():
            patch.setattr(series, name, value)
        for words in (["steps", *RINGS], GOLD, ["page", *RINGS]):
            assert main(words) == 0
    return folder / "results" / "rings" / "scene" / "demo"


@pytest.mark.stages
def test_the_scene_of_a_generated_series_has_all_steps(rings):
    scene = read_scene(rings / "steps" / "scene.yaml")
    assert (scene.time, list(scene.series.steps)) == (1, ["step 0", "step 1", "step 2"])
    volumes = [open_grid(scene.at(step).volume.file).values for step in range(3)]
    assert len({volume.tobytes() for volume in volumes}) == 3
    composed = read_scene(rings / "compose" / "scene.yaml")
    assert scene.volume.file.read_bytes() == composed.volume.file.read_bytes()
    assert (rings / "steps" / "time.mp4").stat().st_size > 1000


@pytest.mark.stages
def test_an_edit_of_the_series_holds_for_all_its_steps(rings):
    before, after = (read_scene(rings / name / "scene.yaml") for name in ("steps", "edits/gold"))
    assert [*after.series.steps] == [*before.series.steps]
    for step in range(3):
        own, other = (each.at(step).models["TF02"].open()[0].parameters for each in (before, after))
        assert np.array_equal(own["means"], other["means"])
        assert not np.array_equal(own["colors"], other["colors"])


@pytest.mark.stages
def test_a_table_says_how_close_steps_are_to_their_volumes(rings):
    told = numbers(rings / "steps")
    assert [entry["title"] for entry in told["compared"]] == ["step 0", "step 1", "step 2"]
    assert told["step_seconds"] > 0
    (row,) = tables_of(read([rings / "steps" / "metrics.json"]))["steps"].rows
    assert (row["steps"], row["compared"]) == (3, 3)
    scores = [entry["psnr"] for entry in told["compared"]]
    assert row["PSNR"] == pytest.approx(np.mean(scores))
    assert row["PSNR of the worst step"] == min(scores) > 10


@pytest.mark.stages
def test_a_job_that_was_stopped_goes_on_in_the_middle_of_the_series(rings, tmp_path, monkeypatch):
    monkeypatch.chdir(copied(rings.parents[2], tmp_path))
    hide_weights(monkeypatch, tmp_path)
    step, titles = series.Follower.step, []

    def stopped(*words, **more):
        titles.append(words[4])
        if len(titles) == 3:
            raise KeyboardInterrupt
        return step(*words, **more)

    monkeypatch.setattr(series.Follower, "step", stopped)
    for name, value in {"VIEW_SIZE": 32, "ROUNDS": 1}.items():
        monkeypatch.setattr(series, name, value)
    words = ["steps", "--replace", *RINGS, "views.shading.diffuse=0.65"]
    assert main(words) == 130
    assert main(words) == 0
    assert titles == ["TF01, step 2", "TF01, step 0", "TF02, step 2", "TF02, step 2", "TF02, step 0"]


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """A data set of four files."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TEXGS_DATA", str(tmp_path))
    (tmp_path / "conf" / "dataset").mkdir(parents=True)
    (tmp_path / "conf" / "dataset" / "mine.yaml").write_text(MINE)
    for number in (8, 9, 10, 11):
        (tmp_path / f"step_{number}.nrrd").touch()
    return tmp_path


def test_a_new_data_set_may_be_a_series_of_files(mine):
    for number, place in enumerate((-0.06, 0.0, 0.06, 0.12), start=8):
        prepare(ArraySource(blob((place, 0, 0), sizes=(16, 16, 16))), mine / f"step_{number}.nrrd")
    assert main(["new", "step_9.nrrd", "--series", "step_*.nrrd", "--name", "mine", "--force"]) == 0
    text = yaml.safe_load((mine / "conf" / "dataset" / "mine.yaml").read_text())
    assert text["series"] == [str(mine / "step_*.nrrd")]
    config = compose(("dataset=mine", "fit=quick"))
    assert series_files(config) == [mine / f"step_{number}.nrrd" for number in (8, 9, 10, 11)]
    stages = {stage.name: each for stage, each in jobs(config)}
    assert fitted_scene(config).parts[-2:] == ("steps", "scene.yaml")
    assert scene_before(config) == fitted_scene(config)
    assert "steps" in stages
    assert "steps" not in {stage.name for stage, _ in jobs(compose(("dataset=mine", "fit=gaussians")))}
    assert "steps" not in {stage.name for stage, _ in jobs(compose(("dataset=sphere",)))}


@pytest.mark.parametrize(
    ("gone", "listed", "error", "named"),
    [
        (9, "[step_*.nrrd]", MissingDataError, "step_9.nrrd is not there"),
        (10, "[step_*.nrrd]", ArgumentError, "series of mine: .* got none between step_9"),
        (8, "[other_*.nrrd]", MissingDataError, "data set mine: dataset.series: .* got .*other_"),
        (
            8,
            "[step_10.nrrd,step_11.nrrd]",
            ConfigError,
            "of mine: expected volume.file to be one of",
        ),
    ],
)
def test_files_that_are_missing_are_told_before_any_job(mine, gone, listed, error, named):
    (mine / f"step_{gone}.nrrd").unlink()
    refused(lambda: series_files(compose(("dataset=mine", f"dataset.series={listed}"))), named, error)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["dataset=rings", "dataset.volume.time=20"], "expected a step from 0 to 19 of rings, got time=20"),
        (["dataset=sphere", "dataset.volume.steps=3"], "expected steps=1 of sphere, got time=0 steps=3"),
    ],
)
def test_steps_that_a_generator_does_not_make_are_refused(words, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["volume", *words, "tracking=none"]) == 2
    assert message in capsys.readouterr().err


def test_a_flame_has_another_seed_and_time(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["volume.generator=flame", "volume.size=16", "volume.steps=5", "volume.time=3", "volume.seed=7"]
    words = ["dataset=sphere", *(f"dataset.{word}" for word in words), "tracking=none"]
    assert main(["volume", *words]) == 0
    grid = open_grid(tmp_path / "results" / "sphere" / "volume" / "volume.nrrd")
    np.testing.assert_array_equal(grid.values, flame(16, 0.75, 7).values)
