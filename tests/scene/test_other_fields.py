"""Scenes of fields that are no surfels: what goes, and what is refused in one sentence."""

from functools import partial

import numpy as np
import pytest

from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.surfels.test_composition import CAMERA
from tests.fields.surfels.test_composition import ball as surfels
from tests.fields.voxels.test_voxels import ball as voxels
from tests.refusals import refused
from tests.scene.test_twin import LOW, sphere_volume
from texgs.cli.main import main
from texgs.core.light import Light
from texgs.fields.gaussians import write_gaussians
from texgs.fields.surfels.model_file import write_model
from texgs.fields.voxels import VoxelScene, write_voxels
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.session import Session


@pytest.fixture
def grid(tmp_path):
    """The file of a voxel grid."""
    return write_voxels(tmp_path / "grid.safetensors", voxels())


def test_a_scene_of_voxels_is_rendered_and_made_thinner(grid, tmp_path):
    session = Session(Scene({"TF01": SceneModel(grid)}))
    assert isinstance(session.composition, VoxelScene)
    before = session.frame(CAMERA)
    assert before.min() < 200
    session.set("TF01", "opacity", 0.02)
    assert session.frame(CAMERA).astype(int).sum() > before.astype(int).sum()
    session.set("TF01", "visible", False)
    assert np.array_equal(session.frame(CAMERA), np.full_like(before, 255))
    scene = session.save(tmp_path / "scene.yaml")
    words = ["--width", "32", "--mode", "depth", "--output", str(tmp_path / "a.png")]
    assert main(["render", str(scene), *words]) == 0


def test_fields_of_two_kinds_make_no_scene(grid, tmp_path):
    other = write_model(tmp_path / "surfels.safetensors", surfels(1))
    refused(Scene({"a": SceneModel(grid), "b": SceneModel(other)}).open, "models: .*surfels and voxels")


@pytest.mark.parametrize("kind", ["gaussians", "voxels"])
def test_a_scene_file_whose_models_cannot_have_shadows_is_told_in_a_sentence(grid, tmp_path, capsys, kind):
    file = write_gaussians(tmp_path / "a.safetensors", gaussians(9)) if kind == "gaussians" else grid
    volume = sphere_volume(tmp_path, TF01=LOW)
    for light, code in ((Light("headlight", shadows=1.0), 0), (Light("headlight", occlusion=0.5), 2)):
        scene = write_scene(tmp_path / "scene.yaml", Scene({"TF01": SceneModel(file)}, light, volume=volume))
        assert main(["render", str(scene), "--width", "32", "--output", str(tmp_path / "a.png")]) == code
    assert f"expected surfels for shadows and occlusion, got {kind}, which have" in capsys.readouterr().err
    words = ["occlusion=0", "shadows=0", "--output", str(tmp_path / "b.yaml")]
    assert main(["edit", str(scene), *words]) == 0, "as the sentence says"
    assert read_scene(tmp_path / "b.yaml").light == Light("headlight")


def test_what_only_surfels_can(grid):
    session = Session(Scene({"TF01": SceneModel(grid)}))
    for change in (partial(session.set_file, "TF01", "texture"), partial(session.add_segment, "TF01/part")):
        refused(lambda change=change: change(grid), r"models\.TF01: .*expected surfels, got voxels")
    assert not session.undo()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["render", "--mode", "unshaded", "--output", "a.png"], "look: expected shaded"),
        (["export", "--to", "a.ply"], "got voxels, which can be exported as mesh"),
        (["edit", "TF01.palette=#ff0000", "--output", "b.yaml"], "palette: expected a model that can change"),
        (["edit", "TF01.diffuse=2", "--output", "b.yaml"], "diffuse: expected a model that can change"),
    ],
)
def test_the_command_line_says_so(grid, tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    write_scene("scene.yaml", Scene({"TF01": SceneModel(grid)}))
    verb, *rest = words
    assert main([verb, "scene.yaml", *rest]) == 2
    assert message in capsys.readouterr().err
