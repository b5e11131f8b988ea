"""Exports from the command line: of surfels, of Gaussians, and of what other programs have fitted."""

import re
from dataclasses import replace

import numpy as np
import pytest
import pyvista
import torch
from plyfile import PlyData

import texgs
from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.surfels.ply_files import vertices
from tests.fields.surfels.samples import sample
from tests.fields.surfels.test_composition import ball
from tests.fields.voxels.test_voxels import ball as voxels
from tests.refusals import refused
from tests.scene.cloud_files import READERS
from texgs.cli.main import main
from texgs.core.cuts import Cuts, Plane
from texgs.fields.files import open_field
from texgs.fields.gaussians import Gaussians, write_gaussians
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.compact import read_compact
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.ply import read_ply, write_ply
from texgs.fields.surfels.texels import bare_colors
from texgs.fields.surfels.variants import write_texture
from texgs.fields.voxels import write_voxels
from texgs.scene.export_keys import ENDINGS
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import read_scene, write_scene

MESH = ("--views", "12", "--size", "128", "--voxel", "0.02", "--kind", "mesh")


@pytest.fixture
def model(tmp_path):
    return write_model(tmp_path / "a.safetensors", ball(1))


@pytest.fixture
def scene(tmp_path, model):
    """scene.yaml with two models, one of which is red."""
    other = write_model(tmp_path / "b.safetensors", ball(2, n=80))
    edit = PartEdit(palette=(1, 0, 0), opacity=0.5)
    return write_scene(tmp_path / "scene.yaml", Scene({"A": SceneModel(model), "B": SceneModel(other, edit)}))


def export(source, target, *words):
    return main(["export", str(source), "--to", str(target), *words])


@pytest.mark.parametrize("kind", ["3dgs", "2dgs"])
def test_gaussians_of_a_scene_are_those_of_its_models(scene, tmp_path, kind, capsys):
    """The option has the name that it has in other verbs, too."""
    assert main(["export", str(scene), "--output", str(tmp_path / "out.ply"), "--kind", kind]) == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "out.ply")
    parameters = read_ply(tmp_path / "out.ply").parameters
    assert len(parameters["means"]) == 230
    assert ("scale_2" in vertices(tmp_path / "out.ply").dtype.names) == (kind == "3dgs")
    own = ball(2, n=80).parameters["opacities"].sigmoid()
    torch.testing.assert_close(parameters["opacities"][150:].sigmoid(), 0.5 * own)


def test_the_ending_chooses(model, tmp_path):
    assert export(model, tmp_path / "m.ply") == 0
    assert "scale_2" in vertices(tmp_path / "m.ply").dtype.names
    assert export(model, tmp_path / "m.texgs") == 0
    assert len(read_compact(tmp_path / "m.texgs")) == 150
    assert export(tmp_path / "m.texgs", tmp_path / "again.ply", "--kind", "release") == 0
    assert "ambient_factor" in vertices(tmp_path / "again.ply").dtype.names


def test_a_model_of_a_scene_has_its_texture_there(model, tmp_path):
    own = ball(1)
    p = own.parameters
    other = type(own)({**p, "texels": torch.full_like(p["texels"], 0.25)}, own.shading)
    texture = write_texture(tmp_path / "style.safetensors", other)
    scene = write_scene(tmp_path / "styled.yaml", Scene({"A": SceneModel(model, texture=texture)}))
    target = tmp_path / "a.texgs"
    assert export(scene, target, "--model", "A") == 0
    torch.testing.assert_close(bare_colors(read_compact(target)), bare_colors(other), atol=0.02, rtol=0)
    assert (bare_colors(read_compact(target)) - bare_colors(own)).abs().max() > 0.1


def test_textures_of_surfels_that_nobody_sees_are_dropped(tmp_path):
    hidden = ball(3)
    p = dict(hidden.parameters)
    p["opacities"] = p["opacities"].clone()
    p["opacities"][:50] = -20.0
    source = write_model(tmp_path / "m.safetensors", type(hidden)(p, hidden.shading))
    assert export(source, tmp_path / "m.texgs", "--drop-unseen", "--views", "12", "--size", "64") == 0
    sizes = read_compact(tmp_path / "m.texgs").parameters["sizes"]
    assert bool((sizes[:50] == 1).all())
    assert not bool((sizes[50:] == 1).all())


def test_points_of_a_scene(scene, tmp_path, capsys):
    assert export(scene, tmp_path / "all.ply", "--kind", "points") == 0
    every = len(vertices(tmp_path / "all.ply"))
    assert every == sum(len(ball(*of).parameters["opacities"]) for of in ((1,), (2, 80)))
    assert "surfels" not in capsys.readouterr().err, "all are there"
    assert export(scene, tmp_path / "p.ply", "--kind", "points", "--opacity", "0.3") == 0
    points = vertices(tmp_path / "p.ply")
    counts = [
        int((scale * ball(*of).parameters["opacities"].sigmoid() >= 0.3).sum())
        for scale, of in ((1, (1,)), (0.5, (2, 80)))
    ]
    assert len(points) == sum(counts) < every
    assert (
        f"p.ply: {len(points):,} of {every:,} surfels, those with an opacity of 0.3"
        in capsys.readouterr().err
    )
    reds = points[counts[0] :]
    assert reds["red"].mean() > 240 > 3 * reds["blue"].mean()


@pytest.mark.parametrize("kind", ["scene", "model", "surfels"])
def test_a_mesh_of_surfels(scene, model, tmp_path, kind):
    surfels = write_model(tmp_path / "s.safetensors", sample("surfels", n=400))
    source = {"scene": scene, "model": model, "surfels": surfels}[kind]
    assert export(source, tmp_path / "mesh.ply", *MESH) == 0
    vertices, faces = (PlyData.read(tmp_path / "mesh.ply")[name] for name in ("vertex", "face"))
    assert len(faces) > 500
    assert vertices["red"].max() > 25


@pytest.mark.parametrize(("name", "words"), [("m.obj", []), ("m.glb", ["--model", "A"])])
def test_a_textured_mesh_tells_how_far_it_is_from_the_scene(scene, tmp_path, capsys, name, words):
    more = (*MESH[:-1], "textured", "--faces", "900", "--texture", "256", *words)
    assert export(scene, tmp_path / name, *more) == 0
    mesh = pyvista.read(tmp_path / name)
    mesh = mesh.combine() if isinstance(mesh, pyvista.MultiBlock) else mesh
    assert 0 < mesh.n_cells <= 900
    assert re.search(
        rf"{name}: {mesh.n_cells} triangles, (closed|not closed: [\d,]+ edges are open); "
        r"\d+\.\d dB from the scene in 12 views, and \d+\.\d % of the opacity is where it has no surface\n",
        capsys.readouterr().err,
    )


def test_a_mesh_of_gaussians_is_where_they_are(tmp_path):
    source = write_gaussians(tmp_path / "ball.safetensors", sphere_of_gaussians())
    assert export(source, tmp_path / "mesh.ply", *MESH) == 0
    vertices = PlyData.read(tmp_path / "mesh.ply")["vertex"]
    assert 0.36 < np.median(np.linalg.norm([vertices[axis] for axis in "xyz"], axis=0)) < 0.46
    refused(lambda: open_field(tmp_path / "mesh.ply"), "mesh.ply: expected")  # points are no field


@pytest.mark.parametrize("ending", READERS)
def test_clouds_of_a_scene_and_of_its_models(scene, model, tmp_path, ending, capsys):
    cut = read_scene(scene)
    write_scene(scene, replace(cut, cuts=Cuts(planes=[Plane([1.0, 0.0, 0.0])])))
    target = tmp_path / f"x{ending}"
    assert export(scene, target) == 0
    printed = capsys.readouterr()
    assert printed.out.strip() == str(target)
    assert "Surfels have one colour each, the mean of their texture, with the light" in printed.err
    assert "its cuts are left out" in printed.err
    clouds = READERS[ending](target)
    assert sum(len(cloud.means) for cloud in clouds) == 230
    whole = np.concatenate([cloud.opacities for cloud in clouds])
    own = ball(2, n=80).parameters["opacities"].sigmoid()
    assert np.abs(whole[150:] - 0.5 * own.numpy()).max() < 0.01
    assert export(scene, target, "--model", "B") == 0
    (alone,) = READERS[ending](target)
    assert np.array_equal(alone.opacities, whole[150:]), "with its edits"
    assert export(model, target) == 0
    (of_file,) = READERS[ending](target)
    assert "its cuts" not in capsys.readouterr().err.splitlines()[-1]
    assert np.array_equal(of_file.opacities, whole[:150])
    assert alone.name == of_file.name == "spz" or (alone.name, of_file.name) == ("B", "a")


@pytest.mark.parametrize("ending", READERS)
def test_clouds_of_what_others_have_fitted(tmp_path, ending):
    source = write_gaussians(tmp_path / "model.safetensors", gaussians(30))
    assert export(source, tmp_path / f"x{ending}") == 0
    (cloud,) = READERS[ending](tmp_path / f"x{ending}")
    assert np.abs(cloud.opacities - gaussians(30).parameters["opacities"].sigmoid().numpy()).max() < 0.01
    source = write_ply(tmp_path / "model.ply", sample("surfels"), "2dgs")
    assert export(source, tmp_path / f"x{ending}") == 0
    (cloud,) = READERS[ending](tmp_path / f"x{ending}")
    assert len(cloud.means) == 7


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--to", "x.stl"], f"expected a file that ends in {' or '.join(ENDINGS)}, got x.stl"),
        (["--to", "x.ply", "--kind", "usd"], "expected a file that ends in .usdc or .usda, got x.ply"),
        (["--to", "x.glb", "--model", "C"], "model: expected one of A, B, got C"),
        (["--to", "x.texgs"], "kind compact: expected one model, got a scene"),
        (["--to", "x.glb", "--voxel", "0.1"], "voxel: expected kind mesh or textured, got gltf"),
        (["--to", "x.glb", "--faces", "9"], "faces: expected kind textured, got gltf"),
        (["--to", "x.obj", "--texture", "1000"], "texture: expected a power of two, such as 2048, got 1000"),
        (["--to", "x.ply", "--steps", "one"], "steps: expected kind html, got 3dgs"),
        (["--to", "x.html", "--volume"], "volume: expected the volume that the scene was made from"),
        (["--to", "x.ply", "--kind", "mesh", "--size", "0"], "--size: expected at least 1, got 0"),
    ],
)
def test_a_mistake_writes_nothing(scene, tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    assert main(["export", str(scene), *words]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.glob("x.*"))


@pytest.mark.parametrize(
    ("write", "field", "ending", "able"),
    [
        (write_voxels, voxels, ".glb", "gltf: expected gaussians or surfels, got voxels"),
        (write_gaussians, gaussians, ".html", "html: expected surfels, got gaussians, which can be exported"),
    ],
)
def test_what_a_field_cannot_become_is_told(tmp_path, capsys, write, field, ending, able):
    source = write(tmp_path / "model.safetensors", field())
    assert export(source, tmp_path / f"x{ending}") == 2
    assert f"--kind {able}" in capsys.readouterr().err
    assert not (tmp_path / f"x{ending}").exists()


def test_what_a_scene_reads_is_not_replaced(model, tmp_path, capsys):
    ply = tmp_path / "model.ply"
    assert [export(model, ply) for _ in range(2)] == [0, 0], "its own file before"
    before, scene = ply.read_bytes(), write_scene(tmp_path / "of_ply.yaml", Scene({"A": SceneModel(ply)}))
    for source, words in ((ply, ()), (scene, ()), (scene, ("--model", "A"))):
        assert export(source, ply, *words) == 2
        assert "model.ply: expected a new file, got one that the scene reads" in capsys.readouterr().err
    refused(lambda: texgs.open(ply).export(ply), "got one that the scene reads")
    assert ply.read_bytes() == before


def sphere_of_gaussians(n=600):
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
    source = write_gaussians(tmp_path / "model.safetensors", gaussians(50))
    assert export(source, tmp_path / "model.ply") == 0
    header = (tmp_path / "model.ply").read_bytes().partition(b"end_header\n")[0]
    assert (tmp_path / "model.ply").stat().st_size == len(header) + len(b"end_header\n") + 248 * 50
    back = open_field(tmp_path / "model.ply")
    assert isinstance(back, Gaussians)
    for name, value in gaussians(50).parameters.items():
        assert torch.equal(back.parameters[name], value), name
    scene = write_scene(tmp_path / "scene.yaml", Scene({"TF01": SceneModel(tmp_path / "model.ply")}))
    assert main(["render", str(scene), "--width", "32", "--output", str(tmp_path / "a.png")]) == 0
    assert len(read_scene(scene).open()) == 50


def test_a_scene_of_gaussians_is_exported_as_edited(tmp_path):
    files = [write_gaussians(tmp_path / f"{n}.safetensors", gaussians(n, seed=n)) for n in (30, 40, 50)]
    edits = PartEdit(), PartEdit(opacity=0.5), PartEdit(visible=False)
    models = {f"TF{i}": SceneModel(*each) for i, each in enumerate(zip(files, edits, strict=True))}
    scene = write_scene(tmp_path / "scene.yaml", Scene(models))
    assert export(scene, tmp_path / "all.ply") == 0
    opacities = open_field(tmp_path / "all.ply").parameters["opacities"]
    assert len(opacities) == 70
    assert torch.equal(opacities[:30], gaussians(30, seed=30).parameters["opacities"]), "kept as they were"
    own = gaussians(40, seed=40).parameters["opacities"].sigmoid()
    torch.testing.assert_close(opacities[30:].sigmoid(), 0.5 * own)
    assert export(scene, tmp_path / "one.ply", "--model", "TF2") == 0
    assert len(open_field(tmp_path / "one.ply")) == 50
