"""How much light reaches surfels: of which depths it is, what hides it, and when it is found again."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.refusals import refused
from tests.scene.balls import balls_in_a_volume, shell
from texgs.core.camera import orbit
from texgs.core.cuts import Cuts, Plane
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, raw_material
from texgs.scene.exposure import absorbed, exposure_of, require_shadows
from texgs.scene.parts import replace_entry
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.session import Session
from texgs.scene.twin import Twin

UP = (0.0, 1.0, 0.0)
FROM_ABOVE = Light("directional", 0.0, 90.0, shadows=1.0)
SKY = Light("headlight", occlusion=1.0)
HIDDEN = PartEdit(visible=False)
FRAMES = st.lists(st.floats(0, 30), min_size=3, max_size=9).filter(lambda each: sum(each) > 0.01)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A scene that shows an opaque ball with a radius of 0.2."""
    return edited(balls_in_a_volume(tmp_path_factory.mktemp("balls"), light=FROM_ABOVE), low=HIDDEN)


@pytest.fixture(scope="module")
def twin(scene):
    return Twin(scene)


def edited(scene, **edits):
    for name, edit in edits.items():
        scene = replace_entry(scene, name, replace(scene.models[name], edit=edit))
    return scene


def surfels(*places, normal=UP):
    """Surfels [N] at places on the y axis, all with one normal."""
    count = len(places)
    p = shell(torch.tensor([normal]).expand(count, 3), 0.0, 0.01, 2.0)
    p["means"] = torch.tensor([[0.0, y, 0.0] for y in places])
    p |= {"colors": torch.full((count, 3), 0.5), **raw_material(0.4, 0.5, 0.2, 20.0, "bounded")}
    none = Surfels({name: x[:1] for name, x in p.items()}, ShadingModel(), "shading")
    return Composition([Surfels(p, ShadingModel(), "shading"), none])


def exposures(twin, scene, composed, light=FROM_ABOVE):
    found = exposure_of(composed, replace(scene, light=light), twin)
    return None if found is None else found[: len(composed) - 1]


@given(met=FRAMES)
def test_two_places_have_the_mean_and_the_spread_of_where_rays_end(met):
    steps = np.linspace(1.0, -1.0, len(met))
    left = np.concatenate([[1.0], 2.0 ** -np.cumsum(met)])
    weights = -np.diff(left) / (1 - left[-1])
    places = absorbed(torch.tensor(met)[:, None], torch.from_numpy(steps).float()).double().numpy()[:, 0]
    mean = (weights * steps).sum()
    assert places.mean() == pytest.approx(mean, abs=2e-3)
    assert ((places - mean) ** 2).mean() == pytest.approx((weights * (steps - mean) ** 2).sum(), abs=4e-3)


def test_surfels_without_matter_stay_where_they_are():
    steps = torch.tensor([1.0, 0.0, -1.0])
    assert absorbed(torch.zeros(3, 4), steps).equal(torch.zeros(2, 4))


def test_surfels_below_an_opaque_surface_are_as_light_as_those_on_it(scene, twin):
    cell = twin.matter(scene, surfels(0.0).palettes).edge
    heights = torch.linspace(-0.5, 0.5, 401)
    dense = twin.matter(scene, surfels(0.0).palettes).at(torch.stack([0 * heights, heights, 0 * heights], 1))
    top = float(heights[dense > 1].max())  # where half of the light is gone within a cell
    composed = surfels(*(top - depth * cell for depth in (0.0, 0.5, 1.0)))
    exposed = exposures(twin, scene, composed)[:, 0]
    own = twin.light_cells(scene, composed.palettes).at(composed.means[:3])[:, 0]
    assert exposed.min() > 0.5
    assert exposed.max() - exposed.min() < 0.25 * (own.max() - own.min())


def test_light_comes_from_the_side_that_faces_it(scene, twin):
    low, top = (exposures(twin, scene, surfels(y))[0, 0] for y in (-0.3, 0.3))
    assert top > 0.95
    assert low < 0.3, "the sphere is in between"
    turned = exposures(twin, scene, surfels(0.3, normal=(0.0, -1.0, 0.0)))
    assert float(turned[0, 0]) == pytest.approx(float(top), abs=0.02)


def test_strengths_are_shares_of_what_is_taken_away(scene, twin):
    composed = surfels(-0.3)
    whole = exposures(twin, scene, composed)[0, 0]
    half = exposures(twin, scene, composed, replace(FROM_ABOVE, shadows=0.5))[0, 0]
    assert float(half) == pytest.approx(1 - 0.5 * (1 - float(whole)))


def test_ambient_light_is_that_of_the_lighter_side(scene, twin):
    inside, outside = exposures(twin, scene, surfels(0.0, 0.3), SKY)[:, 1]
    assert inside < 0.05
    assert outside > 0.8
    assert exposures(twin, scene, surfels(0.0), SKY)[0, 0] == 1, "a headlight casts no shadows"


def test_hidden_models_and_what_is_cut_away_hide_nothing(scene, twin):
    composed = surfels(-0.3)
    open_ = replace(scene, cuts=Cuts([Plane([0.0, 1.0, 0.0], -0.25)]))
    assert exposures(twin, open_, composed)[0, 0] > 0.95
    assert exposure_of(composed, edited(scene, high=HIDDEN), twin) is None


def test_less_opacity_hides_less(scene, twin):
    composed = surfels(-0.3)
    before = exposures(twin, scene, composed)[0, 0]
    fainter = edited(scene, high=PartEdit(opacity=0.01))
    assert exposures(twin, fainter, composed)[0, 0] > before + 0.1


def test_it_is_kept_while_nothing_but_the_camera_changes(scene, twin):
    composed = surfels(-0.3, 0.2)
    first = exposure_of(composed, scene, twin)
    assert exposure_of(composed, scene, twin) is first
    turned = replace(scene, light=FROM_ABOVE.turned(20.0, 10.0))
    assert exposure_of(composed, turned, twin) is not first
    assert exposure_of(composed, replace(scene, light=FROM_ABOVE.unhidden), twin) is None


def test_shadows_need_a_volume(tmp_path):
    scene = Scene({"a": SceneModel(tmp_path / "a.safetensors")}, FROM_ABOVE)
    refused(lambda: exposure_of(surfels(0.0), scene, None), "volume", ArgumentError)
    refused(lambda: require_shadows(scene), "volume", ArgumentError)


@pytest.mark.parametrize("mode", ["normal", "depth", "alpha", "texture"])
def test_modes_that_show_no_light_need_no_volume_for_shadows(scene, mode):
    camera = orbit(30, 20, 3.0, 40.0, 24, 24)
    lit, plain = (Session(each).frame(camera, mode) for each in (scene, replace(scene, light=HEADLIGHT)))
    np.testing.assert_array_equal(lit, plain)
