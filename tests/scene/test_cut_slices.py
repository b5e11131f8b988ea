"""Slices on the faces of cuts, against samples that scipy interpolates where rays meet the planes."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image
from scipy.ndimage import map_coordinates

from tests.fields.surfels.test_composition import ball
from tests.refusals import refused
from tests.scene.labelled import BLUE, RED, labelled_scene
from texgs.cli.main import main
from texgs.core.camera import orbit
from texgs.core.cuts import Box, Cuts, Plane
from texgs.fields.surfels.variants import write_texture
from texgs.scene.changes import apply_all
from texgs.scene.cut_view import cut_view
from texgs.scene.film import Film
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.session import Session
from texgs.scene.twin import Twin
from texgs.volume.nrrd_file import open_grid
from texgs.volume.slices import window_of

CAMERA = orbit(-35, 25, 2.2, 30, 90, 70)
PLANES = [Plane([1.0, 0.3, 0.1], 0.05), Plane([0.0, 0.2, 1.0], 0.1)]
SLICES = Cuts(PLANES, faces="slice", window=(0.0, 200.0))


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return labelled_scene(tmp_path_factory.mktemp("scan"), cuts=SLICES)


def expected_faces(scene):
    """Colours [H, W, 3] in levels on the faces, and where faces are [H, W], by plain formulas."""
    grid = open_grid(scene.volume.file)
    eye = CAMERA.position.double().numpy()
    rays = (CAMERA.unproject(torch.ones(70, 90)) - CAMERA.position).double().numpy()
    entries = [
        np.where(rays @ n < 0, (p.offset - eye @ n) / (rays @ n), 0.0)
        for p in scene.cuts.half_spaces
        for n in [np.array(p.normal)]
    ]
    near = np.max(entries, axis=0)
    points = eye + near[..., None] * rays
    is_kept = np.all([points @ p.normal <= p.offset + 1e-5 for p in scene.cuts.half_spaces], axis=0)
    is_face = (near > 0) & is_kept & (np.abs(points) <= grid.aabb[1]).all(-1)
    places = points / grid.scale / grid.spacing + 0.5 * (np.array(grid.dims) - 1)

    def values(channel):
        samples = grid.channel(channel).values.astype(float)
        return map_coordinates(samples, places[..., ::-1].reshape(-1, 3).T, order=1, mode="nearest").reshape(
            70, 90
        )

    grey = 255 * np.clip(values(0) / 200, 0, 1)
    colors = np.repeat(grey[..., None], 3, axis=2)
    for channel, color in ((1, RED), (2, BLUE)):
        inside = values(channel) >= 127.5
        colors[inside] = 0.4 * colors[inside] + 0.6 * 255 * np.array(color)
    return colors, is_face


def test_faces_show_the_samples_that_rays_meet_and_hide_what_is_behind(scene):
    colors, is_face = expected_faces(scene)
    seen = Session(scene).frame(CAMERA).astype(float)
    assert 0.1 < is_face.mean() < 0.6
    off = np.abs(seen - colors).max(-1)
    assert (off[is_face] <= 1).mean() > 0.985, "labels end within rounding of a pixel"
    empty = replace(
        scene, models={k: replace(m, edit=replace(m.edit, opacity=0.0)) for k, m in scene.models.items()}
    )
    assert (np.abs(Session(empty).frame(CAMERA) - 255.0).max(-1) == 0)[~is_face].mean() > 0.97
    alpha = Session(scene).frame(CAMERA, transparent=True)[..., 3]
    assert (alpha[is_face] == 255).mean() > 0.985


def test_the_outermost_slices_are_whole(scene):
    """Places on them are beyond the volume by the rounding of single precision, or are not."""
    half = open_grid(scene.volume.file).aabb[1][1]
    camera, shares = orbit(0, 85, 3, 30, 90, 70), []
    for offset in (-half, -0.999 * half):
        cut = replace(scene, cuts=Cuts([Plane([0.0, 1.0, 0.0], offset)], faces="slice"))
        shares.append((Session(cut).frame(camera, transparent=True)[..., 3] == 255).mean())
    assert shares[0] == pytest.approx(shares[1], rel=0.02)
    assert shares[1] > 0.1


def test_away_from_faces_the_view_is_as_ever(scene):
    _, is_face = expected_faces(scene)
    unlit = replace(scene, cuts=replace(SLICES, faces="unlit"))
    same = (Session(scene).frame(CAMERA) == Session(unlit).frame(CAMERA)).all(-1)
    assert same[~is_face].mean() > 0.99
    assert same[is_face].mean() < 0.2


def test_a_look_has_the_same_faces_over_its_models(scene, tmp_path):
    colors, is_face = expected_faces(scene)
    texture = write_texture(tmp_path / "look.safetensors", ball(1))
    styled = replace(scene, models={**scene.models, "red": replace(scene.models["red"], texture=texture)})
    off = np.abs(Session(styled).frame(CAMERA) - colors).max(-1)
    assert (off[is_face] <= 1).mean() > 0.98


@pytest.mark.parametrize("mode", ["shaded", "volume"])
def test_a_click_on_a_face_is_on_its_plane_even_if_all_models_are_hidden(scene, mode):
    _, is_face = expected_faces(scene)
    rows, columns = np.nonzero(is_face)
    session = Session(scene)
    for name in scene.models:
        session.set(name, "visible", False)
    for row, column in list(zip(rows.tolist(), columns.tolist(), strict=True))[::97]:
        point = np.array(session.point_at(CAMERA, mode, session.scene, (column, row)))
        assert min(abs(point @ plane.normal - plane.offset) for plane in PLANES) < 1e-5


def test_the_window_is_that_of_the_volume_unless_it_is_told(scene):
    twin, composed = Twin(scene), scene.open()
    grid = open_grid(scene.volume.file)
    told = replace(scene, cuts=replace(SLICES, window=window_of(grid)))
    left = replace(scene, cuts=replace(SLICES, window=None))
    one, other = (cut_view(composed, CAMERA, each, twin).color for each in (told, left))
    assert torch.equal(one, other)
    assert not torch.equal(one, cut_view(composed, CAMERA, scene, twin).color)


def test_words_make_slices_and_take_them_back(scene, tmp_path):
    session = Session(replace(scene, cuts=Cuts()))
    apply_all(session, ["cut=x,0", "cut.faces=slice", "cut.window=-50,150"])
    cuts = session.scene.cuts
    assert (cuts.faces, cuts.window) == ("slice", (-50.0, 150.0))
    assert read_scene(write_scene(tmp_path / "a.yaml", session.scene)).cuts == cuts
    for words, told in (("1,2,3", "expected 2 values, got 3"), ("1,b", "expected a number, got 'b'")):
        refused(lambda words=words: apply_all(session, [f"cut.window={words}"]), f"cuts.window.*{told}")
    apply_all(session, ["cut.window=", "cut.faces="])
    assert session.scene.cuts == Cuts([Plane([1.0, 0.0, 0.0], 0.0)])


def test_a_film_of_a_moving_cut_shows_slices(scene, tmp_path):
    boxed = replace(scene, cuts=replace(SLICES, box=Box([-1.0, -1.0, -1.0], [1.0, 1.0, 0.3])))
    file = write_scene(tmp_path / "scene.yaml", boxed)
    words = ["--path", "cut", "--frames", "3", "--width", "48", "--azimuth", "-60"]
    assert main(["render", str(file), "--output", str(tmp_path / "film"), *words]) == 0
    shown = [np.asarray(Image.open(each)) for each in sorted((tmp_path / "film").iterdir())]
    greys = [int(((x.max(-1) == x.min(-1)) & (x.max(-1) < 250)).sum()) for x in shown]
    assert min(greys[:2]) > 20, "the last is beyond the volume"
    assert Film(what="cut", frames=3).count == len(shown)
