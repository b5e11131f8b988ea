import torch
from torch.testing import assert_close

from tests.fields.gaussians.samples import sample
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.fields.gaussians.model import Gaussians, JoinedGaussians
from texgs.fields.part_edit import PartEdit

CAMERA = orbit(30, 20, 3, 40, 48, 40)
OUTPUTS = ("depth", "median")


def assert_same(rendered, expected):
    for name in ("color", "alpha", *OUTPUTS):
        assert torch.equal(getattr(rendered, name), getattr(expected, name)), name


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


def test_filters_that_differ_are_no_scene():
    refused(lambda: JoinedGaussians([sample(), sample(antialiased=True)]), "antialiased")
