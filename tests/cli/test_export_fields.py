"""Exports of fields that are no surfels, and scenes of what other programs have fitted."""

import numpy as np
import pytest
import torch
from plyfile import PlyData

from tests.fields.gaussians.samples import sample
from tests.fields.surfels.samples import sample as surfels
from texgs.cli.main import main
from texgs.core.errors import ArgumentError
from texgs.fields.files import open_field
from texgs.fields.gaussians.model import Gaussians
from texgs.fields.gaussians.model_file import write_gaussians
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.ply import write_ply
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene, write_scene


def export(source, target, *words):
    return main(["export", str(source), "--to", str(target), *words])


def ball(n=600):
    """Opaque Gaussians side by side on a sphere."""
    random = torch.Generator().manual_seed(1)
    normals = torch.nn.functional.normalize(torch.randn(n, 3, generator=random), dim=1)
    parameters = {
        "means": 0.4 * normals,
        "quats": torch.tensor([1.0, 0, 0, 0]).repeat(n, 1),
        "scales": torch.full((n, 3), np.log(0.03)),
        "opacities": torch.full((n,), 4.0),
        "sh": torch.rand(n, 1, 3, generator=random),
    }
    return Gaussians(parameters)


def test_gaussians_go_to_other_programs_and_come_back_as_a_scene(tmp_path):
    source = write_gaussians(tmp_path / "model.safetensors", sample(50))
    assert export(source, tmp_path / "model.ply") == 0
    header = (tmp_path / "model.ply").read_bytes().partition(b"end_header\n")[0]
    assert (tmp_path / "model.ply").stat().st_size == len(header) + len(b"end_header\n") + 248 * 50
    back = open_field(tmp_path / "model.ply")
    assert isinstance(back, Gaussians)
    for name, value in sample(50).parameters.items():
        assert torch.equal(back.parameters[name], value), name
    scene = write_scene(tmp_path / "scene.yaml", Scene({"TF01": SceneModel(tmp_path / "model.ply")}))
    assert main(["render", str(scene), "--width", "32", "--output", str(tmp_path / "a.png")]) == 0
    assert len(read_scene(scene).open()) == 50


def test_a_scene_of_gaussians_is_exported_as_edited(tmp_path):
    files = [write_gaussians(tmp_path / f"{n}.safetensors", sample(n, seed=n)) for n in (30, 40, 50)]
    edits = PartEdit(), PartEdit(opacity=0.5), PartEdit(visible=False)
    models = {f"TF{i}": SceneModel(*each) for i, each in enumerate(zip(files, edits, strict=True))}
    scene = write_scene(tmp_path / "scene.yaml", Scene(models))
    assert export(scene, tmp_path / "all.ply") == 0
    opacities = open_field(tmp_path / "all.ply").parameters["opacities"]
    assert len(opacities) == 70
    assert torch.equal(opacities[:30], sample(30, seed=30).parameters["opacities"]), "kept as they were"
    own = sample(40, seed=40).parameters["opacities"].sigmoid()
    torch.testing.assert_close(opacities[30:].sigmoid(), 0.5 * own)
    assert export(scene, tmp_path / "one.ply", "--model", "TF2") == 0
    assert len(open_field(tmp_path / "one.ply")) == 50


def test_a_mesh_of_gaussians(tmp_path):
    source = write_gaussians(tmp_path / "ball.safetensors", ball())
    words = ["--kind", "mesh", "--views", "12", "--size", "128", "--voxel", "0.02"]
    scene = write_scene(tmp_path / "scene.yaml", Scene({"A": SceneModel(source)}))
    for each in (source, scene):
        assert export(each, tmp_path / "mesh.ply", *words) == 0
        vertices = PlyData.read(tmp_path / "mesh.ply")["vertex"]
        radii = np.linalg.norm([vertices[axis] for axis in "xyz"], axis=0)
        assert 0.36 < np.median(radii) < 0.46


@pytest.mark.parametrize("flavour", ["2dgs", "release"])
def test_surfels_of_other_programs_open_as_surfels(tmp_path, flavour):
    model = surfels("shading", material="paper") if flavour == "release" else surfels("surfels")
    assert isinstance(open_field(write_ply(tmp_path / "model.ply", model, flavour)), Surfels)


def test_a_cloud_of_points_is_no_field(tmp_path):
    source = write_gaussians(tmp_path / "ball.safetensors", ball())
    words = ["--kind", "mesh", "--views", "12", "--size", "128", "--voxel", "0.02"]
    assert export(source, tmp_path / "mesh.ply", *words) == 0
    with pytest.raises(ArgumentError, match=r"mesh.ply: expected"):
        open_field(tmp_path / "mesh.ply")


@pytest.mark.parametrize("kind", ["2dgs", "release", "points"])
def test_what_gaussians_cannot_become_is_one_sentence(tmp_path, capsys, kind):
    source = write_gaussians(tmp_path / "model.safetensors", sample(5))
    assert export(source, tmp_path / "x.ply", "--kind", kind) == 2
    said = capsys.readouterr().err
    assert f"--kind {kind}: expected surfels, got gaussians, which can be exported as 3dgs or mesh" in said
    assert not (tmp_path / "x.ply").exists()
