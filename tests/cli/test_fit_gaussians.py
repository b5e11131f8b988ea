"""3D Gaussians from the command line to a scene, on views of a small sphere."""

import json

import pytest

from tests.cli.conftest import GAUSSIANS, SPHERE, copied
from texgs.cli.main import main
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.fields.files import open_field
from texgs.fields.gaussians.model import JoinedGaussians
from texgs.fields.part_edit import PartEdit
from texgs.scene.scene_file import read_scene


def test_a_fit_has_a_model_and_numbers_and_leaves_no_checkpoint(gaussians):
    folder = gaussians / "sphere" / "TF01" / "gaussians_quick" / "gaussians"
    numbers = json.loads((folder / "metrics.json").read_text())["numbers"]
    assert numbers["psnr"] > 25
    assert numbers["sizes"]["total_mib"] * 2**20 == pytest.approx(400 * 248)
    field = open_field(folder / "model.safetensors")
    assert (field.kind, len(field)) == ("gaussians", 400)
    assert field.parameters["sh"][:, 9:].abs().max() > 0, "degree 3 has learned"
    assert sorted(path.name for path in folder.iterdir() if path.name[0] != ".") == [
        "metrics.json",
        "model.safetensors",
    ]


def test_a_scene_opens_and_fades(gaussians, tmp_path):
    path = gaussians / "sphere" / "scene" / "gaussians_quick" / "compose" / "scene.yaml"
    whole = read_scene(path)
    composed = whole.open()
    assert isinstance(composed, JoinedGaussians)
    assert main(["edit", str(path), "TF01.opacity=0.2", "--output", str(tmp_path / "faint.yaml")]) == 0
    faint = read_scene(tmp_path / "faint.yaml")
    camera = orbit(30, 20, 2.5, 50, 48, 48)
    before, after = (composed.render(camera, edits=scene.edits).alpha.sum() for scene in (whole, faint))
    assert float(after) < 0.8 * float(before)
    palette = ["TF01.palette=#ff0000", "--output", str(tmp_path / "red.yaml")]
    assert main(["edit", str(path), *palette]) == 2
    with pytest.raises(
        ArgumentError, match="palette: expected a model that can change it, got one of gaussians"
    ):
        composed.render(camera, edits=[PartEdit(palette=(1, 0, 0))])


def test_two_recipes_side_by_side_are_fitted_first(gaussians, tmp_path, monkeypatch):
    monkeypatch.chdir(copied(gaussians, tmp_path))
    few = ["fits=[gaussians_quick,demo]", "fit.shading.iterations=10"]
    assert main(["comparison", *SPHERE, *GAUSSIANS, *few]) == 0
    folder = tmp_path / "results" / "sphere" / "TF01"
    compared = folder / "comparison" / "looks"
    numbers = json.loads((compared / "metrics.json").read_text())["numbers"]
    assert numbers == {
        "recipes": ["gaussians_quick", "demo"],
        "shown": ["test view 0", "test view 1"],
    }
    assert (compared / "comparison.png").stat().st_size > 1000
    assert (folder / "demo" / "texture" / "model.safetensors").exists()
