"""Fits from Python: the stages of the workflow without a project, and the fit in seconds."""

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import texgs
from tests.fitting.short_fits import shorten
from tests.refusals import refused
from texgs.api.fit import compose_in, configuration
from texgs.core.errors import ArgumentError, ConfigError, DeviceError
from texgs.core.geometry import quats_to_matrices
from texgs.core.io import write_json
from texgs.metrics.quality import compare
from texgs.scene.scene_file import read_scene
from texgs.viewer.origins import Origins
from texgs.volume.cameras import spiral
from texgs.workflow.result import claim, publish

TFS = {
    "outer": texgs.TransferFunction([[0.2, 0.0], [0.3, 0.1], [0.4, 0.0]], [[0.3, 0.2, 0.4, 0.9]]),
    "inner": texgs.TransferFunction([[0.6, 0.0], [0.8, 0.5], [1.0, 0.5]], [[0.8, 0.9, 0.5, 0.1]]),
}
SMALL = ("views.train.frequency=1", "fit.seeds.count=400", "fit.shading.iterations=30", "views.step=1")


@pytest.fixture(scope="module")
def ball():
    x, y, z = np.meshgrid(*[np.linspace(-1, 1, 20)] * 3, indexing="ij")
    return texgs.Volume(np.sqrt(np.maximum(0, 1 - x * x - y * y - z * z)).astype(np.float32), name="ball")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("results")


@pytest.fixture(scope="module")
def scene(ball, folder):
    return texgs.fit(ball, TFS, size=32, overrides=SMALL, folder=folder)


def test_it_is_what_the_workflow_makes(scene, folder):
    assert scene.parts == ["outer", "inner"]
    made = read_scene(folder / "ball" / "scene" / "quick" / "compose" / "scene.yaml")
    assert made == scene.session.scene
    assert made.volume.tfs == TFS
    numbers = json.loads((folder / "ball" / "inner" / "quick" / "texture" / "metrics.json").read_text())
    assert numbers["numbers"]["train_views"] == 12
    assert numbers["numbers"]["width"] == 32


def test_a_saved_scene_keeps_its_volume_and_the_histogram(scene, ball, tmp_path):
    saved = read_scene(scene.save(tmp_path / "kept"))
    assert saved.volume.file == tmp_path / "kept" / "volume.nrrd"
    shown = Origins(saved).transfer
    assert (shown["minimum"], shown["maximum"]) == (ball.summary.minimum, ball.summary.maximum)
    assert sum(shown["histogram"]) == 20**3


def test_a_second_fit_in_the_folder_does_nothing(scene, ball, folder):
    files = {path: path.stat().st_mtime_ns for path in folder.rglob("model.safetensors")}
    same = texgs.Volume(ball.grid.values, name="ball")  # as another process has it
    again = texgs.fit(same, TFS, size=32, overrides=SMALL, folder=folder)
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("model.safetensors")} == files
    assert np.array_equal(np.asarray(again.render(width=32)), np.asarray(scene.render(width=32)))


def test_a_fit_with_other_settings_in_the_folder_says_what_it_replaces(ball, monkeypatch, tmp_path):
    monkeypatch.setattr("texgs.workflow.execution.execute", lambda *job, **force: True)
    folder = tmp_path / "kept"
    views = folder / "ball" / "inner" / "views"
    write_json(claim(views, {"settings": "others"}) / "metrics.json", {})
    publish(views)
    with pytest.warns(UserWarning, match=r"views holds results of other settings, which this replaces; anot"):
        compose_in(ball, TFS, ("fit=quick",), folder)


def test_results_are_a_table(scene, folder):
    table = texgs.results(folder)
    row = table[(table.stage == "texture") & (table.tf == "inner")].iloc[0]
    file = folder / "ball" / "inner" / "quick" / "texture" / "metrics.json"
    assert row.psnr == json.loads(file.read_text())["numbers"]["psnr"]
    assert (row.dataset, row.recipe) == ("ball", "quick")
    refused(lambda: texgs.results(folder / "nothing"), "expected results of texgs run, got none")


def test_results_of_a_stage_need_nothing_but_their_folder(tmp_path):
    """Also those that a module of a stage defines, in a process that has run none."""
    numbers = {"basic_tfs": 1, "ranges": {}}
    facts = {"stage": "transfer", "dataset": "ball", "result": "TransferResult", "numbers": numbers}
    write_json(claim(tmp_path / "transfer", {}) / "metrics.json", facts)
    publish(tmp_path / "transfer")
    code = f"import texgs; print(texgs.results({str(tmp_path)!r}).stage[0])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "transfer\n", done.stderr


def test_psnr_is_the_mean_beside_the_volume(scene):
    session = scene.session
    lens = session.scene.framed().lens(width=24, height=24)
    each = [compare(*session.beside(camera, session.scene))["psnr"] for camera in spiral(3, lens)]
    assert scene.psnr(views=3, width=24) == pytest.approx(np.mean(each))
    assert min(each) > 15


def test_the_volume_stays_as_long_as_the_scene(ball):
    made = texgs.fit(texgs.Volume(ball.grid.values), {"TF01": TFS["inner"]}, size=32, overrides=SMALL)
    assert np.asarray(made.render(width=24, mode="volume")).std() > 1  # nothing else holds the volume


def test_other_threads_fit_and_render_the_same(scene, ball, tmp_path):
    def work():
        made = texgs.fit(ball, TFS, size=32, overrides=SMALL, folder=tmp_path)
        return np.asarray(made.render(width=32))

    with ThreadPoolExecutor(1) as pool:
        assert np.array_equal(pool.submit(work).result(), np.asarray(scene.render(width=32)))


def test_surfels_as_polygons_lie_where_the_volume_does(scene):
    mesh = scene.to_pyvista()
    assert mesh.n_cells == len(scene.session.composition)
    assert mesh.n_points == 6 * mesh.n_cells
    inside = scene.session.composition.parts[1].model.parameters["means"].numpy()
    physical = (inside + 0.5) * 19  # the volume goes from 0 to 19
    assert np.allclose(mesh.cell_centers().points[-len(inside) :], physical, atol=1e-3)
    p = scene.session.composition.parts[0].model.parameters
    disc, lit = (quats_to_matrices(p[name])[5, :, 2].numpy() for name in ("quats", "normals"))
    corners = mesh.points[30:36] - mesh.points[30:36].mean(axis=0)
    assert np.abs(corners @ disc).max() < 1e-4 * np.abs(corners).max()
    assert np.allclose(mesh.cell_data["Normals"][5], lit, atol=1e-6)
    scene["outer"].visible = False
    try:
        rest = scene.to_pyvista()
        assert rest.n_cells == len(inside)
        assert rest.cell_data["rgba"].dtype == np.uint8
        assert rest.cell_data["rgba"][:, 0].mean() > rest.cell_data["rgba"][:, 2].mean() + 100  # orange
    finally:
        scene["outer"].visible = True


def test_models_in_seconds(ball, monkeypatch, tmp_path):
    shorten(monkeypatch, frequency=1, surfels=300, iterations=20)
    overlapping = {**TFS, "all": texgs.TransferFunction([[0.1, 0.0], [1, 0.1]], [[0, 1, 1, 1]])}
    scene = texgs.fit(ball, overlapping, "now", size=32, folder=tmp_path)
    assert scene.parts == ["outer", "inner", "all"]
    assert (tmp_path / "inner.safetensors").is_file()
    assert scene.psnr(views=2, width=24) > 15
    assert texgs.open(tmp_path).parts == scene.parts
    assert read_scene(tmp_path / "scene.yaml").volume.file == tmp_path / "ball.nrrd"
    assert Origins(scene.session.scene).transfer["maximum"] == ball.summary.maximum


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"volume": np.zeros((3, 3, 3))}, ArgumentError, "volume: expected a texgs.Volume, got ndarray"),
        ({"recipe": "quik"}, ArgumentError, "recipe: expected one of now, .*, got quik, did you mean quick?"),
        ({"seed": -1}, ArgumentError, "seed: expected a whole number from 0 on, got -1"),
        ({"size": 8}, ArgumentError, "size: expected a whole number of pixels, at least 16, got 8"),
        ({"overrides": "views.step=3"}, ArgumentError, "overrides: expected a list of words such as"),
        ({"overrides": ["views.trian=3"]}, ConfigError, "views.trian: no such key"),
        ({"functions": [TFS["inner"], TFS["inner"]]}, ArgumentError, "TF01 and TF02"),
        ({"functions": {1: TFS["inner"]}}, ArgumentError, "functions: expected names that are words, got 1;"),
        ({"functions": {"1x": TFS["inner"]}}, ConfigError, "1x"),
        ({"functions": TFS["inner"].scaled(0, 9)}, ArgumentError, "expected a range within the data"),
        ({"recipe": "now", "functions": {"a/b": TFS["inner"]}}, ArgumentError, "functions"),
        ({"recipe": "now", "overrides": SMALL}, ArgumentError, "overrides: not for the recipe now"),
        ({"device": "gpu"}, DeviceError, "device: expected cpu or cuda, got gpu"),
    ],
)
def test_what_cannot_be_fitted_is_told_before_a_fit(ball, change, error, words, monkeypatch):
    monkeypatch.setattr("texgs.fitting.now.fit_now", None)
    refused(lambda: texgs.fit(**{"volume": ball, "functions": TFS, "size": 32, **change}), words, error)


def test_an_interrupted_fit_goes_on(ball, monkeypatch, tmp_path):
    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("texgs.fitting.texels.texturize", interrupted)
        with pytest.raises(KeyboardInterrupt):
            texgs.fit(ball, TFS["inner"], size=32, overrides=SMALL, folder=tmp_path)
    assert not list(tmp_path.rglob("texture/model.safetensors"))
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("shading/model.safetensors")}
    scene = texgs.fit(ball, TFS["inner"], size=32, overrides=SMALL, folder=tmp_path)
    assert scene.parts == ["TF01"]
    assert before
    assert {path: path.stat().st_mtime_ns for path in before} == before


@pytest.mark.parametrize("theirs", ["ball.nrrd", "ball.json"])
def test_files_of_the_folder_are_not_replaced(ball, monkeypatch, tmp_path, theirs):
    monkeypatch.setattr("texgs.fitting.now.fit_now", None)
    (tmp_path / theirs).write_text("mine")
    with pytest.raises(ArgumentError, match=r"folder: expected one without another ball.nrrd or ball.json"):
        texgs.fit(ball, TFS, "now", size=32, folder=tmp_path)
    assert (tmp_path / theirs).read_text() == "mine"
    assert [file.name for file in tmp_path.iterdir()] == [theirs]


def test_a_recipe_that_was_edited_meanwhile_is_read_again(ball, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (recipe := tmp_path / "conf" / "fit" / "mine.yaml").parent.mkdir(parents=True)
    for iterations in (25, 75):
        recipe.write_text(f"defaults: [quick]\nname: mine\nshading: {{iterations: {iterations}}}\n")
        config = configuration(ball, TFS, ("fit=mine",), tmp_path)
        assert config.fit.shading.iterations == iterations


@pytest.mark.parametrize("recipe", ["now", "quick"])
def test_a_scene_of_a_turned_volume_knows_where_its_file_lies(tmp_path, monkeypatch, recipe):
    """Also where the workflow reads the prepared volume again, which is upright already."""
    shorten(monkeypatch, frequency=1, surfels=300, iterations=20)
    z, y, x = np.indices((12, 14, 20))
    values = np.exp(-(((x - 8) / 6) ** 2 + ((y - 6) / 3) ** 2 + ((z - 7) / 2) ** 2)).astype(np.float32)
    volume = texgs.Volume(values, spacing=(1, 2, 3), origin=(7, 8, 9), up="+z", name="scan")
    tf = texgs.TransferFunction([[0.2, 0.0], [0.3, 0.8], [1.0, 0.8]], [[0.3, 0.2, 0.4, 0.9]])
    overrides = () if recipe == "now" else SMALL
    made = texgs.fit(volume, {"a": tf}, recipe, size=64, folder=tmp_path, overrides=overrides)
    assert made.session.scene.space.matrix == volume.grid.world.matrix
    places = made.to_pyvista().points
    assert np.abs(np.median(places, axis=0) - [7 + 8, 8 + 6 * 2, 9 + 7 * 3]).max() < 2.5
