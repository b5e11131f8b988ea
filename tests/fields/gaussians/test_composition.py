import pytest
import torch
from torch.testing import assert_close

from tests.fields.gaussians.samples import sample
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError, ConfigError
from texgs.fields.gaussians.model import Gaussians, JoinedGaussians
from texgs.fields.kinds import kinds
from texgs.fields.part_edit import PartEdit

CAMERA = orbit(30, 20, 3, 40, 48, 40)
OUTPUTS = ("depth", "median")


def assert_same(rendered, expected):
    for name in ("color", "alpha", *OUTPUTS):
        assert torch.equal(getattr(rendered, name), getattr(expected, name)), name


@pytest.mark.parametrize("edits", [None, [PartEdit()]])
def test_one_model_unedited_is_the_model_bit_for_bit(edits):
    model = sample(40)
    assert_same(
        JoinedGaussians([model]).render(CAMERA, edits=edits, outputs=OUTPUTS),
        model.render(CAMERA, outputs=OUTPUTS),
    )


def test_a_scene_is_the_union_whatever_the_order():
    models = [sample(40, seed=1), sample(30, seed=2, degree=1), sample(20, seed=3, degree=0)]
    scene = JoinedGaussians(models)
    assert (len(scene), scene.palettes, str(scene.device)) == (90, [(0.0, 0.0, 0.0)] * 3, "cpu")
    turned = JoinedGaussians(models[::-1]).render(CAMERA)
    assert_close(scene.render(CAMERA).color, turned.color, atol=1e-6, rtol=0)
    apart = models[0].render(CAMERA).alpha
    assert bool((scene.render(CAMERA).alpha >= apart - 1e-3).all()), "nothing is lost"


def test_hiding_is_removing_bit_for_bit():
    models = [sample(40, seed=1), sample(30, seed=2), sample(20, seed=3)]
    edits = [PartEdit(), PartEdit(visible=False), PartEdit()]
    assert_same(
        JoinedGaussians(models).render(CAMERA, edits=edits, outputs=OUTPUTS),
        JoinedGaussians([models[0], models[2]]).render(CAMERA, outputs=OUTPUTS),
    )


def test_an_opacity_is_a_factor_and_at_most_one():
    models = [sample(40, seed=1), sample(30, seed=2)]
    rendered = JoinedGaussians(models).render(CAMERA, edits=[PartEdit(opacity=0.4), PartEdit(opacity=1000.0)])
    p, q = (model.parameters for model in models)
    faint = Gaussians({**p, "opacities": torch.logit(0.4 * p["opacities"].sigmoid())})
    solid = Gaussians({**q, "opacities": torch.full((30,), 40.0)})
    assert_close(rendered.color, JoinedGaussians([faint, solid]).render(CAMERA).color, atol=2e-5, rtol=0)


@pytest.mark.parametrize(
    ("edit", "name"),
    [
        (PartEdit(palette=(1, 0, 0)), "palette"),
        (PartEdit(ambient=0.5), "ambient"),
        (PartEdit(diffuse=0.5), "diffuse"),
        (PartEdit(specular=0.5), "specular"),
        (PartEdit(shininess=2.0), "shininess"),
    ],
)
def test_other_edits_are_refused(edit, name):
    with pytest.raises(
        ArgumentError, match=f"{name}: expected a model that can .* one of gaussians; fit surfels"
    ):
        JoinedGaussians([sample()]).render(CAMERA, edits=[edit])


def test_looks_without_light_are_refused():
    with pytest.raises(ArgumentError, match="look: expected shaded, got diffuse; gaussians have light"):
        JoinedGaussians([sample()]).render(CAMERA, look="diffuse")


def test_what_is_no_scene_is_refused():
    with pytest.raises(ArgumentError, match="models: expected at least one, got none"):
        JoinedGaussians([])
    with pytest.raises(ArgumentError, match="expected all with the antialiased filter or none, got both"):
        JoinedGaussians([sample(), sample(antialiased=True)])
    with pytest.raises(ArgumentError, match="segments: expected none of gaussians"):
        JoinedGaussians([sample()], [[torch.ones(7, dtype=torch.bool)]])
    with pytest.raises(ArgumentError, match="edits: expected one for each of 1 models, got 2"):
        JoinedGaussians([sample()]).render(CAMERA, edits=[PartEdit(), PartEdit()])


def test_the_kind_composes_and_says_what_it_cannot_do():
    from texgs.fields.kinds import require

    kind = kinds()["gaussians"]
    assert isinstance(kind.compose([sample()], [()]), JoinedGaussians)
    with pytest.raises(ConfigError, match="expected a fit of surfels, got one of gaussians, which has no"):
        require("gaussians", {"palette"}, "edit=crimson")
