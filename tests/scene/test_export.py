import numpy as np
import torch
from torch.testing import assert_close

from tests.fields.surfels.ply_files import vertices
from tests.fields.surfels.samples import sample
from tests.fields.surfels.test_composition import CAMERA, ball
from tests.refusals import refused
from texgs.core.geometry import quats_to_matrices
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import mean_texels, owners
from texgs.scene.export import export_model
from texgs.scene.export_keys import Export
from texgs.scene.joined import join_surfels, polydata_of

EDITS = [PartEdit(palette=(0.9, 0.1, 0.4), opacity=0.6), PartEdit(visible=False), PartEdit(opacity=3.0)]


def plain(seed):
    """A ball with a texture that is constant on each surfel, so that one colour each is the whole of it."""
    p = dict(ball(seed).parameters)
    first = p["texels"][p["offsets"]]
    p["texels"] = first.repeat_interleave(p["sizes"].long().prod(1), dim=0)
    return Surfels(p, ball(seed).shading)


def test_normals_of_their_own_stay_in_a_scene():
    one, other = ball(1), ball(2)
    own = torch.randn(len(one), 4, generator=torch.Generator().manual_seed(0))
    lit = Surfels({**one.parameters, "normals": own}, one.shading)
    surfels = join_surfels(Composition([lit, other]).parts, [PartEdit(), PartEdit()])
    assert torch.equal(surfels.parameters["normals"], torch.cat([own, other.parameters["quats"]]))
    expected = quats_to_matrices(surfels.parameters["normals"])[..., 2]
    assert_close(torch.from_numpy(polydata_of(surfels).cell_data["Normals"]), expected)
    assert "normals" not in join_surfels(Composition([other]).parts, [PartEdit()]).parameters


def test_owners_and_means_by_brute_force():
    p = dict(sample(n=5).parameters)
    order = torch.tensor([3, 0, 4, 1, 2])  # textures lie in another order than surfels, with a gap before
    p["sizes"], p["offsets"] = p["sizes"][order], p["offsets"][order] + 2
    p["texels"] = torch.cat([torch.full((2, 3), torch.nan), p["texels"]])
    place, surfel = owners(p)
    expected = [
        (int(offset) + k, n)
        for n, (offset, size) in enumerate(zip(p["offsets"], p["sizes"], strict=True))
        for k in range(int(size.prod()))
    ]
    assert list(zip(place.tolist(), surfel.tolist(), strict=True)) == expected
    p["texels"] = p["texels"].nan_to_num()
    by_hand = [p["texels"][place[surfel == n]].double().mean(0) for n in range(5)]
    assert_close(mean_texels(p), torch.stack(by_hand))


def test_joined_surfels_look_like_the_edited_scene_without_light():
    models = [plain(1), plain(2), ball(3, stage="shading", middle=0.1)]
    scene = Composition(models)
    expected = scene.render(CAMERA, edits=EDITS, look="unshaded")
    surfels = join_surfels(scene.parts, EDITS)
    assert (len(surfels), surfels.stage) == (300, "surfels")
    rendered = surfels.render(CAMERA)
    assert_close(rendered.alpha, expected.alpha, atol=1e-5, rtol=0)
    assert_close(rendered.color, expected.color, atol=1e-5, rtol=0)


def test_nothing_visible_is_refused():
    parts = Composition([ball(1)]).parts
    for edit in (PartEdit(visible=False), PartEdit(opacity=0)):
        refused(
            lambda edit=edit: join_surfels(parts, [edit]), "expected at least one visible surfel, got none"
        )
    refused(lambda: join_surfels(parts, EDITS[:2]), "edits: expected one for each of 1 models, got 2")


def test_points_are_means_and_mean_colors_of_opaque_surfels(tmp_path):
    model = ball(1)
    p = model.parameters
    points = vertices(export_model(tmp_path / "points.ply", model, Export("points", opacity=0.6)))
    opaque = (torch.sigmoid(p["opacities"]) >= 0.6).nonzero()[:, 0]
    assert 0 < len(opaque) == len(points) < len(model)
    for point, n in zip(points, opaque.tolist(), strict=True):
        texels = p["texels"][p["offsets"][n] :][: int(p["sizes"][n].prod())]
        color = (p["colors"][n] + p["palette"] + texels.mean(0)).clamp(0, 1) * 255
        assert [point[axis] for axis in "xyz"] == p["means"][n].tolist()
        got = np.array([point["red"], point["green"], point["blue"]], np.float64)
        assert np.abs(got - color.numpy()).max() <= 0.51


def test_points_before_shading_have_the_constant_harmonic(tmp_path):
    model = sample("surfels", n=9)
    points = vertices(export_model(tmp_path / "points.ply", model, Export("points", opacity=0.0)))
    color = (0.5 + 0.28209479 * model.parameters["sh"][:, 0]).clamp(0, 1) * 255
    got = np.stack([points[name] for name in ("red", "green", "blue")], axis=1)
    assert np.abs(got - color.numpy()).max() <= 0.51


def test_a_scene_without_opaque_surfels_has_no_points(tmp_path):
    refused(
        lambda: export_model(tmp_path / "points.ply", ball(1), Export("points", opacity=0.9999)),
        r"opacity of 0\.9999",
    )
    assert not list(tmp_path.iterdir())
