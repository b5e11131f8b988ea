"""What leaves a scene lies where its volume's file lay: by SimpleITK, PyVista and plain formulas."""

import json
from dataclasses import replace

import numpy as np
import pytest
import pyvista
import torch
from pxr import Usd

from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.surfels.test_composition import ball
from tests.refusals import refused
from tests.scene.balls import shell
from tests.scene.cloud_files import READERS, glb
from tests.volume.test_space import ORIENTED, TO_RAS, WRITERS, center_by_itk
from texgs.cli.main import main
from texgs.core.camera import orbit
from texgs.core.geometry import quats_to_matrices
from texgs.core.lens import Frame
from texgs.fields.gaussians import write_gaussians
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.raster.reference.shading import harmonics
from texgs.scene.changes import apply_all
from texgs.scene.clouds import Cloud, place_cloud
from texgs.scene.film import Film
from texgs.scene.scene import Scene, SceneModel, SceneVolume
from texgs.scene.scene_file import read_scene, title_of, write_scene
from texgs.scene.session import Session
from texgs.scene.shot import Shot
from texgs.viewer.description import describe, drawn
from texgs.volume.nrrd_file import open_grid
from texgs.volume.prepare import prepare
from texgs.volume.sources import open_source
from texgs.volume.space import Space

RADIUS = 0.1  # of a sphere around the blob, world units
COARSE = ("--kind", "mesh", "--views", "42", "--size", "160", "--voxel", "0.012")


def sphere(middle, count=700):
    """Opaque surfels side by side on a sphere; their normals point out of it."""
    normals = torch.randn(count, 3, generator=torch.Generator().manual_seed(1))
    normals, made = torch.nn.functional.normalize(normals, dim=1), ball(1, count)
    return Surfels({**made.parameters, **shell(normals, RADIUS, 0.012, 6.0, middle)}, made.shading)


def head_up(folder):
    """A scene of a sphere in a scan: x of the world points to the left of the patient, z to the front."""
    matrix = [[100.0, 0, 0, 0], [0, 0, -100, 0], [0, 100, 0, 20], [0, 0, 0, 1]]
    model = SceneModel(write_model(folder / "m.safetensors", sphere([0, 0, 0])))
    return Scene({"A": model}, space=Space("left-posterior-superior", "mm", matrix))


@pytest.fixture(params=[("v.nii.gz", "oblique"), ("v.mha", "oblique and mirrored"), ("left.nrrd", "oblique")])
def placed_scene(request, tmp_path):
    """A scene with a sphere around the blob of a volume of any axes, and the blob's place in the file."""
    name, oriented = request.param
    WRITERS[name][0](tmp_path / name, ORIENTED[oriented])
    prepare(open_source(tmp_path / name), tmp_path / "volume.nrrd", up="+z", reduce=2)
    grid = open_grid(tmp_path / "volume.nrrd")
    weights = np.asarray(grid.values, float)
    middle = [
        (weights.sum(axis=axes) @ np.arange(n)) / weights.sum()
        for n, axes in zip(grid.dims, ((0, 1), (0, 2), (1, 2)), strict=False)
    ]
    world = (np.array(middle) - (np.array(grid.dims) - 1) / 2) * grid.spacing * grid.scale
    model = write_model(tmp_path / "model.safetensors", sphere(world))
    scene = write_scene(tmp_path / "scene.yaml", Scene({"A": SceneModel(model)}, space=grid.world))
    expected = center_by_itk(tmp_path / "volume.nrrd")
    return scene, world, (TO_RAS @ expected if name == "v.nii.gz" else expected), grid


def about(mesh):
    """Middle, radius and volume of a mesh around a place; the volume is below 0 where it is inside out."""
    corners = np.asarray(mesh.points, float)[mesh.regular_faces]
    middle = corners.reshape(-1, 3).mean(axis=0)
    radii = np.linalg.norm(corners.reshape(-1, 3) - middle, axis=1)
    rays = [corners[:, k] - middle for k in range(3)]
    return middle, radii.mean(), (rays[0] * np.cross(rays[1], rays[2])).sum() / 6


def test_meshes_and_polygons_lie_around_what_the_file_shows(placed_scene, tmp_path):
    scene, world, expected, grid = placed_scene
    radius = RADIUS / grid.scale
    assert main(["export", str(scene), "--to", str(tmp_path / "mesh.ply"), *COARSE]) == 0
    middle, own, volume = about(pyvista.read(tmp_path / "mesh.ply"))
    np.testing.assert_allclose(middle, expected, atol=0.04 * radius)
    assert own == pytest.approx(radius, rel=0.1)  # discs stick out
    assert volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.3)  # and right side out
    header = (tmp_path / "mesh.ply").read_bytes().partition(b"end_header")[0].decode()
    assert f'comment space: "{grid.space.name}"' in header
    assert 'comment places: "space"' in header
    assert main(["export", str(scene), "--to", str(tmp_path / "w.ply"), *COARSE, "--space", "world"]) == 0
    middle, own, volume = about(pyvista.read(tmp_path / "w.ply"))
    np.testing.assert_allclose(middle, world, atol=0.04 * RADIUS)
    assert volume > 0

    assert main(["export", str(scene), "--to", str(tmp_path / "a.vtp")]) == 0
    mesh = pyvista.read(tmp_path / "a.vtp")
    np.testing.assert_allclose(mesh.cell_centers().points.mean(0), expected, atol=0.1 * radius)
    outwards = mesh.cell_centers().points - expected
    assert ((mesh.cell_data["Normals"] * outwards).sum(1) > 0.9 * radius).all()
    seen = mesh.compute_normals(cell_normals=True, point_normals=False, consistent_normals=False)
    assert ((seen.cell_data["Normals"] * outwards).sum(1) > 0.9 * radius).all()
    assert list(mesh.field_data["space"]) == [grid.space.name]
    matrix = np.reshape(mesh.field_data["world_to_space"], (4, 4))
    np.testing.assert_allclose(matrix @ [*world, 1], [*expected, 1], atol=1e-3)

    assert main(["export", str(scene), "--to", str(tmp_path / "p.ply"), "--kind", "points"]) == 0
    places = pyvista.read(tmp_path / "p.ply").points
    np.testing.assert_allclose(np.linalg.norm(places - expected, axis=1), radius, rtol=1e-3)


@pytest.mark.parametrize("ending", READERS)
def test_clouds_lie_there_or_say_the_way(placed_scene, tmp_path, ending):
    scene, world, expected, grid = placed_scene
    radius = RADIUS / grid.scale
    for words, middle, own in (
        (["--space", "file"], expected, radius),
        (["--space", "world"], world, RADIUS),
        ([], expected, radius) if ending == ".glb" else ([], world, RADIUS),
    ):
        target = tmp_path / f"as{''.join(words)}{ending}"  # USD opens a file once
        assert main(["export", str(scene), "--to", str(target), *words]) == 0
        (cloud,) = READERS[ending](target)
        np.testing.assert_allclose(np.linalg.norm(cloud.means - middle, axis=1), own, rtol=2e-3)
        normals = quats_to_matrices(torch.from_numpy(np.ascontiguousarray(cloud.quats)).float())[
            ..., 2
        ].numpy()
        along = ((cloud.means - middle) * normals).sum(1) / own  # of flat ones, which have no front
        np.testing.assert_allclose(np.abs(along), 1, atol=0.01)
        if ending == ".glb":
            said = glb(target)[0]["asset"]["extras"]
        elif ending == ".spz":  # has no place for it
            continue
        else:
            stage = Usd.Stage.Open(str(target))
            said = dict(stage.GetRootLayer().customLayerData)
            metres = 0.001 if words == ["--space", "file"] and grid.space.unit else 1.0
            assert stage.GetMetadata("metersPerUnit") == metres
        assert said["places"] == ("space" if middle is expected else "world")
        np.testing.assert_allclose(
            np.reshape(said["world_to_space"], (4, 4)) @ [*world, 1], [*expected, 1], atol=1e-3
        )


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("count", [1, 4, 9, 16])
def test_a_gaussian_is_turned_with_its_colours(sign, count):
    random = np.random.default_rng(0)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn *= sign * np.linalg.det(turn)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = 200 * turn, [10.0, -20.0, 300.0]
    space = Space("left-posterior-superior", "mm", matrix.tolist())
    quats = random.normal(size=(5, 4))
    values = (
        random.normal(size=(5, 3)),
        quats / np.linalg.norm(quats, axis=1, keepdims=True),
        random.uniform(0.01, 0.1, (5, 3)),
    )
    cloud = Cloud(
        "a",
        False,
        True,
        *(x.astype(np.float32) for x in values),
        np.ones(5, np.float32),
        random.normal(size=(5, count, 3)).astype(np.float32),
    )
    moved = place_cloud(cloud, space)

    def covariances(each):
        turns = quats_to_matrices(torch.from_numpy(each.quats)).double().numpy()
        return np.einsum("nij,nj,nkj->nik", turns, each.scales.astype(float) ** 2, turns)

    np.testing.assert_allclose(moved.means, 200 * cloud.means @ turn.T + matrix[:3, 3], rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(
        covariances(moved), 200**2 * turn @ covariances(cloud) @ turn.T, rtol=1e-4, atol=1e-3
    )
    ways = torch.nn.functional.normalize(torch.from_numpy(random.normal(size=(30, 3))), dim=1)

    def seen(each, ways):
        return np.einsum("mk,nkc->nmc", harmonics(ways)[:, :count].numpy(), each.sh)

    np.testing.assert_allclose(seen(moved, ways @ torch.from_numpy(turn.T)), seen(cloud, ways), atol=1e-5)
    sheared = Space("3D-right-handed", "", [[1.0, 0.3, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    refused(
        lambda: place_cloud(cloud, sheared), "expected axes at right angles, got oblique ones; export to the"
    )


def test_what_knows_no_space_stays_in_the_world_and_says_so(placed_scene, tmp_path, capsys):
    file, world, _, _ = placed_scene
    scene = read_scene(file)
    old = write_scene(tmp_path / "old.yaml", replace(scene, space=None))
    assert "space" not in old.read_text()
    target = tmp_path / "p.ply"
    assert main(["export", str(old), "--to", str(target), "--kind", "points"]) == 0
    assert f"{target}: in world units" in capsys.readouterr().err
    places = pyvista.read(target).points
    np.testing.assert_allclose(np.linalg.norm(places - world, axis=1), RADIUS, rtol=1e-4)
    assert main(["export", str(old), "--to", str(target), "--kind", "points", "--space", "file"]) == 2
    assert "space: expected a scene that knows the space" in capsys.readouterr().err
    assert main(["export", str(file), "--to", str(target), "--space", "file"]) == 2
    assert "space: expected kind points or mesh" in capsys.readouterr().err
    model = scene.models["A"].file
    assert main(["export", str(model), "--to", str(target), "--kind", "points", "--space", "file"]) == 2
    assert main(["export", str(file), "--model", "A", "--to", str(target), "--kind", "points"]) == 0
    assert np.abs(pyvista.read(target).points - world).max() > 1
    assert main(["export", str(file), "--to", str(target), "--kind", "2dgs"]) == 0
    assert b'comment places: "world"\n' in target.read_bytes()


def test_gaussians_say_the_way_too(placed_scene, tmp_path):
    file, *_ = placed_scene
    models = {"A": SceneModel(write_gaussians(tmp_path / "g.safetensors", gaussians(5)))}
    scene = write_scene(tmp_path / "g.yaml", replace(read_scene(file), models=models))
    assert main(["export", str(scene), "--to", str(tmp_path / "g.ply")]) == 0
    lines = (tmp_path / "g.ply").read_bytes().partition(b"end_header")[0].decode().splitlines()
    (matrix,) = (json.loads(line.partition(": ")[2]) for line in lines if "world_to_space" in line)
    assert np.reshape(matrix, (4, 4)).tolist() == read_scene(file).space.matrix


def test_a_scene_keeps_its_space(placed_scene):
    file, _, _, grid = placed_scene
    assert read_scene(file).space == grid.world
    session = Session.open(file)
    apply_all(session, ["light=30,20"])
    assert session.scene.space == grid.world
    write_scene(file, session.scene)
    assert read_scene(file).space == grid.world
    for old, new, message in (
        ("unit:", "length:", "space.length: no such key"),
        ("- [0.0, 0.0, 0.0, 1.0]", "- [0.0, 0.0, 1.0]", "space: matrix: expected 4 rows of 4 numbers"),
    ):
        text = file.read_text()
        broken = file.with_name("broken.yaml")
        broken.write_text(text.replace(old, new))
        assert broken.read_text() != text
        refused(lambda broken=broken: read_scene(broken), message)


def cut_by(file, word):
    session = Session.open(file)
    apply_all(session, [word])
    return session.scene.cuts.planes[0]


def test_cuts_by_the_axes_of_the_file(placed_scene):
    """A plane through the middle of the sphere, by its place in the file, goes through it in the world."""
    file, world, expected, grid = placed_scene
    is_ras, is_lps = (grid.space.name.startswith(word) for word in ("right", "left-p"))
    letters = "RAS" if is_ras else "LPS" if is_lps else "XYZ"
    turn = np.array(grid.space.axes).T  # of the world into the space
    for along, letter in enumerate(letters):
        for sign in ("", "-"):
            plane = cut_by(file, f"cut={sign}{letter},{expected[along]}{grid.space.unit}")
            towards = np.eye(3)[along] * (-1 if sign else 1)
            np.testing.assert_allclose(turn @ plane.normal, towards, atol=1e-6)
            assert np.dot(plane.normal, world) == pytest.approx(plane.offset, abs=1e-5)
    if is_ras or is_lps:
        opposite = {"R": "L", "A": "P", "L": "R", "P": "A"}[letters[0]]
        plane = cut_by(file, f"cut={opposite},{-expected[0]}")
        np.testing.assert_allclose(turn @ plane.normal, [-1, 0, 0], atol=1e-6)
        assert np.dot(plane.normal, world) == pytest.approx(plane.offset, abs=1e-5)


def test_cuts_by_samples_towards_a_letter(placed_scene, tmp_path):
    file, world, _, grid = placed_scene
    scene = replace(read_scene(file), volume=SceneVolume(tmp_path / "volume.nrrd", {}))
    write_scene(file, scene)
    ahead = drawn(scene.space)["ends"]
    names = {"x": "X", "y": "Y", "z": "Z"}
    for axis, (letter, behind) in enumerate(ahead):
        number = round((grid.dims[axis] - 1) * (world[axis] / (2 * grid.aabb[1][axis]) + 0.5))
        word = names.get(letter or behind, letter or behind)
        count = number if letter else grid.dims[axis] - 1 - number
        plane = cut_by(file, f"cut={word},{count}v")
        sign = 1.0 if letter else -1.0
        assert plane.normal == [sign * (axis == each) for each in range(3)]
        low, high = grid.aabb[0][axis], grid.aabb[1][axis]
        place = low + (high - low) * number / (grid.dims[axis] - 1)
        assert plane.offset == pytest.approx(sign * place)
        if letter and behind:
            other = cut_by(file, f"cut={behind},{grid.dims[axis] - 1 - number}v")
            assert (other.normal, other.offset) == ([-x for x in plane.normal], pytest.approx(-place))


@pytest.mark.parametrize(
    ("word", "message"),
    [
        *((f"cut=S,{place}", f"S,POSITION in mm .*, got {place}") for place in ("3cm", "nan")),
        ("cut=I,300mm", r"from -0.1\d* to 0.1\d* along -?0,-1,-?0, got 3.2"),
    ],
)
def test_mistakes_in_cuts_are_named(tmp_path, word, message):
    scene = head_up(tmp_path)
    file = write_scene(tmp_path / "scene.yaml", scene)
    refused(lambda: cut_by(file, word), message)
    assert cut_by(file, "cut=-I,-20mm").normal == pytest.approx([0, 1, 0])
    for other, known in (
        (None, "the space of its volume's file, got S"),
        (replace(scene.space, name="3D-right-handed"), "an axis of 3D-right-handed, got S"),
    ):
        write_scene(file, replace(read_scene(file), space=other))
        refused(lambda: cut_by(file, "cut=S,0"), known)


def test_a_page_knows_the_letters_of_the_axes(tmp_path):
    scene = head_up(tmp_path)
    said = describe("scan", scene, scene.open())["space"]
    assert said["ends"] == [["L", "R"], ["S", "I"], ["A", "P"]]
    assert (said["axes"], said["unit"], said["matrix"]) == ("LPS", "mm", scene.space.matrix)
    assert said["scale"] == pytest.approx(100)
    scene = replace(scene, space=replace(scene.space, name="scanner-xyz"))
    assert describe("scan", scene, scene.open())["space"]["ends"] == [["x", ""], ["z", ""], ["", "y"]]
    assert describe("scan", replace(scene, space=None), scene.open())["space"] is None


def test_a_patient_is_seen_first_from_the_front_by_all(tmp_path):
    """RAS and LPS, turned about the world's upright axis: the camera sees the front, and a side obliquely."""
    for quarter in range(4):
        turn = np.linalg.matrix_power(np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]), quarter)  # about +y
        for name, to_world in (
            ("left-posterior-superior", [[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
            ("right-anterior-superior", [[-1, 0, 0], [0, 0, 1], [0, 1, 0]]),
        ):
            matrix = np.eye(4)
            matrix[:3, :3] = 100 * np.array(to_world) @ turn
            space = Space(name, "mm", matrix.tolist())
            front = space.in_world(np.array([[0, 100.0 if name[0] == "r" else -100.0, 0]]))[0]
            towards = orbit(space.front, 0, 1.0, 30, 8, 8).position.double().numpy()
            assert towards @ front == pytest.approx(np.cos(np.radians(30)), abs=1e-5)
    assert Space().front is None
    scene = replace(head_up(tmp_path), frame=Frame([0.0] * 3, 0.1, azimuth=head_up(tmp_path).space.front))
    write_scene(tmp_path / "scene.yaml", scene)
    (home,) = describe("name", read_scene(tmp_path / "scene.yaml"), scene.open())["views"]
    camera = orbit(home["azimuth"], home["polar"], *scene.framed().lens())
    assert torch.equal(Shot().camera(scene.framed()).viewmat, camera.viewmat)
    ((shown, _),) = Film().shots(scene)
    assert torch.equal(shown.viewmat, camera.viewmat)
    assert home["azimuth"] == pytest.approx(-60), "+z of the world is the front"


@pytest.mark.parametrize(
    ("path", "title"),
    [
        ("lung/scene/quick/compose/scene.yaml", "lung quick"),
        ("lung/scene/quick/edits/gold/scene.yaml", "lung quick gold"),
        ("lung/TF01/quick/texture/model.safetensors", "lung TF01 quick"),
    ],
)
def test_the_title_of_a_scene_is_its_name_and_not_its_path(tmp_path, path, title):
    file = tmp_path / path
    file.parent.mkdir(parents=True)
    (file.parent / "metrics.json").write_text("{}")
    assert title_of(file) == title
    assert title_of(tmp_path / "heart" / "scene.yaml") == "heart"
    assert title_of(tmp_path / "heart" / "edited.yaml") == "edited"
