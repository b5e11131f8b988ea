"""What holds for all fields with light in their colours: a scene of them changes their opacity alone."""

import pytest
import torch

from tests.fields.gaussians.samples import sample
from tests.fields.palette.test_palette import box
from tests.fields.voxels.test_voxels import ball
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError, ConfigError, TexgsError
from texgs.core.light import Light
from texgs.fields.kinds import kinds, require
from texgs.fields.part_edit import PartEdit

CAMERA = orbit(30, 20, 4, 30, 48, 40)
FIELDS = {"gaussians": lambda: sample(40), "palette": lambda: box(scale=1.0), "voxels": ball}


def compose(fields, segments=()):
    return kinds()[fields[0].kind].compose(fields, segments)


@pytest.fixture(params=FIELDS)
def field(request):
    return FIELDS[request.param]()


@pytest.mark.parametrize("edits", [None, [PartEdit()]])
def test_a_scene_of_one_is_the_field_bit_for_bit(field, edits):
    alone = field.render(CAMERA, outputs=("depth",))
    scene = compose([field])
    shown = scene.render(CAMERA, Light("directional", 100, 30), edits, outputs=("depth",))
    for name in ("color", "alpha", "depth"):
        assert torch.equal(getattr(shown, name), getattr(alone, name)), name
    assert (len(scene), str(scene.device), scene.palettes) == (len(field), "cpu", [(0.0, 0.0, 0.0)])


def test_light_changes_nothing_and_the_background_is_white_unless_told(field):
    rendered, grey = field.render(CAMERA, Light("directional", 100, 30)), torch.tensor([0.1, 0.2, 0.3])
    assert torch.equal(rendered.color, field.render(CAMERA).color)
    empty = rendered.alpha == 0
    assert bool((rendered.color[empty] == 1).all())
    assert bool((field.render(CAMERA, background=grey).color[empty] == grey).all())
    hidden = compose([field]).render(CAMERA, edits=[PartEdit(visible=False)], background=grey)
    assert bool((hidden.color == grey).all())


@pytest.mark.parametrize(
    "edit",
    [
        {"palette": (1, 0, 0)},
        {"ambient": 0.5},
        {"diffuse": 0.5},
        {"specular": 0.5},
        {"shininess": 2.0},
        {"tint": (1, 1, 0)},
    ],
)
def test_other_edits_are_refused(field, edit):
    message = f"{next(iter(edit))}: expected a model that can .*, got {field.kind}; fit surfels"
    with pytest.raises(ArgumentError, match=message):
        compose([field]).render(CAMERA, edits=[PartEdit(**edit)])


def test_what_cannot_be_shown_is_refused(field):
    scene = compose([field])
    for render, message in (
        (lambda: scene.render(CAMERA, edits=[]), "edits: expected one for each of 1 models, got 0"),
        (
            lambda: scene.render(CAMERA, edits=[PartEdit()] * 2),
            "edits: expected one for each of 1 models, got 2",
        ),
        (
            lambda: scene.render(CAMERA, look="diffuse"),
            f"look: expected shaded, got diffuse; {field.kind} have",
        ),
        (lambda: field.render(CAMERA, outputs=("normal",)), "outputs: expected depth of |have no normal"),
        (lambda: type(scene)([]), "models: expected at least one, got none"),
        (lambda: compose([field], [[torch.ones(7)]]), f"segments: expected none of {field.kind}"),
    ):
        with pytest.raises(TexgsError, match=message):
            render()
    message = f"expected a fit of surfels, got one of {field.kind}, which has no"
    with pytest.raises(ConfigError, match=message):
        require(field.kind, {"palette"}, "edit=crimson")
